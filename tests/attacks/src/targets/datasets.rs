//! Data sets in all supported formats.

use std::io::{Cursor, Read, Write};
use std::path::PathBuf;

use tactnet_data::format::{self, Format};
use tactnet_data::twin::{TwinConfig, generate};
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
    Ok(generate(&TwinConfig {
        materials: 2,
        sweeps: 3,
        steps: 12,
        ..TwinConfig::default()
    })?)
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
            let content = std::fs::read(&path)?;
            let right = path.extension().is_some_and(|found| found == extension);
            if right && content.len() < 100_000 && format::read(&path).is_ok() {
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

/// Target: the members of an archive, inside an undamaged archive. Input: `NAME LENGTH\n` and that many bytes, for each member.
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
        writeln!(seed, "{name} {}", content.len())?;
        seed.extend(content);
    }
    Ok(Target::new(vec![seed], move |input| {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        let mut rest = input;
        while let Some(line) = rest.iter().position(|byte| *byte == b'\n') {
            let head = String::from_utf8_lossy(&rest[..line]).into_owned();
            rest = &rest[line + 1..];
            let (name, length) = head.rsplit_once(' ').unwrap_or((&head, "0"));
            let length = length.parse().unwrap_or(usize::MAX).min(rest.len());
            let stored =
                SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
            if archive.start_file(name, stored).is_err()
                || archive.write_all(&rest[..length]).is_err()
            {
                return false;
            }
            rest = &rest[length..];
        }
        archive
            .finish()
            .is_ok_and(|archive| place.reads(archive.get_ref()))
    }))
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
