//! Writes rendered pictures of throws for other detectors: PGM files, and `pictures.json` with the true balls and the
//! detections of this project. A throw has about 50 pictures of 2 MB.
//!
//!     cargo run --release -p tactnet-catching-trials --example peer_pictures -- THROWS SEED FOLDER

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::circles::CircleConfig;
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_packets::packets::Circle;
use tactnet_catching_trials::{DetectBench, DetectReport, Taken};
use tactnet_catching_world::WorldConfig;

/// Entry of a picture in `pictures.json`.
#[derive(Serialize)]
struct PeerPicture {
    file: String,
    throw: usize,
    camera: usize,
    /// u, v and r in pixels, if the ball is completely in the picture.
    ball: Option<[f64; 3]>,
    /// u, v and r in pixels, and the response.
    circles: Vec<[f64; 4]>,
}

/// Content of `pictures.json`.
#[derive(Serialize)]
struct PeerPictures<'a> {
    schema_version: u32,
    size: [usize; 2],
    focal: f64,
    distortion: [f64; 2],
    pictures: Vec<PeerPicture>,
    report: &'a DetectReport,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut argument = || arguments.next().ok_or("expected THROWS SEED FOLDER");
    let bench = DetectBench {
        throws: argument()?.parse()?,
        seed: argument()?.parse()?,
        world: WorldConfig::default(),
        config: CircleConfig::default(),
    };
    let robot = Robot::new(RobotDescription::nominal());
    write_pictures(&robot, &bench, Path::new(&argument()?))
}

/// Runs a benchmark and writes its pictures to a new folder.
fn write_pictures(robot: &Robot, bench: &DetectBench, folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir(folder)?;
    let cameras = robot.description().cameras;
    let size = [cameras.width as usize, cameras.height as usize];
    let mut written: Vec<std::io::Result<PeerPicture>> = Vec::new();
    let keep = |taken: Taken| written.push(write_picture(folder, written.len(), size, &taken));
    let report = bench.run(robot, |_| (), keep)?;
    let document = PeerPictures {
        schema_version: 1,
        size,
        focal: cameras.focal,
        distortion: cameras.distortion,
        pictures: written.into_iter().collect::<Result<_, _>>()?,
        report: &report,
    };
    std::fs::write(folder.join("pictures.json"), serde_json::to_vec(&document)?)?;
    Ok(())
}

/// Writes a picture as a portable grey map.
fn write_picture(
    folder: &Path,
    number: usize,
    [width, height]: [usize; 2],
    taken: &Taken,
) -> std::io::Result<PeerPicture> {
    let file = format!("{number:06}.pgm");
    let mut out = BufWriter::new(File::create(folder.join(&file))?);
    write!(out, "P5\n{width} {height}\n255\n")?;
    out.write_all(&taken.pixels)?;
    out.flush()?;
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn every_picture_is_written_once_and_listed() {
        let folder = std::env::temp_dir().join(format!("peer-pictures-{}", std::process::id()));
        let mut description = RobotDescription::nominal();
        let cameras = &mut description.cameras;
        (cameras.width, cameras.height) = (cameras.width / 4, cameras.height / 4);
        cameras.focal /= 4.0;
        let (width, height) = (cameras.width, cameras.height);
        let bench = DetectBench {
            throws: 1,
            seed: 1,
            world: WorldConfig::default(),
            config: CircleConfig::default(),
        };
        let robot = Robot::new(description);
        write_pictures(&robot, &bench, &folder).unwrap();
        let text = std::fs::read_to_string(folder.join("pictures.json")).unwrap();
        let document: serde_json::Value = serde_json::from_str(&text).unwrap();
        let pictures = document["pictures"].as_array().unwrap();
        assert_eq!(pictures.len() as u64, document["report"]["pictures"]);
        let first = std::fs::read(folder.join("000000.pgm")).unwrap();
        let head = format!("P5\n{width} {height}\n255\n");
        assert!(first.starts_with(head.as_bytes()));
        assert_eq!(first.len(), head.len() + (width * height) as usize);
        assert!(write_pictures(&robot, &bench, &folder).is_err());
        std::fs::remove_dir_all(folder).unwrap();
    }
}
