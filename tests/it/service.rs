//! The online classifier in this process, step by step: the effect of frames and commands does not depend on when the
//! service reads them.

use std::time::Duration;

use tactnet_channel::{Bus, Domain, GetPort, Packet, Priority, PutPort, Start};
use tactnet_data::Dataset;
use tactnet_serving::{ModelSource, Service};
use tactnet_simulation::SkinSimulator;
use tactnet_skin::packets::{
    Command, Event, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus,
};
use tactnet_skin::{SegmenterConfig, ServeConfig};

use crate::robot::{Robot, STEPS, offline};

const SKIP: usize = 20;

/// A service for two fingers with all of its channels.
struct ServiceUnderTest {
    service: Service,
    fingers: [PutPort<SkinFrame>; 2],
    commands: PutPort<SweepCommand>,
    beliefs: GetPort<TactileBelief>,
    status: GetPort<TactileStatus>,
    dataset: Dataset,
}

impl ServiceUnderTest {
    fn new(robot: &Robot) -> Self {
        let config = ServeConfig {
            fingers: vec!["skin/left".into(), "skin/right".into()],
            anytime_ms: 0.0,
            mc_samples: 0,
            segmenter: SegmenterConfig {
                skip: SKIP.into(),
                ..SegmenterConfig::default()
            },
            ..ServeConfig::default()
        };
        let bus = Bus::open(Domain::Process, &config.table("tested")).unwrap();
        let source = ModelSource::Run(robot.lab.path("models/1"));
        let finger = |id| bus.put_port::<SkinFrame>(id, Priority::High).unwrap();
        Self {
            service: Service::start(&bus, config, source, "test").unwrap(),
            fingers: [finger("skin/left"), finger("skin/right")],
            commands: bus.put_port("sweep/command", Priority::High).unwrap(),
            beliefs: bus.get_port("tactile/belief", Start::Now).unwrap(),
            status: bus.get_port("tactile/status", Start::Now).unwrap(),
            dataset: tactnet_data::format::read(&robot.lab.path("data.h5")).unwrap(),
        }
    }

    fn command(&self, kind: Command, finger: u32, motion: u64) {
        let command = SweepCommand {
            kind: kind as u32,
            finger,
            motion,
            sweeps: 0,
            reserved: 0,
            material: tactnet_skin::packets::Text::default(),
        };
        self.commands.put_copy(&[command]).unwrap();
    }

    /// Returns the frames of a motion over a sweep, from its first frame on.
    fn frames(&self, sweep: usize, first_sequence: u64) -> Vec<SkinFrame> {
        let mut skin = SkinSimulator::new(&self.dataset, vec![sweep], SKIP, 1);
        skin.step();
        let mut frames: Vec<SkinFrame> = (0..SKIP + STEPS).map(|_| skin.step().frame).collect();
        for (at, frame) in frames.iter_mut().enumerate() {
            frame.sequence = first_sequence + at as u64;
            frame.sensor_time_ns =
                (frame.sequence as f64 * 1e9 / self.dataset.sample_rate_hz()) as u64;
        }
        frames
    }

    /// Lets the service process everything that is waiting.
    fn settle(&mut self) {
        // Each call processes one channel that has packets.
        for _ in 0..4 {
            self.service.step(Duration::from_millis(1)).unwrap();
        }
    }
}

fn all<T: Packet>(port: &GetPort<T>) -> Vec<T> {
    std::iter::from_fn(|| port.try_get().unwrap().map(|packet| packet[0])).collect()
}

fn assert_alike(belief: &TactileBelief, offline: &[f64]) {
    assert_eq!(belief.stage, Stage::Plain as u32);
    assert_eq!(belief.frames as usize, STEPS);
    for (live, offline) in belief.posterior.iter().zip(offline) {
        assert!(
            (f64::from(*live) - offline).abs() < 1e-4,
            "{live} {offline}"
        );
    }
}

#[test]
fn two_fingers_sweep_at_once_and_each_gets_its_own_belief() {
    let robot = Robot::new("two");
    let mut tested = ServiceUnderTest::new(&robot);
    let sweeps = [3, 130];
    let frames = sweeps.map(|sweep| tested.frames(sweep, 0));
    tested.command(Command::Start, 0, 70);
    for at in 0..SKIP + STEPS {
        // The second finger starts later, between the other's frames.
        if at == 7 {
            tested.command(Command::Start, 1, 71);
        }
        tested.fingers[0].put_copy(&[frames[0][at]]).unwrap();
        if at >= 7 {
            tested.fingers[1].put_copy(&[frames[1][at - 7]]).unwrap();
        }
        tested.settle();
    }
    for frame in &frames[1][SKIP + STEPS - 7..] {
        tested.fingers[1].put_copy(&[*frame]).unwrap();
    }
    tested.settle();
    let beliefs = all(&tested.beliefs);
    assert_eq!(beliefs.len(), 2);
    for (belief, (finger, sweep)) in beliefs.iter().zip(sweeps.into_iter().enumerate()) {
        assert_eq!(
            (belief.finger as usize, belief.motion),
            (finger, 70 + finger as u64)
        );
        assert_alike(belief, &offline(&robot, "models/1", sweep));
    }
    assert_ne!(beliefs[0].sweep, beliefs[1].sweep);
    // The fused sweeps of one finger do not affect the other.
    assert!(beliefs.iter().all(|belief| belief.fused_sweeps <= 1));
}

#[test]
fn commands_divide_the_frames_at_their_own_time_however_late_both_are_seen() {
    let robot = Robot::new("late");
    let mut tested = ServiceUnderTest::new(&robot);
    let (first, second) = (tested.frames(3, 0), tested.frames(130, 60));
    tested.command(Command::Start, 0, 1);
    for frame in &first[..60] {
        tested.fingers[0].put_copy(&[*frame]).unwrap();
    }
    // A second start without a stop.
    tested.command(Command::Start, 0, 2);
    for frame in &second {
        tested.fingers[0].put_copy(&[*frame]).unwrap();
    }
    tested.command(Command::Stop, 0, 2);
    tested.command(Command::Start, 5, 3);
    tested.settle();
    let beliefs = all(&tested.beliefs);
    assert_eq!(beliefs.len(), 1, "of the second sweep only");
    assert_eq!(beliefs[0].motion, 2);
    assert_alike(&beliefs[0], &offline(&robot, "models/1", 130));
    let told: Vec<(u32, u64)> = all(&tested.status)
        .iter()
        .filter(|status| status.event != Event::Alive as u32)
        .map(|status| (status.event, status.motion))
        .collect();
    let expected = [
        (Event::Begun, 1),
        (Event::Rejected, 1),
        (Event::Begun, 2),
        (Event::Classified, 2),
        // Finger 5 does not exist.
        (Event::Refused, 0),
    ];
    assert_eq!(told, expected.map(|(event, motion)| (event as u32, motion)));
    assert_eq!(tested.service.counters().rejected, 1);
    let told = tested.service.take_messages();
    assert!(
        told.iter().any(|line| line.contains("rejected: ")),
        "{told:?}"
    );
}
