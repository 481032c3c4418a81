//! `tactnet bench catch-detect`: the detector alone.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use serde::Serialize;
use tactnet_catching::circles::CircleConfig;
use tactnet_catching_packets::packets::Circle;
use tactnet_catching_trials::{DetectBench, DetectFigures, DetectReport, Taken};

use crate::commands::catch;
use crate::commands::progress_line::about;
use crate::output;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet bench catch-detect --throws 50 --seed 1 --json\n  \
    tactnet bench catch-detect --throws 2 --peer-pictures pictures     for other detectors, and to look at\n\n\
    A folder of pictures takes 2 MB for each, about 50 a throw.")]
pub struct DetectBenchArgs {
    /// Throws of one ball each, seen by a head that looks about
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    throws: u32,
    /// Of throws, rooms, people and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// The robot [default: the one that simulations use]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Settings of the world, JSON [default: the ones built in]
    #[arg(long, value_name = "FILE")]
    world: Option<PathBuf>,
    /// Write every picture (.pgm) and pictures.json, which says where balls are and what was found, into this new folder
    #[arg(long, value_name = "DIR")]
    peer_pictures: Option<PathBuf>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// What `pictures.json` says of a picture.
#[derive(Serialize)]
struct PeerPicture {
    file: String,
    throw: usize,
    camera: usize,
    ball: Option<[f64; 3]>,
    circles: Vec<[f64; 4]>,
}

/// The content of `pictures.json`.
#[derive(Serialize)]
struct PeerPictures<'a> {
    schema_version: u32,
    size: [usize; 2],
    focal: f64,
    distortion: [f64; 2],
    pictures: Vec<PeerPicture>,
    report: &'a DetectReport,
}

/// Runs the command.
pub fn run(arguments: &DetectBenchArgs) -> anyhow::Result<ExitCode> {
    let robot = catch::robot(arguments.robot.as_ref())?;
    let bench = DetectBench {
        throws: arguments.throws as usize,
        seed: arguments.seed,
        world: catch::world(arguments.world.as_deref())?,
        config: CircleConfig::default(),
    };
    if let Some(folder) = &arguments.peer_pictures {
        std::fs::create_dir(folder).with_context(|| folder.display().to_string())?;
    }
    let (begun, mut said) = (Instant::now(), Instant::now());
    let progress = |done: usize| {
        if said.elapsed().as_secs_f64() > 2.0 {
            said = Instant::now();
            let left = (bench.throws - done) as f64 / done as f64;
            say!(
                "{done} of {} throws, {} to go",
                bench.throws,
                about(begun.elapsed().mul_f64(left))
            );
        }
    };
    let cameras = robot.description().cameras;
    let size = [cameras.width as usize, cameras.height as usize];
    let (mut peers, mut failed) = (Vec::new(), None);
    let keep = |taken: Taken| {
        if let Some(folder) = &arguments.peer_pictures
            && failed.is_none()
        {
            match write_picture(folder, peers.len(), size, &taken) {
                Ok(peer) => peers.push(peer),
                Err(error) => failed = Some(error),
            }
        }
    };
    let report = bench.run(&robot, progress, keep)?;
    if let Some(error) = failed {
        return Err(error);
    }
    if let Some(folder) = &arguments.peer_pictures {
        let path = folder.join("pictures.json");
        let document = PeerPictures {
            schema_version: 1,
            size,
            focal: cameras.focal,
            distortion: cameras.distortion,
            pictures: peers,
            report: &report,
        };
        std::fs::write(&path, serde_json::to_vec(&document)?)
            .with_context(|| path.display().to_string())?;
    }
    if arguments.json {
        output::print_json(&report)?;
    } else {
        print(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes a picture as a portable grey map.
fn write_picture(
    folder: &Path,
    number: usize,
    [width, height]: [usize; 2],
    taken: &Taken,
) -> anyhow::Result<PeerPicture> {
    let file = format!("{number:06}.pgm");
    let path = folder.join(&file);
    let write = || -> std::io::Result<()> {
        let mut out = BufWriter::new(File::create(&path)?);
        write!(out, "P5\n{width} {height}\n255\n")?;
        out.write_all(&taken.pixels)?;
        out.flush()
    };
    write().with_context(|| path.display().to_string())?;
    let place = |circle: &Circle| [circle.u, circle.v, circle.r];
    Ok(PeerPicture {
        file,
        throw: taken.throw,
        camera: taken.camera,
        ball: taken.ball.as_ref().map(place),
        circles: taken
            .circles
            .iter()
            .map(|circle| [circle.u, circle.v, circle.r, circle.response])
            .collect(),
    })
}

fn print(report: &DetectReport) -> anyhow::Result<()> {
    let [width, height] = report.size;
    output::print(format_args!(
        "{} throws, {} pictures of {width}x{height}",
        report.throws, report.pictures
    ))?;
    print_figures("each picture on its own", &report.search)?;
    print_figures(
        "with gates where the tracker expects the ball",
        &report.gated,
    )
}

fn print_figures(name: &str, figures: &DetectFigures) -> anyhow::Result<()> {
    output::print(format_args!(
        "{name}: {:.1} % of {} balls found, {:.1} circles a picture that are no balls",
        100.0 * figures.recall,
        figures.balls,
        figures.false_alarms
    ))?;
    for class in &figures.by_radius {
        if let (Some(recall), Some(error)) = (class.recall, class.centre_px_rms) {
            output::print(format_args!(
                "  radius from {:>2} px: {:.1} % of {}, centre to {error:.2} px (root mean square, each way)",
                class.least,
                100.0 * recall,
                class.balls
            ))?;
        }
    }
    if let Some(times) = figures.picture_ms {
        output::print(format_args!(
            "  a picture: median {:.1} ms, 99 % {:.1} ms, longest {:.1} ms",
            times.p50, times.p99, times.max
        ))?;
    }
    Ok(())
}
