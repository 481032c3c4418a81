//! Tests of tables and folders of tables, as spreadsheets and pandas write them.

use std::fmt::Write;
use std::path::Path;

use tactnet_data::Remedy;
use tactnet_data::format::{self, Keep, ReadOptions};

#[cfg(feature = "parquet")]
use crate::fixture;
use crate::hostile::npy;
use crate::own_data::assert_line;
use crate::{expected_materials, expected_samples, names};

/// Returns the frames of the fixtures' sweeps as lines of a table.
pub(crate) fn frames(separator: char, first: impl Fn(usize, usize) -> String) -> Vec<String> {
    let samples = expected_samples();
    let sweeps = samples.chunks_exact(60 * 16).enumerate();
    sweeps
        .map(|(sweep, frames)| {
            let mut text = String::new();
            for (step, frame) in frames.chunks_exact(16).enumerate() {
                let values: Vec<String> = frame.iter().map(u8::to_string).collect();
                let values = values.join(&separator.to_string());
                writeln!(text, "{}{values}", first(sweep, step)).unwrap();
            }
            text
        })
        .collect()
}

/// Returns the names of sixteen taxels, each after a separator.
pub(crate) fn columns(separator: char) -> String {
    (0..16)
        .map(|taxel| format!("{separator}taxel{taxel}"))
        .collect()
}

pub(crate) fn write(path: &Path, text: &str) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
}

#[test]
fn a_table_of_labels_describes_the_files_of_a_folder() {
    let dir = tempfile::tempdir().unwrap();
    let materials = expected_materials();
    // With a name for every column and times, separated by semicolons.
    let listed = dir.path().join("listed");
    let header = columns(';');
    let mut labels = String::from("file,material,block,test\n");
    for (sweep, text) in frames(';', |_, step| format!("{};", step as f64 / 100.0))
        .iter()
        .enumerate()
    {
        write(
            &listed.join(format!("sweeps/{sweep}.csv")),
            &format!("time{header}\n{text}"),
        );
        let material = &materials[sweep / 4];
        writeln!(
            labels,
            "sweeps/{sweep}.csv, {material},{},{}",
            sweep % 2,
            sweep % 4 / 3
        )
        .unwrap();
    }
    write(&listed.join("labels.csv"), &labels);
    let dataset = format::read(&listed).unwrap();
    assert_line(&dataset);
    assert_eq!(names(&dataset), materials);
    assert_eq!(
        (dataset.sample_rate_hz(), dataset.is_rate_assumed()),
        (100.0, false)
    );
    assert_eq!(dataset.records()[7].block, Some(1));
    assert_eq!(dataset.records()[7].test, Some(true));
}

/// Sessions of one name are one block of all materials, in a table of labels, in the names of files and in a table of frames.
#[test]
fn sessions_of_equal_name_are_one_block_in_every_layout() {
    let dir = tempfile::tempdir().unwrap();
    let (listed, named) = (dir.path().join("listed"), dir.path().join("named"));
    let table = dir.path().join("frames.csv");
    let materials = expected_materials();
    // Of each material's four sweeps two are of Monday and two of Friday; `day` is another grouping.
    let session = |sweep: usize| ["monday", "friday"][sweep % 4 / 2];
    let mut labels = String::from("file,material,session,day\n");
    let mut rows = format!("step,sweep,material,session,day{}\n", columns(','));
    for (sweep, text) in frames(',', |_, _| String::new()).iter().enumerate() {
        let material = &materials[sweep / 4];
        write(&listed.join(format!("{sweep}.csv")), text);
        write(
            &named.join(format!("{material}/{}/{sweep}.csv", session(sweep))),
            text,
        );
        writeln!(
            labels,
            "{sweep}.csv,{material},{},{}",
            session(sweep),
            sweep % 2
        )
        .unwrap();
        for (step, line) in text.lines().enumerate() {
            writeln!(
                rows,
                "{step},{sweep},{material},{},{},{line}",
                session(sweep),
                sweep % 2
            )
            .unwrap();
        }
    }
    write(&listed.join("labels.csv"), &labels);
    write(&table, &rows);
    let blocks =
        |path: &Path, options: &ReadOptions| -> Result<Vec<u32>, tactnet_data::DataError> {
            let dataset = format::read_with(path, options)?;
            Ok(dataset
                .records()
                .iter()
                .filter_map(|record| record.block)
                .collect())
        };
    let by_name = ReadOptions {
        layout: format::FileLayout {
            names: Some("{material}/{block}/{sweep}.csv".parse().unwrap()),
            ..Default::default()
        },
        ..ReadOptions::default()
    };
    let sessions: Vec<u32> = (0..12).map(|sweep| u32::from(sweep % 4 < 2)).collect();
    assert_eq!(blocks(&listed, &ReadOptions::default()).unwrap(), sessions);
    assert_eq!(blocks(&table, &ReadOptions::default()).unwrap(), sessions);
    let mut found = blocks(&named, &by_name).unwrap();
    found.sort_unstable();
    assert_eq!(found, [[0; 6], [1; 6]].concat());

    let naming = |blocks: &str| ReadOptions {
        blocks: Some(blocks.into()),
        ..ReadOptions::default()
    };
    let days: Vec<u32> = (0..12).map(|sweep| sweep % 2).collect();
    for path in [&listed, &table] {
        assert_eq!(
            blocks(path, &naming("day")).unwrap(),
            days,
            "named blocks come first"
        );
        let error = blocks(path, &naming("sesion")).unwrap_err().to_string();
        assert!(
            error.contains("expected a column `sesion` for the blocks, found"),
            "{error}"
        );
    }
    write_folders(&dir.path().join("folders"));
    let error = blocks(&dir.path().join("folders"), &naming("day"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("expected labels.csv with a column `day`"),
        "{error}"
    );
}

/// Writes one folder per material, without names or times.
fn write_folders(folders: &Path) {
    let materials = expected_materials();
    for (sweep, text) in frames(',', |_, _| String::new()).iter().enumerate() {
        write(
            &folders.join(format!("{}/{sweep:02}.csv", materials[sweep / 4])),
            text,
        );
    }
}

#[test]
fn a_folder_of_tables_per_material_is_a_data_set() {
    let dir = tempfile::tempdir().unwrap();
    let folders = dir.path().join("folders");
    write_folders(&folders);
    let dataset = format::read(&folders).unwrap();
    assert_line(&dataset);
    assert_eq!(names(&dataset), expected_materials());
    assert!(dataset.is_rate_assumed());
    let empty = format::read(dir.path()).unwrap_err().to_string();
    assert!(
        empty.contains("expected labels.csv with columns file, material"),
        "{empty}"
    );
}

#[test]
fn a_sweep_that_is_shorter_than_the_others_is_named_left_out_or_decides_the_length() {
    let dir = tempfile::tempdir().unwrap();
    let folders = dir.path().join("folders");
    write_folders(&folders);
    let short = folders.join(format!("{}/00.csv", expected_materials()[0]));
    let whole = frames(',', |_, _| String::new()).remove(0);
    let text: String = whole.split_inclusive('\n').take(50).collect();
    write(&short, &text);
    let refused = format::read(&folders).unwrap_err();
    assert_eq!(refused.remedy(), Some(Remedy::KeepLengths { steps: 50 }));
    let refused = refused.to_string();
    assert!(refused.contains("60 frames, as"), "{refused}");
    assert!(refused.contains("found 50"), "{refused}");
    let most = ReadOptions {
        keep: Keep::Most,
        ..ReadOptions::default()
    };
    let looked_at = format::read_to_classify_with_gaps(&folders, &most).unwrap();
    assert_eq!(looked_at.dataset.len(), 11);
    let [odd] = &looked_at.odd_lengths[..] else {
        panic!("{:?}", looked_at.odd_lengths)
    };
    assert!(odd.sweep.ends_with("00.csv"), "{odd:?}");
    assert_eq!(odd.frames, 50);
    let cut = format::read_with(&folders, &ReadOptions::keeping(Some(50))).unwrap();
    assert_eq!((cut.len(), cut.shape().steps), (12, 50));
}

#[test]
fn mistakes_in_a_table_of_a_folder_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let folders = dir.path().join("folders");
    write_folders(&folders);
    let short = folders.join(format!("{}/00.csv", expected_materials()[0]));
    let mistakes = [
        (
            "1,2\n1,x\n",
            "line 2, column 2: expected a number, found `x`",
        ),
        (
            "1;2\r\n\r\n1;1,234.5\r\n",
            "line 3, column 2: expected a number, found `1,234.5`; write numbers without thousands separators",
        ),
        (
            "1,2\n1\n",
            "line 2: expected 2 values, as in most lines, found 1",
        ),
        ("1,2\n1,x\ny,2\n5,z\n", "(and 2 more)"),
        ("1,2\n3,4\n", "taxels: expected 2 taxels"),
        ("a,b\n", "file: expected a row per frame, found no frame"),
    ];
    for (text, complaint) in mistakes {
        write(&short, text);
        let refused = format::read(&folders).unwrap_err().to_string();
        assert!(refused.contains(complaint), "{text}: {refused}");
    }
}

#[test]
fn a_folder_of_arrays_is_a_data_set() {
    let dir = tempfile::tempdir().unwrap();
    let materials = expected_materials();
    let samples = expected_samples();
    let write_all = |to: &Path, shape: &str| {
        for (sweep, digits) in samples.chunks_exact(60 * 16).enumerate() {
            let file = to.join(format!("{}/{sweep:02}.npy", materials[sweep / 4]));
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, npy("|u1", shape, digits)).unwrap();
        }
    };

    // The table has no rows and columns of taxels.
    let lines = dir.path().join("lines");
    write_all(&lines, "60, 16");
    let dataset = format::read(&lines).unwrap();
    assert_line(&dataset);
    assert_eq!(names(&dataset), materials);
    assert!(dataset.is_rate_assumed() && dataset.is_patch_assumed());

    // The arrays have rows and columns.
    let grids = dir.path().join("grids");
    write_all(&grids, "60, 4, 4");
    let dataset = format::read(&grids).unwrap();
    assert_eq!((dataset.shape().rows, dataset.shape().cols), (4, 4));
    assert!(!dataset.is_patch_assumed());
    let cut = format::read_with(&grids, &ReadOptions::keeping(Some(50))).unwrap();
    assert_eq!((cut.len(), cut.shape().steps), (12, 50));

    // A single folder is enough if the materials are not needed.
    let some = grids.join(&materials[1]);
    let found = format::read_to_classify(&some, None).unwrap();
    assert_eq!((found.dataset.len(), found.labelled), (4, false));
    assert_eq!(found.names[0], "04");

    let odd = some.join("04.npy");
    let mistakes = [
        (
            npy("|u1", "60, 16", &samples[..960]),
            "expected 4x4 taxels, as",
        ),
        (
            npy("|u1", "1, 60, 4, 4", &samples[..960]),
            "found [1, 60, 4, 4] of u1",
        ),
        (npy("|S4", "2, 2", &[65; 16]), "found [2, 2] of text"),
        (
            npy("|u1", "60, 4, 4", &samples[..900]),
            "found 900 bytes for",
        ),
    ];
    for (bytes, complaint) in mistakes {
        std::fs::write(&odd, bytes).unwrap();
        let refused = format::read(&grids).unwrap_err().to_string();
        assert!(refused.contains(complaint), "{complaint}: {refused}");
        assert!(refused.contains("04.npy"), "{refused}");
    }
}

/// Checks the columns that pandas adds to the taxels, or writes in place of their names.
#[test]
fn columns_that_are_no_taxels_are_none() {
    let dir = tempfile::tempdir().unwrap();
    let materials = expected_materials();
    let folder = dir.path().join("folder");
    let numbers: Vec<String> = (0..16).map(|taxel| taxel.to_string()).collect();
    let fill = |header: &str, first: &dyn Fn(usize, usize) -> String| {
        for (sweep, text) in frames(',', first).iter().enumerate() {
            let file = folder.join(format!("{}/{sweep:02}.csv", materials[sweep / 4]));
            write(&file, &format!("{header}\n{text}"));
        }
    };
    // `to_csv(index=False)` of an array.
    fill(&numbers.join(","), &|_, _| String::new());
    assert_line(&format::read(&folder).unwrap());
    // A changing force and a row number are reported as not read.
    fill(&format!("row,force{}", columns(',')), &|sweep, step| {
        format!("{},{step},", 60 * sweep + step)
    });
    let dataset = format::read(&folder).unwrap();
    assert_line(&dataset);
    let said = dataset.reading_findings()[0].message.clone();
    assert!(
        said.starts_with("`row`, `force`: not read as a taxel"),
        "{said}"
    );
    // The same columns in one table.
    let path = dir.path().join("frames.csv");
    let rows = frames(',', |sweep, step| {
        format!("{sweep},{},{step}.5,", materials[sweep / 4])
    });
    let table = format!("sweep,material,force{}\n{}", columns(','), rows.concat());
    write(&path, &table);
    let dataset = format::read(&path).unwrap();
    assert_line(&dataset);
    assert!(
        dataset.reading_findings()[0]
            .message
            .starts_with("`force`: not read as a taxel")
    );

    // The table does not list this file.
    let one = folder.join("labels.csv");
    write(&folder.join("a.csv"), &frames(',', |_, _| String::new())[0]);
    write(&folder.join("b.csv"), &frames(',', |_, _| String::new())[1]);
    write(&one, "file,material\na.csv,felt\n");
    let dataset = format::read(&folder).unwrap();
    assert_eq!(dataset.len(), 1);
    assert_eq!(
        dataset.reading_findings()[0].message,
        "files that labels.csv does not list: `b`"
    );
}

#[test]
fn a_table_with_a_row_per_frame_is_a_data_set() {
    let dir = tempfile::tempdir().unwrap();
    let materials = expected_materials();
    let path = dir.path().join("frames.csv");
    let header = columns(',');
    let rows = frames(',', |sweep, step| {
        format!("s{sweep},{},{},", materials[sweep / 4], step as f64 / 100.0)
    });
    write(
        &path,
        &format!("sweep,material,time{header}\n{}", rows.concat()),
    );
    let dataset = format::read(&path).unwrap();
    assert_line(&dataset);
    assert_eq!(names(&dataset), materials);
    assert_eq!(dataset.sample_rate_hz(), 100.0);

    write(&path, "sweep,taxel0\n1,2\n");
    let refused = format::read(&path).unwrap_err().to_string();
    assert!(
        refused.contains("column `material`: expected a table with columns `sweep`, `material` and one per taxel, found only `sweep`, `taxel0`"),
        "{refused}"
    );
    write(&path, "sweep,material,taxel0\n1,felt,2\n1,cork,2\n");
    let refused = format::read(&path).unwrap_err().to_string();
    assert!(
        refused.contains("row 2: expected one material, found `felt` and `cork`"),
        "{refused}"
    );
}

#[cfg(feature = "parquet")]
#[test]
fn a_parquet_table_of_pandas_is_a_data_set() {
    let dataset = format::read(&fixture("read/frames.parquet")).unwrap();
    assert_line(&dataset);
    assert_eq!(names(&dataset), expected_materials());
    assert_eq!(
        (dataset.sample_rate_hz(), dataset.is_rate_assumed()),
        (100.0, false)
    );
    let refused = format::read(&fixture("read/bad_missing.parquet"))
        .unwrap_err()
        .to_string();
    assert!(refused.contains("column `taxel3`: expected"), "{refused}");
}

#[cfg(feature = "parquet")]
#[test]
fn episodes_of_lerobot_are_sweeps_and_tasks_are_materials() {
    for version in ["read/lerobot_v2", "read/lerobot_v3"] {
        let dataset = format::read(&fixture(version)).unwrap();
        assert_line(&dataset);
        assert_eq!(names(&dataset), expected_materials(), "{version}");
        assert_eq!(dataset.sample_rate_hz(), 100.0, "{version}");
        let note = &dataset.reading_findings()[0].message;
        assert!(note.contains("`observation.state`"), "{version}: {note}");

        let named = |name: &str| ReadOptions {
            samples: Some(name.into()),
            ..ReadOptions::default()
        };
        let state = format::read_with(&fixture(version), &named("observation.state")).unwrap();
        assert_eq!(state.shape().taxels(), 2, "{version}");
        assert_eq!(state.sweep(1)[..2], [0.5, 60.0], "{version}");
        let refused = format::read_with(&fixture(version), &named("action")).unwrap_err();
        assert_eq!(refused.remedy(), Some(Remedy::NameSamples), "{version}");
    }
}

/// The same sweeps in the dialects of spreadsheets, loggers and NumPy.
#[test]
fn tables_are_read_as_the_world_writes_them() {
    let dir = tempfile::tempdir().unwrap();
    let materials = expected_materials();
    type Change = fn(&str) -> String;
    let dialects: [(&str, Change); 12] = [
        ("CRLF", |text| text.replace('\n', "\r\n")),
        ("CR", |text| text.replace('\n', "\r")),
        ("last separator", |text| text.replace('\n', ",\n")),
        ("tabs", |text| text.replace(',', "\t")),
        ("blanks", |text| text.replace(',', "   ")),
        ("bars", |text| text.replace(',', "|")),
        ("decimal comma", |text| {
            text.replace(',', ",0;").replace('\n', ",0\n")
        }),
        ("quotes", |text| {
            format!(
                "\"{}\"\n",
                text.trim_end()
                    .replace(',', "\",\"")
                    .replace('\n', "\"\n\"")
            )
        }),
        ("comments", |text| {
            format!("# skin\n# gain 3, offset 2\n{text}")
        }),
        ("preamble", |text| format!("Logger 3\nrate; fast\n\n{text}")),
        ("byte order mark", |text| format!("\u{feff}{text}")),
        ("blanks after separators", |text| text.replace(',', ", ")),
    ];
    for (dialect, change) in dialects {
        let folder = dir.path().join(dialect);
        for (sweep, text) in frames(',', |_, _| String::new()).iter().enumerate() {
            let place = folder.join(format!("{}/{sweep:02}.csv", materials[sweep / 4]));
            write(&place, &change(text));
        }
        let dataset = format::read(&folder).unwrap_or_else(|error| panic!("{dialect}: {error}"));
        assert_line(&dataset);
    }
}

#[test]
fn names_in_a_comment_count_the_columns() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("named.csv");
    let taxels = |text: &str| {
        write(&path, text);
        let sweeps = format::read_to_classify(&path, None).unwrap();
        (
            sweeps.dataset.shape().taxels(),
            sweeps.dataset.shape().steps,
        )
    };
    assert_eq!(taxels("# a;b\n1;2\n3;4\n5;6\n"), (2, 3));
    // A separator at the end of every line makes no column.
    assert_eq!(taxels("# a;b;\n1;2;\n3;4;\n5;6;\n"), (2, 3));
    // The last column has a name and no values.
    write(&path, "# a;b\n1;\n3;\n5;\n");
    let refused = format::read_to_classify(&path, None).unwrap_err();
    assert!(
        refused
            .to_string()
            .contains("3 that are not, the first NaN"),
        "{refused}"
    );
}
