//! Tests that no format narrows a signal on a large offset in silence.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use hdf5_writer::{DatasetBuilder, Hdf5Builder, WriteOptions};
use tactnet_data::{DataError, Dataset, Remedy, Samples, format};

use crate::hostile::{archive, npy};
use crate::tables::write;

/// Number of sweeps, the first half of cork and the others of wood; steps; taxels.
const SWEEPS: usize = 12;
const STEPS: usize = 150;
const TAXELS: usize = 3;

/// Returns `[sweeps][steps][taxels]`, digits with a fraction, with an offset in the last taxel.
fn values(offset: f64, fraction: f64) -> Vec<f64> {
    let value = |place: usize| {
        let digit = (place * place % 211) as f64 + fraction * ((place * 31 % 10) as f64);
        match place % TAXELS {
            2 => offset + digit,
            _ => digit,
        }
    };
    (0..SWEEPS * STEPS * TAXELS).map(value).collect()
}

fn bytes(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn material(sweep: usize) -> &'static str {
    if 2 * sweep < SWEEPS { "cork" } else { "wood" }
}

fn write_hdf5(path: &Path, values: &[f64], chunk: Option<[u64; 5]>) -> PathBuf {
    let extents = [2, SWEEPS as u64 / 2, STEPS as u64, 1, TAXELS as u64];
    let samples = DatasetBuilder::typed_data("samples", extents, values).unwrap();
    let samples = match chunk {
        Some(chunk) => samples.chunked(chunk),
        None => samples,
    };
    let names = DatasetBuilder::fixed_string_data("materials", [2], &["cork", "wood"]).unwrap();
    let plan = Hdf5Builder::new()
        .dataset(samples)
        .dataset(names)
        .into_plan()
        .unwrap();
    std::fs::write(path, plan.encode(WriteOptions::default()).unwrap()).unwrap();
    path.to_path_buf()
}

/// Writes the values in all formats, and returns the paths.
fn files(dir: &Path, values: &[f64]) -> Vec<PathBuf> {
    let npz = dir.join("own.npz");
    let labels: Vec<u8> = (0..SWEEPS)
        .map(|sweep| (2 * sweep / SWEEPS) as u8)
        .collect();
    let shape = format!("{SWEEPS}, {STEPS}, {TAXELS}");
    let members = [
        ("X", npy("<f8", &shape, &bytes(values))),
        ("y", npy("|u1", &SWEEPS.to_string(), &labels)),
    ];
    archive(&npz, &members);

    let [folder, arrays, table] = ["tables", "arrays", "own.csv"].map(|name| dir.join(name));
    let mut frames = String::from("sweep,material,t0,t1,t2\n");
    for (sweep, of_sweep) in values.chunks_exact(STEPS * TAXELS).enumerate() {
        let mut text = String::new();
        for frame in of_sweep.chunks_exact(TAXELS) {
            let cells: Vec<String> = frame.iter().map(f64::to_string).collect();
            writeln!(text, "{}", cells.join(",")).unwrap();
            writeln!(frames, "{sweep},{},{}", material(sweep), cells.join(",")).unwrap();
        }
        write(
            &folder.join(format!("{}/{sweep:02}.csv", material(sweep))),
            &text,
        );
        let array = arrays.join(format!("{}/{sweep:02}.npy", material(sweep)));
        std::fs::create_dir_all(array.parent().unwrap()).unwrap();
        std::fs::write(
            array,
            npy("<f8", &format!("{STEPS}, {TAXELS}"), &bytes(of_sweep)),
        )
        .unwrap();
    }
    write(&table, &frames);

    let whole = write_hdf5(&dir.join("whole.h5"), values, None);
    let chunked = write_hdf5(&dir.join("chunked.h5"), values, Some([1, 2, 70, 1, 2]));
    vec![npz, folder, arrays, table, whole, chunked]
}

fn read(values: &[f64]) -> Vec<Result<Dataset, DataError>> {
    let dir = tempfile::tempdir().unwrap();
    let files = files(dir.path(), values);
    files.iter().map(|path| format::read(path)).collect()
}

#[test]
fn a_signal_on_a_large_offset_is_refused_with_the_taxel_in_every_format() {
    for (offset, fraction, reason) in [
        (
            1.6e9,
            0.0,
            "lies near 1.6e9 and moves by 1; a 32-bit float keeps steps of 128 there",
        ),
        (5e7, 0.01, "a 32-bit float keeps steps of 4 there"),
    ] {
        for read in read(&values(offset, fraction)) {
            let error = read.unwrap_err();
            assert_eq!(error.remedy(), Some(Remedy::SubtractOffset), "{error}");
            let findings = error.findings();
            assert_eq!(findings.len(), 1, "{error}");
            assert_eq!(findings[0].at.taxel, Some(2));
            let message = &findings[0].message;
            assert!(
                message.starts_with("taxel (0, 2) ") && message.ends_with(reason),
                "{message}"
            );
        }
    }
}

#[test]
fn digits_with_a_fraction_are_rounded_to_32_bits_in_every_format() {
    let values = values(1000.0, 0.01);
    let expected = Samples::F32(values.iter().map(|value| *value as f32).collect());
    for read in read(&values) {
        assert!(read.unwrap().samples() == &expected);
    }
}
