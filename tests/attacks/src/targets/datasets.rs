//! Data sets in all supported formats.

use std::io::{Cursor, Read, Write};
use std::path::{Path, PathBuf};

use tactnet_data::format::{self, FileLayout, Format, ReadOptions, Span, Windows};
use tactnet_data::twin;
use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use super::Target;

/// A file in memory that every call rewrites.
struct Place {
    path: PathBuf,
    _folder: TempDir,
}

impl Place {
    fn new(name: &str) -> anyhow::Result<Self> {
        let folder = tempfile::tempdir_in("/dev/shm")?;
        Ok(Self {
            path: folder.path().join(name),
            _folder: folder,
        })
    }

    fn reads(&self, content: &[u8]) -> bool {
        std::fs::write(&self.path, content).is_ok() && format::read(&self.path).is_ok()
    }
}

fn twin() -> anyhow::Result<tactnet_data::Dataset> {
    Ok(twin::small(2, 3, 12)?)
}

/// Returns small valid files of other writers.
fn fixtures(extension: &str) -> anyhow::Result<Vec<Vec<u8>>> {
    let mut found = Vec::new();
    for folder in ["h5", "read", "foreign"] {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures/").to_owned() + folder;
        let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)?
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<Result<_, _>>()?;
        paths.sort();
        for path in paths {
            if path.extension().is_none_or(|found| found != extension) {
                continue;
            }
            let content = std::fs::read(&path)?;
            if content.len() < 100_000 && format::read(&path).is_ok() {
                found.push(content);
            }
        }
    }
    Ok(found)
}

/// Target: a file with this extension, byte by byte.
pub(super) fn whole(extension: &'static str) -> anyhow::Result<Target> {
    let place = Place::new(&format!("data.{extension}"))?;
    let format = if extension == "npz" {
        Format::Npz
    } else {
        Format::TactMat
    };
    format.write(&place.path, &twin()?)?;
    let mut seeds = vec![std::fs::read(&place.path)?];
    seeds.extend(fixtures(extension)?);
    Ok(Target::new(seeds, move |input| place.reads(input)))
}

/// Returns named contents as one input: `NAME LENGTH\n` and that many bytes, for each.
fn joined(members: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut input = Vec::new();
    for (name, content) in members {
        input.extend(format!("{name} {}\n", content.len()).bytes());
        input.extend(content);
    }
    input
}

/// Splits an input of [`joined`]; lengths that do not fit are cut.
fn members(input: &[u8]) -> Vec<(String, &[u8])> {
    let (mut members, mut rest) = (Vec::new(), input);
    while let Some(line) = rest.iter().position(|byte| *byte == b'\n') {
        let head = String::from_utf8_lossy(&rest[..line]).into_owned();
        rest = &rest[line + 1..];
        let (name, length) = head.rsplit_once(' ').unwrap_or((&head, "0"));
        let length = length.parse().unwrap_or(usize::MAX).min(rest.len());
        members.push((name.to_owned(), &rest[..length]));
        rest = &rest[length..];
    }
    members
}

/// Target: the members of an archive, inside an undamaged archive.
pub(super) fn npz_members() -> anyhow::Result<Target> {
    let place = Place::new("data.npz")?;
    Format::Npz.write(&place.path, &twin()?)?;
    let mut archive = ZipArchive::new(Cursor::new(std::fs::read(&place.path)?))?;
    let mut seed = Vec::new();
    for index in 0..archive.len() {
        let mut member = archive.by_index(index)?;
        let mut content = Vec::new();
        member.read_to_end(&mut content)?;
        let name = String::from_utf8_lossy(member.name_raw()).into_owned();
        seed.push((name, content));
    }
    Ok(Target::new(vec![joined(&seed)], move |input| {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        let stored =
            SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        for (name, content) in members(input) {
            if archive.start_file(name, stored).is_err() || archive.write_all(content).is_err() {
                return false;
            }
        }
        archive
            .finish()
            .is_ok_and(|archive| place.reads(archive.get_ref()))
    }))
}

/// Names and contents of files.
type Files = Vec<(String, Vec<u8>)>;

/// Returns the files of LeRobot data sets, version 2 and 3, with names relative to the data set.
fn lerobot_folders() -> anyhow::Result<Vec<Files>> {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/read");
    let folders: [(&str, &[&str]); 2] = [
        (
            "lerobot_v2",
            &[
                "meta/info.json",
                "meta/tasks.jsonl",
                "data/chunk-000/episode_000000.parquet",
                "data/chunk-000/episode_000001.parquet",
            ],
        ),
        (
            "lerobot_v3",
            &[
                "meta/info.json",
                "meta/tasks.parquet",
                "data/chunk-000/file-000.parquet",
            ],
        ),
    ];
    let mut found = Vec::new();
    for (folder, names) in folders {
        let mut files = Vec::new();
        for name in names {
            let content = std::fs::read(fixtures.join(folder).join(name))?;
            files.push((name.to_string(), content));
        }
        found.push(files);
    }
    Ok(found)
}

/// Writes the members of an input below a folder, except those with names that lead out of it or are long.
fn write_members(folder: &Path, input: &[u8]) {
    for (name, content) in members(input) {
        let is_plain = |part: &str| !part.is_empty() && !part.starts_with('.');
        let is_short = name.len() < 100 && name.split('/').count() < 6;
        if !is_short || !name.split('/').all(is_plain) || name.contains('\0') {
            continue;
        }
        let file = folder.join(name);
        let made = file.parent().map(std::fs::create_dir_all);
        if made.is_none_or(|made| made.is_err()) || std::fs::write(&file, content).is_err() {
            continue;
        }
    }
}

/// Target: a folder of files, with the options of other people's folders. Names outside the folder are left out.
pub(super) fn folders() -> anyhow::Result<Target> {
    // The episodes of LeRobot are Parquet.
    let mut seeds = match format::READS_PARQUET {
        true => lerobot_folders()?,
        false => Vec::new(),
    };
    let text = |sweep: usize| -> String {
        let line = |step: usize| format!("{step} {} {}\n", sweep * step % 7, (sweep + step) % 5);
        (0..12).map(line).collect()
    };
    let of = |name: &str, sweep: usize| (name.to_owned(), text(sweep).into_bytes());
    seeds.push(vec![
        of("train/a_1.txt", 1),
        of("train/b_2.txt", 2),
        of("test/a_3.txt", 3),
    ]);
    seeds.push(vec![
        of("felt/1.csv", 1),
        of("felt/2.csv", 2),
        of("cork/1.csv", 4),
    ]);
    let folder = tempfile::tempdir_in("/dev/shm")?;
    let options = ReadOptions {
        layout: FileLayout {
            names: Some("{split}/{material}_{sweep}.txt".parse()?),
            lines_per_frame: Some(2),
            stretch: Some(9),
            ..FileLayout::default()
        },
        ..ReadOptions::default()
    };
    Ok(Target::new(
        seeds.iter().map(|seed| joined(seed)).collect(),
        move |input| {
            let path = folder.path().join("data");
            let _ = std::fs::remove_dir_all(&path);
            write_members(&path, input);
            let as_it_is = format::read(&path).is_ok();
            as_it_is | format::read_with(&path, &options).is_ok()
        },
    ))
}

/// Target: a table of sweeps.
pub(super) fn csv() -> anyhow::Result<Target> {
    let place = Place::new("data.csv")?;
    let mut text = String::from("sweep,material,t0,t1\n");
    for (sweep, material) in ["felt", "cork", "felt", "cork"].iter().enumerate() {
        for step in 0..4 {
            text.push_str(&format!("{sweep},{material},{}.5,{step}\n", sweep * step));
        }
    }
    Ok(Target::new(vec![text.into_bytes()], move |input| {
        place.reads(input)
    }))
}

/// Target: a continuous recording as text, cut into windows: dialects, dates, units, labels.
pub(super) fn recordings() -> anyhow::Result<Target> {
    let place = Place::new("data.csv")?;
    let rows = |head: &str, row: &dyn Fn(usize) -> String| -> Vec<u8> {
        let rows: Vec<String> = (0..40).map(row).collect();
        format!("{head}{}", rows.join("")).into_bytes()
    };
    let label = |step: usize| if step < 20 { "felt" } else { "cork" };
    let seeds = vec![
        rows("time,label,t0,t1\n", &|step| {
            format!(
                "{}.{:02},{},{},{step}\n",
                step / 100,
                step % 100,
                label(step),
                step % 7
            )
        }),
        rows("# a sensor\nsep=;\nZeit [ms];class;p [kPa];q\n", &|step| {
            format!(
                "{};{};{},5;{}\r\n",
                step * 10,
                label(step),
                step % 9,
                step * step % 11
            )
        }),
        rows("sec\tnanosec\tmaterial\ta\n", &|step| {
            format!(
                "1700000000\t{}\t{}\t\"{}\"\n",
                step * 10_000_000,
                label(step),
                step % 5
            )
        }),
        rows("timestamp,label,a,b\n", &|step| {
            format!(
                "2024-03-31T01:59:59.{:03}+01:00,{},{step},{}\n",
                step * 10,
                label(step),
                step % 3
            )
        }),
    ];
    let options = ReadOptions {
        resample_hz: Some(70.0),
        windows: Some(Windows::of(Span::Seconds(0.05))),
        ..ReadOptions::default()
    };
    Ok(Target::new(seeds, move |input| {
        place.reads(input) | format::read_with(&place.path, &options).is_ok()
    }))
}

/// Target: a file of another program with this extension, byte by byte: a Parquet table, or a MATLAB file of version 5 or 7.3.
pub(super) fn others(extension: &str) -> anyhow::Result<Target> {
    let place = Place::new(&format!("data.{extension}"))?;
    let seeds = fixtures(extension)?;
    anyhow::ensure!(
        !seeds.is_empty(),
        "no valid {extension} file among the fixtures"
    );
    Ok(Target::new(seeds, move |input| place.reads(input)))
}
