//! Skin of the hand that sweeps over the ball in the other hand.

use tactnet_catching_packets::packets::HandState;
use tactnet_catching_stage::material_of_grip;
use tactnet_channel::{Bus, Priority, Start, Ticker};
use tactnet_data::{Dataset, Seed};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{Command, MAX_TAXELS, SkinFrame, SweepCommand};

use crate::skin::mirrored;
use crate::{SimulationError, play_order};

/// Plays sweeps of the held ball's material on command. Without a held ball or a command all readings are zero.
#[derive(Debug)]
pub struct HeldSkin<'a> {
    dataset: &'a Dataset,
    /// `[materials]`: indices of the sweeps, played in a loop.
    sweeps: Vec<Vec<usize>>,
    /// `[materials]`: number of sweeps played so far.
    played: Vec<usize>,
    lead: usize,
    /// `[steps][taxels]` of the last started sweep.
    sweep: Vec<f32>,
    /// Number of frames of the current motion so far; `None` between motions.
    motion: Option<usize>,
    sequence: u64,
}

impl<'a> HeldSkin<'a> {
    /// Creates a skin at rest.
    ///
    /// - `sweeps`: indices of the playable sweeps
    /// - `materials`: materials of the balls
    /// - `lead`: number of frames of a motion before and after a sweep
    ///
    /// # Errors
    /// Fails if the data set does not have a material or no sweep of it may be played.
    pub fn new(
        dataset: &'a Dataset,
        sweeps: &[usize],
        materials: &[String],
        lead: usize,
    ) -> Result<Self, SimulationError> {
        let of = |material: &String| {
            let one = std::slice::from_ref(material);
            play_order(dataset, sweeps, one, 1, Seed(1))
        };
        let sweeps: Vec<Vec<usize>> = materials.iter().map(of).collect::<Result<_, _>>()?;
        Ok(Self {
            dataset,
            played: vec![0; sweeps.len()],
            sweeps,
            sweep: vec![0.0; dataset.shape().values()],
            lead,
            motion: None,
            sequence: 0,
        })
    }

    /// Starts a sweep over a ball of the material with this index.
    pub fn begin(&mut self, material: usize) {
        let (Some(sweeps), Some(played)) =
            (self.sweeps.get(material), self.played.get_mut(material))
        else {
            return;
        };
        let next = sweeps[*played % sweeps.len()];
        self.dataset.copy_sweep(next, &mut self.sweep);
        self.motion = Some(0);
        *played += 1;
    }

    /// Ends the sweep.
    pub fn end(&mut self) {
        self.motion = None;
    }

    /// Returns the next frame.
    pub fn step(&mut self) -> SkinFrame {
        let shape = self.dataset.shape();
        let mut digits = [0.0; MAX_TAXELS];
        if let Some(at) = &mut self.motion {
            let from = mirrored(*at, self.lead, shape.steps) * shape.taxels();
            digits[..shape.taxels()].copy_from_slice(&self.sweep[from..from + shape.taxels()]);
            *at += 1;
            if *at == 2 * self.lead + shape.steps {
                self.motion = None;
            }
        }
        let frame = SkinFrame {
            sequence: self.sequence,
            sensor_time_ns: (self.sequence as f64 * 1e9 / self.dataset.sample_rate_hz()) as u64,
            taxels: shape.taxels() as u32,
            reserved: 0,
            digits,
        };
        self.sequence += 1;
        frame
    }

    /// Sends frames at the skin's rate and follows commands until `stopped` returns true.
    ///
    /// - `seed`: seed of the world, which determines the material of each grip
    ///
    /// # Errors
    /// Fails without a hub, or if channels are missing in the table.
    pub fn run(
        &mut self,
        bus: &Bus,
        seed: u64,
        ready: &dyn Fn(),
        stopped: &dyn Fn() -> bool,
    ) -> Result<(), SimulationError> {
        let config = ServeConfig::of(bus.table())?;
        let frames = bus.put_port::<SkinFrame>(config.fingers[0].as_str(), Priority::High)?;
        let commands = bus.get_port::<SweepCommand>(config.command.as_str(), Start::Now)?;
        let hands = bus.get_port::<HandState>("hand/state", Start::Now)?;
        let mut hand: Option<HandState> = None;
        let mut ticker = Ticker::new(self.dataset.sample_rate_hz());
        ready();
        while !stopped() {
            ticker.wait();
            while let Some(packet) = hands.try_get()? {
                hand = packet.first().copied().or(hand);
            }
            let held = hand.filter(|hand| hand.holds == 1);
            while let Some(packet) = commands.try_get()? {
                for command in packet.iter() {
                    match command.command() {
                        Some(Command::Start) => {
                            let of = |hand: HandState| {
                                material_of_grip(seed, hand.grip, self.sweeps.len())
                            };
                            if let Some(material) = held.and_then(of) {
                                self.begin(material);
                            }
                        }
                        Some(Command::Stop) => self.end(),
                        _ => {}
                    }
                }
            }
            if held.is_none() {
                self.end();
            }
            frames.put_copy(&[self.step()])?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use tactnet_data::twin;

    use super::*;

    #[test]
    fn it_feels_the_material_that_is_held_and_nothing_without_a_motion() {
        let twin = twin::small(3, 2, 40).unwrap();
        let names: Vec<String> = twin.labels().names().map(Into::into).collect();
        let all: Vec<usize> = (0..twin.len()).collect();
        let mut skin = HeldSkin::new(&twin, &all, &names[1..], 5).unwrap();
        assert!(skin.step().values().iter().all(|digit| *digit == 0.0));
        // The second of the two ball materials.
        skin.begin(1);
        let frames: Vec<SkinFrame> = (0..60).map(|_| skin.step()).collect();
        let sweep = skin.sweeps[1][0];
        assert_eq!(twin.records()[sweep].label, 2);
        for (step, frame) in frames[5..45].iter().enumerate() {
            assert_eq!(
                frame.values(),
                &twin.sweep(sweep)[16 * step..16 * (step + 1)]
            );
        }
        assert!(frames[50].values().iter().all(|digit| *digit == 0.0));
        // Each motion plays another sweep, and a stop command ends it.
        skin.begin(1);
        assert_ne!(skin.sweep, twin.sweep(sweep));
        skin.end();
        assert!(skin.step().values().iter().all(|digit| *digit == 0.0));
        assert!(HeldSkin::new(&twin, &all, &["fog".into()], 5).is_err());
    }
}
