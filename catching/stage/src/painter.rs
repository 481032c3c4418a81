//! Painter: renders camera pictures, and publishes them with the delay of a camera.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use bytemuck::Zeroable;
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_roles::{PICTURE_HEAD, PictureHead};
use tactnet_catching_world::{Pictures, Truth, WorldConfig};
use tactnet_channel::{Bus, Priority, now_ns};
use tactnet_process::run_in_background;

use crate::StageError;

/// State of the world at an exposure.
pub(crate) struct Exposure {
    pub truth: Truth,
    pub frame: u64,
    /// Middle of the exposure, in ns of the host's clock.
    pub exposure_ns: u64,
    pub due_ns: u64,
}

/// Renders pictures until the sender is dropped. Returns the number of late pictures.
pub(crate) fn paint(
    bus: &Bus,
    robot: &RobotDescription,
    config: &WorldConfig,
    seed: u64,
    exposures: &Receiver<Exposure>,
) -> Result<u64, StageError> {
    // Real cameras take no time of the robot's processors.
    run_in_background();
    let ports = [
        bus.put_port::<u8>("camera/left", Priority::Bulk)?,
        bus.put_port::<u8>("camera/right", Priority::Bulk)?,
    ];
    let mut left = Pictures::new(robot, config, seed)?;
    let mut right = left.clone();
    let [width, height] = left.size();
    let mut late = 0;
    loop {
        let exposure = match exposures.recv_timeout(Duration::from_millis(100)) {
            Ok(exposure) => exposure,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => return Ok(late),
        };
        let mut loans = Vec::with_capacity(ports.len());
        for port in &ports {
            loans.push(port.loan(PICTURE_HEAD + width * height)?);
        }
        std::thread::scope(|scope| {
            let both = loans.iter_mut().zip([&mut left, &mut right]).enumerate();
            for (camera, (loan, pictures)) in both {
                let head = PictureHead {
                    frame: exposure.frame,
                    exposure_ns: exposure.exposure_ns,
                    camera: camera as u32,
                    width: width as u32,
                    height: height as u32,
                    ..PictureHead::zeroed()
                };
                let (before, pixels) = loan.split_at_mut(PICTURE_HEAD);
                before.copy_from_slice(bytemuck::bytes_of(&head));
                let truth = &exposure.truth;
                // The thread inherits the low priority.
                scope.spawn(move || pictures.draw(truth, head.frame, camera, pixels));
            }
        });
        let wait = exposure.due_ns.saturating_sub(now_ns());
        late += u64::from(wait == 0);
        std::thread::sleep(Duration::from_nanos(wait));
        for (port, loan) in ports.iter().zip(loans) {
            port.put(loan)?;
        }
    }
}
