//! Converts a data set (HDF5 or npz) to the format that the output file's extension names.
//!
//! `cargo run --release -p tactnet-data --example convert -- IN OUT`. Without OUT it prints only the duration of the
//! read.

use std::path::Path;
use std::time::Instant;
use tactnet_data::format::{self, Format};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let (Some(input), output) = (paths.first(), paths.get(1)) else {
        return Err("expected IN [OUT], found no file".into());
    };
    let start = Instant::now();
    let dataset = format::read(Path::new(input))?;
    let read = start.elapsed().as_secs_f64();
    println!(
        "read {read:.3} s: {} sweeps of {}",
        dataset.len(),
        dataset.shape()
    );
    if let Some(output) = output {
        let start = Instant::now();
        Format::from_extension(Path::new(output))?.write(Path::new(output), &dataset)?;
        println!("wrote {:.3} s", start.elapsed().as_secs_f64());
    }
    Ok(())
}
