//! Circle detection with one thread per camera.

use std::sync::atomic::{AtomicBool, Ordering};

use tactnet_catching::circles::Eye;
use tactnet_channel::{Bus, Start, now_ns};

use crate::channels::{CAMERA_LEFT, CAMERA_RIGHT, CIRCLES, HEAD_POSE, PREDICTION};
use crate::latest_value::{PATIENCE, drain};
use crate::role::Shell;
use crate::{PictureHead, RoleError, RoleReport, Times};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, stopped, failed) = (shell.bus, shell.stopped, AtomicBool::new(false));
    let eye = Eye::new(shell.settings.corrections()?);
    let ends = || stopped() || failed.load(Ordering::Relaxed);
    std::thread::scope(|scope| {
        let sides = [CAMERA_LEFT, CAMERA_RIGHT].map(|id| {
            let (eye, ends, failed) = (eye.clone(), &ends, &failed);
            scope.spawn(move || {
                let seen = look(bus, id, eye, ends);
                failed.fetch_or(seen.is_err(), Ordering::Relaxed);
                seen
            })
        });
        (shell.ready)();
        let [left, right] = sides.map(|side| {
            let seen = side.join();
            seen.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        Ok(left?.with(right?))
    })
}

fn look(
    bus: &Bus,
    id: &str,
    mut eye: Eye,
    ends: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let (pictures, poses) = (bus.get_port::<u8>(id, Start::Now)?, HEAD_POSE.get(bus)?);
    let (mut expected, found) = (PREDICTION.latest(bus)?, CIRCLES.put(bus)?);
    let mut times = Times::at(25);
    while !ends() {
        let got = pictures.get(PATIENCE)?;
        drain(&poses, |pose| eye.pose(pose))?;
        let picture = got.as_deref().and_then(PictureHead::split);
        let fits = |(head, _): &(PictureHead, _)| [head.width, head.height] == eye.size();
        let Some((head, pixels)) = picture.filter(fits) else {
            continue;
        };
        let begun = now_ns();
        let mut circles = head.circles();
        eye.step(pixels, expected.look()?, &mut circles);
        found.put_copy(&[circles])?;
        times.push(now_ns() - begun);
    }
    Ok(times.report(pictures.lost()))
}
