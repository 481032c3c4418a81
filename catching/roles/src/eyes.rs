//! Circle detection with one thread per camera.

use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::Zeroable;
use tactnet_catching::calibrate::Corrections;
use tactnet_catching::circles::{CircleConfig, CircleDetector, Gate, gates};
use tactnet_catching::pose::{POSES, PoseRing};
use tactnet_catching_packets::packets::{Circles, MAX_BALLS};
use tactnet_channel::{Bus, Start, now_ns};

use crate::channels::{CAMERA_LEFT, CAMERA_RIGHT, CIRCLES, HEAD_POSE, PREDICTION};
use crate::latest_value::{PATIENCE, drain};
use crate::role::Shell;
use crate::times::Times;
use crate::{PictureHead, RoleError, RoleReport};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings, stopped) = (shell.bus, &shell.settings, shell.stopped);
    let corrections = settings.corrections()?;
    let failed = AtomicBool::new(false);
    let ends = || stopped() || failed.load(Ordering::Relaxed);
    std::thread::scope(|scope| {
        let sides = [CAMERA_LEFT, CAMERA_RIGHT].map(|id| {
            let (corrections, ends, failed) = (&corrections, &ends, &failed);
            scope.spawn(move || {
                let seen = look(bus, id, corrections, ends);
                failed.fetch_or(seen.is_err(), Ordering::Relaxed);
                seen
            })
        });
        (shell.ready)();
        let mut whole = RoleReport::default();
        for side in sides {
            let seen = side
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            // Both cameras do the same work, so the report holds the slower one.
            whole = RoleReport {
                count: whole.count + seen.count,
                lost: whole.lost + seen.lost,
                ..if seen.p99_us > whole.p99_us {
                    seen
                } else {
                    whole
                }
            };
        }
        Ok(whole)
    })
}

fn look(
    bus: &Bus,
    id: &str,
    corrections: &Corrections,
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let cameras = &corrections.robot().description().cameras;
    let pictures = bus.get_port::<u8>(id, Start::Now)?;
    let mut expected = PREDICTION.latest(bus)?;
    let (poses, found) = (HEAD_POSE.get(bus)?, CIRCLES.put(bus)?);
    let mut heads = PoseRing::new(POSES);
    let mut detector = CircleDetector::new(cameras, CircleConfig::default());
    let mut times = Times::at(25);
    let mut expectations = Vec::with_capacity(MAX_BALLS);
    while !stopped() {
        let got = pictures.get(PATIENCE)?;
        drain(&poses, |pose| heads.put(*pose))?;
        let Some(packet) = got else {
            continue;
        };
        let Some((head, pixels)) = PictureHead::split(&packet) else {
            continue;
        };
        if (head.width, head.height) != (cameras.width, cameras.height) {
            continue;
        }
        let begun = now_ns();
        expectations.clear();
        let exposure_ns = corrections.exposure(head.exposure_ns);
        let pose = heads.at(exposure_ns).ok().or(heads.last().copied());
        if let (Some(balls), Some(pose)) = (expected.look()?, pose) {
            let near = balls.exposure_ns.abs_diff(exposure_ns) < 500_000_000;
            let gates = gates(cameras, head.camera as usize, balls, &pose);
            let all: Vec<Gate> = gates.take(MAX_BALLS).collect();
            expectations.extend(all.into_iter().filter(|_| near));
        }
        let mut circles = Circles {
            frame: head.frame,
            exposure_ns: head.exposure_ns,
            camera: head.camera,
            ..Circles::zeroed()
        };
        detector.find(pixels, &expectations, &mut circles);
        found.put_copy(&[circles])?;
        times.push(now_ns() - begun);
    }
    Ok(times.report(pictures.lost()))
}
