//! Tests of users' own files: `X` and `y`, tables, folders.

use std::fs::File;
use std::path::{Path, PathBuf};

use tactnet_data::format::{self, Format, read_to_classify};
use tactnet_data::{
    ASSUMED_RATE_HZ, DataSource, Dataset, FindingKind, LabelSet, Samples, SweepRecord, SweepShape,
    check,
};
use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use crate::hostile::{archive, npy};
use crate::tables::write;
use crate::written::is_same;
use crate::{expected_materials, expected_samples, fixture, names};

/// Returns the twelve sweeps of the fixtures, with the taxels in one line.
pub(crate) fn assert_line(dataset: &Dataset) {
    assert_eq!(dataset.samples(), &Samples::U8(expected_samples()));
    let shape = SweepShape {
        steps: 60,
        rows: 1,
        cols: 16,
    };
    assert_eq!(dataset.shape(), shape);
}

#[test]
fn x_and_y_are_sweeps_and_their_materials() {
    let numbers = format::read(&fixture("read/x_y_float16.npz")).unwrap();
    assert_line(&numbers);
    assert_eq!(names(&numbers), ["0", "1", "2"]);
    assert!(numbers.is_rate_assumed());
    assert_eq!(numbers.sample_rate_hz(), ASSUMED_RATE_HZ);

    let words = format::read(&fixture("read/x_y_names.npz")).unwrap();
    assert_eq!(words.samples(), &Samples::U8(expected_samples()));
    assert_eq!(names(&words), expected_materials());
    assert_eq!(
        (words.is_rate_assumed(), words.sample_rate_hz()),
        (false, 100.0)
    );
    assert_eq!((words.shape().rows, words.shape().cols), (4, 4));

    let numbered = format::read(&fixture("read/materials_are_numbers.h5")).unwrap();
    assert_eq!(names(&numbered), ["7", "10", "200"]);
}

#[test]
fn an_assumed_rate_stays_assumed_until_somebody_names_it() {
    let dir = tempfile::tempdir().unwrap();
    let assumed = format::read(&fixture("read/x_y_float16.npz")).unwrap();
    let warned = |dataset: &Dataset| {
        check(dataset)
            .iter()
            .any(|finding| finding.kind == FindingKind::AssumedRate)
    };
    assert!(warned(&assumed));
    assert!(assumed.clone().first_steps(20).unwrap().is_rate_assumed());
    assert!(assumed.of_materials(&[0, 2]).unwrap().is_rate_assumed());
    for file in ["copy.h5", "copy.npz"] {
        let path = dir.path().join(file);
        Format::from_extension(&path)
            .unwrap()
            .write(&path, &assumed)
            .unwrap();
        let copy = format::read(&path).unwrap();
        assert!(is_same(&copy, &assumed) && copy.is_rate_assumed(), "{file}");

        let source = DataSource::File(path.clone());
        let named = source.read_at(Some(100.0)).unwrap();
        assert_eq!(
            (named.sample_rate_hz(), named.is_rate_assumed()),
            (100.0, false)
        );
        assert!(!warned(&named));
        Format::from_extension(&path)
            .unwrap()
            .write(&path, &named)
            .unwrap();
        assert!(!format::read(&path).unwrap().is_rate_assumed());
        let other = source.read_at(Some(50.0)).unwrap();
        assert_eq!(other.sample_rate_hz(), 50.0);
        assert_eq!(other.reading_findings()[0].kind, FindingKind::NamedRate);
    }
    let square = assumed.with_patch(4, 4).unwrap();
    assert!(square.is_rate_assumed() && square.shape().rows == 4);
    let odd = square.with_patch(4, 5).unwrap_err().to_string();
    assert_eq!(
        odd,
        "shape: expected rows by columns of 16 taxels, found 4x5"
    );
}

#[test]
fn numbers_that_count_on_are_no_taxel_and_slow_frames_no_texture() {
    let kinds = |counter: &dyn Fn(usize, usize) -> f32, rate: f64| -> Vec<FindingKind> {
        let values = (0..4)
            .flat_map(|sweep| (0..20).map(move |step| (sweep, step)))
            .flat_map(|(sweep, step)| [counter(sweep, step), ((sweep * 7 + step * 3) % 11) as f32])
            .collect();
        let shape = SweepShape {
            steps: 20,
            rows: 1,
            cols: 2,
        };
        let labels = LabelSet::new(["a", "b"]).unwrap();
        let records = (0..4)
            .map(|sweep| SweepRecord::new(sweep % 2, sweep / 2))
            .collect();
        let samples = Samples::F32(values);
        let dataset = Dataset::at_rate("own", Some(rate), shape, labels, records, samples);
        check(&dataset.unwrap())
            .iter()
            .map(|finding| finding.kind)
            .collect()
    };
    let on = |sweep: usize, step: usize| (100 + 20 * sweep + step) as f32;
    assert!(kinds(&on, 100.0).contains(&FindingKind::ClockTaxel));
    let noise = |sweep: usize, step: usize| ((sweep * 5 + step * 8) % 13) as f32;
    assert!(!kinds(&noise, 100.0).contains(&FindingKind::ClockTaxel));
    assert!(!kinds(&noise, 100.0).contains(&FindingKind::LongSweeps));
    assert!(kinds(&noise, 0.5).contains(&FindingKind::LongSweeps));
}

#[test]
fn axes_in_another_order_and_short_sweeps_are_suspicious() {
    let shape = SweepShape {
        steps: 8,
        rows: 8,
        cols: 300,
    };
    let dataset = format::read(&fixture("read/x_y_float16.npz")).unwrap();
    let kinds = |dataset: &Dataset| -> Vec<FindingKind> {
        check(dataset)
            .into_iter()
            .map(|finding| finding.kind)
            .collect()
    };
    assert!(!kinds(&dataset).contains(&FindingKind::AxisOrder));
    assert!(!kinds(&dataset).contains(&FindingKind::ShortSweeps));
    assert!(!kinds(&dataset).contains(&FindingKind::LongSweeps));
    let period = dataset.clone().with_sample_rate(0.01).unwrap();
    assert!(kinds(&period).contains(&FindingKind::LongSweeps));
    let values = (0..6 * shape.values())
        .map(|at| (at * 7919 % 251) as u8)
        .collect();
    let records = dataset.records()[..6].to_vec();
    let turned = Dataset::new(
        "turned",
        750.0,
        shape,
        dataset.labels().clone(),
        records,
        Samples::U8(values),
    )
    .unwrap();
    assert!(kinds(&turned).contains(&FindingKind::AxisOrder));
    assert!(kinds(&turned).contains(&FindingKind::ShortSweeps));
}

/// Copies an archive with the member `name` renamed to `to`.
fn renamed(archive: &Path, name: &str, to: &str, out: &Path) {
    let mut from = ZipArchive::new(File::open(archive).unwrap()).unwrap();
    let mut copy = ZipWriter::new(File::create(out).unwrap());
    for index in 0..from.len() {
        let mut member = from.by_index(index).unwrap();
        let own = member.name().unwrap();
        let kept = if own == format!("{name}.npy") {
            format!("{to}.npy")
        } else {
            own.into_owned()
        };
        copy.start_file(kept, SimpleFileOptions::default()).unwrap();
        std::io::copy(&mut member, &mut copy).unwrap();
    }
    copy.finish().unwrap();
}

/// Returns the error of reading a file; panics without printing the data if it is read.
fn refusal(file: &Path) -> String {
    match format::read(file) {
        Ok(_) => panic!("{} is read", file.display()),
        Err(error) => error.to_string(),
    }
}

#[test]
fn arrays_under_other_names_are_errors_that_say_how_to_rename_them() {
    let dir = tempfile::tempdir().unwrap();
    let (named, misnamed) = (fixture("read/x_y_names.npz"), dir.path().join("own.npz"));
    for (name, other, remedy) in [
        (
            "sample_rate_hz",
            "sample_rate",
            "rename it to `sample_rate_hz`",
        ),
        ("sample_rate_hz", "fs", "rename it to `sample_rate_hz`"),
        ("sample_rate_hz", "Rate_Hz", "rename it to `sample_rate_hz`"),
        ("X", "data", "rename `data` to `X`"),
        ("X", "Signals", "rename `Signals` to `X`"),
        ("y", "target", "rename `target` to `y`"),
    ] {
        renamed(&named, name, other, &misnamed);
        let refused = refusal(&misnamed);
        assert!(refused.contains(remedy), "{other}: {refused}");
    }
    renamed(&named, "X", "noise_floor", &misnamed);
    let refused = refusal(&misnamed);
    assert!(
        refused.contains("`noise_floor`") && !refused.contains("rename"),
        "nothing is guessed: {refused}"
    );
}

#[test]
fn sweeps_and_labels_under_other_names_are_said_at_once_with_all_shapes() {
    let dir = tempfile::tempdir().unwrap();
    let (half, both) = (dir.path().join("half.npz"), dir.path().join("both.npz"));
    renamed(&fixture("read/x_y_names.npz"), "X", "data", &half);
    renamed(&half, "y", "target", &both);
    let refused = refusal(&both);
    assert!(
        refused.contains("rename `data` to `X` and `target` to `y`, if that is what they hold"),
        "{refused}"
    );
    assert!(
        refused.contains("`data` [12, 60, 4, 4]") && refused.contains("`target` [12, 1]"),
        "{refused}"
    );
}

/// Returns the messages about parts that are not read.
fn not_read(file: &Path) -> Vec<String> {
    let findings = check(&format::read(file).unwrap()).into_iter();
    let found = findings.filter(|finding| finding.kind == FindingKind::NotRead);
    found.map(|finding| finding.message).collect()
}

#[test]
fn arrays_that_are_ignored_are_named_and_those_that_sound_like_blocks_with_advice() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("own.npz");
    let labels: Vec<u8> = (0..12).map(|sweep| sweep / 4).collect();
    let arrays = [
        ("X", npy("|u1", "12, 60, 16", &expected_samples())),
        ("y", npy("|u1", "12", &labels)),
        ("session", npy("|u1", "12", &labels)),
        ("room", npy("|u1", "12", &labels)),
    ];
    archive(&path, &arrays);
    assert_eq!(
        not_read(&path),
        [
            "arrays that are ignored: `session`; block numbers are read from an array `blocks`",
            "arrays that are ignored: `room`"
        ]
    );
    assert!(not_read(&fixture("read/x_y_names.npz")).is_empty());
}

#[test]
fn a_sweep_without_a_name_is_said_in_the_words_of_the_array() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("own.npz");
    // Each name is a letter with a number, such as `S1`; the third has none.
    let mut y = npy("|u1", "12", b"aa\0abbbbcccc");
    let place = y.windows(3).position(|bytes| bytes == b"|u1").unwrap();
    y[place..place + 3].copy_from_slice(b"|S1");
    let flat = npy("|u1", "12, 60, 16", &expected_samples());
    archive(&path, &[("X", flat), ("y", y)]);
    let refused = refusal(&path);
    assert!(
        refused.ends_with("array `y`: expected a name for every sweep, found an empty one, `y[2]`"),
        "{refused}"
    );
}

#[test]
fn folders_without_sweeps_and_columns_that_are_missing_are_named() {
    let dir = tempfile::tempdir().unwrap();
    for (folder, file) in [("felt", "0.csv"), ("cork", "0.csv"), ("silk", "readme.txt")] {
        std::fs::create_dir(dir.path().join(folder)).unwrap();
        write(&dir.path().join(folder).join(file), "1,2\n3,4\n");
    }
    assert_eq!(
        not_read(dir.path()),
        ["folders without a .csv or .npy file: `silk`"]
    );
    assert!(format::read(dir.path()).unwrap().is_patch_assumed());

    let path = dir.path().join("own.csv");
    let taxels: String = (0..36).map(|taxel| format!(",t{taxel}")).collect();
    write(&path, &format!("label{taxels}\n"));
    let refused = refusal(&path);
    assert!(
        refused.contains("column `sweep`: expected")
            && refused.contains("found only `label` (read as `material`), `t0`, ")
            && refused.ends_with("`t6` and 29 more"),
        "{refused}"
    );
    write(&path, "trial,texture,t0\n1,felt,2\n");
    let refused = refusal(&path);
    assert!(refused.contains("rename `trial` to `sweep`"), "{refused}");
    write(&path, "sweep,material,t0\n7,felt,2\n8,,3\n");
    let refused = refusal(&path);
    assert!(
        refused.ends_with("material of sweep `8`: expected a name, found none"),
        "{refused}"
    );
}

#[test]
fn a_folder_of_arrays_without_materials_says_how_to_name_them() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("X.npy"), b"\x93NUMPY").unwrap();
    let refused = format::read(dir.path()).unwrap_err().to_string();
    assert!(refused.contains("np.savez_compressed("), "{refused}");
}

#[test]
fn arrays_to_classify_need_no_materials() {
    let dir = tempfile::tempdir().unwrap();
    let labelled = read_to_classify(&fixture("read/x_y_names.npz"), Some(20)).unwrap();
    assert!(labelled.labelled);
    assert_eq!(labelled.dataset.shape().steps, 20);
    assert_eq!(labelled.names[..3], ["0", "1", "2"]);

    // `X` is in an archive, or a single array; a single sweep has two axes.
    let whole = dir.path().join("x.npz");
    let flat = npy("|u1", "12, 60, 16", &expected_samples());
    archive(&whole, &[("X", flat)]);
    let single = dir.path().join("one.npy");
    std::fs::write(&single, npy("|u1", "60, 16", &expected_samples()[..960])).unwrap();
    let found = read_to_classify(&whole, None).unwrap();
    assert!(!found.labelled);
    assert_line(&found.dataset);
    assert_eq!(names(&found.dataset), ["unlabelled"]);
    let found = read_to_classify(&single, None).unwrap();
    assert_eq!((found.dataset.len(), found.dataset.shape().steps), (1, 60));
    assert_eq!(
        found.dataset.samples(),
        &Samples::U8(expected_samples()[..960].to_vec())
    );
    let refused = format::read(&whole).unwrap_err().to_string();
    assert!(
        refused.contains("`labels` or `y`") || refused.contains("`y`"),
        "{refused}"
    );
}

#[test]
fn five_axes_contain_materials_which_need_names() {
    let dir = tempfile::tempdir().unwrap();
    let array = std::fs::read(fixture("h5/expected_samples_u8.npy")).unwrap();
    let five = dir.path().join("five.npy");
    std::fs::write(&five, array).unwrap();
    let refused = read_to_classify(&five, None).unwrap_err().to_string();
    assert!(refused.contains("materials"), "{refused}");
}

fn write_in(dir: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = dir.path().join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, text).unwrap();
    path
}

/// A file of numbers, a folder of them, a table with and without a column of sweeps.
#[test]
fn tables_to_classify_need_no_materials() {
    let dir = tempfile::tempdir().unwrap();
    let numbers = write_in(&dir, "folder/b.csv", "1,2\n3,4\n5,6\n");
    write_in(&dir, "folder/a.csv", "7,8\n9,10\n11,12\n");
    let one = read_to_classify(&numbers, None).unwrap();
    assert_eq!(
        (one.names[0].as_str(), one.dataset.sweep(0)),
        ("b", vec![1., 2., 3., 4., 5., 6.])
    );
    let folder = read_to_classify(&dir.path().join("folder"), Some(2)).unwrap();
    assert_eq!(folder.names, ["a", "b"]);
    assert_eq!(
        (folder.dataset.name(), folder.dataset.sweep(1)),
        ("folder", vec![1., 2., 3., 4.])
    );
    let named = write_in(&dir, "named.csv", "time,p0,p1\n0,1,2\n0.01,3,4\n");
    let named = read_to_classify(&named, None).unwrap();
    assert_eq!(
        (named.dataset.sample_rate_hz(), named.names[0].as_str()),
        (100.0, "named")
    );
    let table = write_in(
        &dir,
        "table.csv",
        "sweep,p0,p1\nfirst,1,2\nfirst,3,4\nsecond,5,6\nsecond,7,8\n",
    );
    let table = read_to_classify(&table, None).unwrap();
    assert_eq!(table.names, ["first", "second"]);
    assert!(!table.labelled);
    let gap = write_in(&dir, "gap.csv", "1,2\nnan,4\n");
    let refused = read_to_classify(&gap, None).unwrap_err().to_string();
    assert!(refused.contains("finite numbers"), "{refused}");
}

#[test]
fn clocks_and_frame_counters_of_any_unit_are_no_taxels() {
    let dir = tempfile::tempdir().unwrap();
    let clocks = [
        ("frame,t_ms,p0,p1\n0,0,1,2\n1,10,3,4\n", Some(100.0)),
        (",Time [us],p0,p1\n0,0,1,2\n1,2000,3,4\n", Some(500.0)),
        (
            "index,timestamp ns,p0,p1\n0,0,1,2\n1,4000000,3,4\n",
            Some(250.0),
        ),
        ("p0,p1,step\n1,2,0\n3,4,1\n", None),
    ];
    for (text, rate) in clocks {
        let found = read_to_classify(&write_in(&dir, "clock.csv", text), None)
            .unwrap()
            .dataset;
        assert_eq!(found.sweep(0), [1., 2., 3., 4.], "{text}");
        let named = (!found.is_rate_assumed()).then(|| found.sample_rate_hz());
        assert_eq!(named, rate, "{text}");
    }
}
