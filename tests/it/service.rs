//! The online classifier in this process, step by step: the effect of frames and commands does not depend on when the
//! service reads them.

use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use tactnet_channel::{Bus, Domain, GetPort, Packet, Priority, PutPort, Start};
use tactnet_data::{Dataset, Samples, SweepView};
use tactnet_models::Compute;
use tactnet_pipeline::{
    Classifier, DeadTaxels, NewSweeps, PredictionMethod, RiskPolicy, RunDir, TaxelOrder, adapt,
};
use tactnet_serving::{ModelSource, ServeError, Service};
use tactnet_simulation::{SkinFault, SkinSimulator};
use tactnet_skin::packets::{
    Command, Event, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus,
};
use tactnet_skin::{SegmenterConfig, ServeConfig};

use crate::robot::{Robot, STEPS, classifier, offline};

const SKIP: usize = 20;

/// A service for two fingers with all of its channels.
struct ServiceUnderTest {
    service: Service,
    fingers: [PutPort<SkinFrame>; 2],
    commands: PutPort<SweepCommand>,
    beliefs: GetPort<TactileBelief>,
    status: GetPort<TactileStatus>,
    dataset: Dataset,
    /// Fault of the skin.
    fault: SkinFault,
    /// Factor on all values.
    gain: f32,
    /// Number of sweeps so far.
    sweeps: u64,
}

impl ServiceUnderTest {
    fn new(robot: &Robot) -> Self {
        Self::with_dead(robot, &[]).unwrap()
    }

    /// - `dead`: taxels that are masked from the start
    fn with_dead(robot: &Robot, dead: &[usize]) -> Result<Self, ServeError> {
        let config = ServeConfig {
            fingers: vec!["skin/left".into(), "skin/right".into()],
            anytime_ms: 0.0,
            mc_samples: 0,
            dead: dead.to_vec(),
            segmenter: SegmenterConfig {
                skip: SKIP.into(),
                ..SegmenterConfig::default()
            },
            ..ServeConfig::default()
        };
        let bus = Bus::open(Domain::Process, &config.table("tested")).unwrap();
        let source = ModelSource::Run(robot.lab.path("models/1"));
        let finger = |id| bus.put_port::<SkinFrame>(id, Priority::High).unwrap();
        Ok(Self {
            service: Service::start(&bus, config, source, "test")?,
            fingers: [finger("skin/left"), finger("skin/right")],
            commands: bus.put_port("sweep/command", Priority::High).unwrap(),
            beliefs: bus.get_port("tactile/belief", Start::Now).unwrap(),
            status: bus.get_port("tactile/status", Start::Now).unwrap(),
            dataset: tactnet_data::format::read(&robot.lab.path("data.h5")).unwrap(),
            fault: SkinFault::default(),
            gain: 1.0,
            sweeps: 0,
        })
    }

    fn command(&self, kind: Command, finger: u32, motion: u64) {
        self.put(SweepCommand {
            kind: kind as u32,
            finger,
            motion,
            ..SweepCommand::zeroed()
        });
    }

    fn adapt(&self, sweeps: u32) {
        self.put(SweepCommand {
            kind: Command::Adapt as u32,
            sweeps,
            ..SweepCommand::zeroed()
        });
    }

    fn put(&self, command: SweepCommand) {
        self.commands.put_copy(&[command]).unwrap();
    }

    /// Returns the frames of a motion over a sweep, from its first frame on.
    fn frames(&self, sweep: usize, first_sequence: u64) -> Vec<SkinFrame> {
        let skin = SkinSimulator::new(&self.dataset, vec![sweep], SKIP, 1);
        let mut skin = skin.with_fault(self.fault.clone());
        skin.step();
        let mut frames: Vec<SkinFrame> = (0..SKIP + STEPS).map(|_| skin.step().frame).collect();
        for (at, frame) in frames.iter_mut().enumerate() {
            frame.sequence = first_sequence + at as u64;
            frame
                .digits
                .iter_mut()
                .for_each(|value| *value *= self.gain);
            frame.sensor_time_ns =
                (frame.sequence as f64 * 1e9 / self.dataset.sample_rate_hz()) as u64;
        }
        frames
    }

    /// Sweeps with the first finger and returns the belief, and all events up to the comparison with the training data.
    fn sweep(&mut self, sweep: usize) -> (TactileBelief, Vec<TactileStatus>) {
        self.sweeps += 1;
        self.command(Command::Start, 0, self.sweeps);
        let first = (self.sweeps - 1) * (SKIP + STEPS) as u64;
        for frame in self.frames(sweep, first) {
            self.fingers[0].put_copy(&[frame]).unwrap();
        }
        self.command(Command::Stop, 0, self.sweeps);
        let number = self.sweeps;
        let events = self.events_until(|status| verdict(status) && status.motion == number);
        let beliefs = all(&self.beliefs);
        assert_eq!(beliefs.len(), 1);
        (beliefs[0], events)
    }

    /// Lets the service work until an event arrives; returns all events.
    fn events_until(&mut self, wanted: impl Fn(&TactileStatus) -> bool) -> Vec<TactileStatus> {
        let begun = Instant::now();
        let mut events: Vec<TactileStatus> = Vec::new();
        while !events.iter().any(&wanted) {
            let told = || events.iter().map(|status| status.text.as_str().to_owned());
            assert!(
                begun.elapsed() < Duration::from_secs(30),
                "no such event: {:?}",
                told().collect::<Vec<_>>()
            );
            self.service.step(Duration::from_millis(5)).unwrap();
            events.extend(all(&self.status));
        }
        events
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

/// Returns true for a verdict on the likeness with the training data.
fn verdict(status: &TactileStatus) -> bool {
    let events = [Event::Like, Event::OtherBlock, Event::Unlike];
    events.iter().any(|event| status.event == *event as u32)
}

/// Returns the offline prediction for a sweep without some taxels: `[materials]` probabilities.
fn masked(robot: &Robot, sweep: usize, dead: &[usize]) -> Vec<f64> {
    let mut classifier = classifier(robot, "models/1");
    classifier.mask(dead).unwrap();
    let dataset = tactnet_data::format::read(&robot.lab.path("data.h5")).unwrap();
    let view = SweepView::new(&dataset, vec![sweep]);
    let found = classifier.predict(&view, PredictionMethod::Plain).unwrap();
    let log_p = found.sweeps[0].log_probability.iter();
    log_p.map(|log_p| log_p.exp()).collect()
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
        .filter(|status| status.event != Event::Alive as u32 && !verdict(status))
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

/// Sweeps of all four materials, in the order of the data set, as a view keeps them.
const SWEEPS: [usize; 6] = [0, 7, 41, 48, 82, 123];

#[test]
fn sweeps_are_compared_with_the_training_data_as_offline_like_them_and_transposed() {
    let robot = Robot::new("likeness");
    let mut tested = ServiceUnderTest::new(&robot);
    assert!(tested.service.tells_unlike());
    let run = RunDir::open(&robot.lab.path("models/1")).unwrap();
    let (likeness, config) = (run.likeness().unwrap().unwrap(), run.config().unwrap());
    let dataset = tactnet_data::format::read(&robot.lab.path("data.h5")).unwrap();
    for (at, sweep) in SWEEPS.into_iter().enumerate() {
        let (_, events) = tested.sweep(sweep);
        let found = events.iter().find(|status| verdict(status)).unwrap();
        let view = SweepView::new(&dataset, SWEEPS[..=at].to_vec());
        let offline = likeness.assess(&view, config.classifier.seed);
        assert_eq!(found.text.as_str(), offline.text_with_last_sweep());
        assert_eq!(found.event, Event::Like as u32, "{}", found.text.as_str());
    }
    // After a reset the sweeps before do not count.
    tested.fault.order = Some(TaxelOrder::Transposed);
    tested.command(Command::Reset, 0, 0);
    let unlike = SWEEPS.map(|sweep| {
        let (_, events) = tested.sweep(sweep);
        *events.iter().find(|status| verdict(status)).unwrap()
    });
    let last = unlike.last().unwrap();
    assert_eq!((last.event, last.finger), (Event::Unlike as u32, 0));
    let text = last.text.as_str();
    assert!(
        text.starts_with("UNLIKE the training data (p = 0.00"),
        "{text}"
    );
    let transposed: Vec<f32> = SWEEPS
        .into_iter()
        .flat_map(|sweep| {
            let mut digits = dataset.sweep(sweep);
            tested.fault.apply(&mut digits, dataset.shape());
            digits
        })
        .collect();
    let records = SWEEPS
        .map(|sweep| dataset.records()[sweep].clone())
        .to_vec();
    let (rate, labels) = (dataset.sample_rate_hz(), dataset.labels().clone());
    let samples = Samples::F32(transposed);
    let transposed = Dataset::new(
        "transposed",
        rate,
        dataset.shape(),
        labels,
        records,
        samples,
    )
    .unwrap();
    let offline = likeness.assess(&SweepView::all(&transposed), config.classifier.seed);
    assert_eq!(text, offline.text_with_last_sweep());
    let messages = tested.service.take_messages();
    let told = |text: &String| text.contains(": UNLIKE the training data");
    assert_eq!(
        messages.iter().filter(|text| told(text)).count(),
        1,
        "{messages:?}"
    );
}

#[test]
fn dead_taxels_are_found_and_masked_until_they_change_again() {
    let robot = Robot::new("dead");
    let mut tested = ServiceUnderTest::new(&robot);
    let is_masked = |status: &TactileStatus| status.event == Event::Masked as u32;
    tested.fault.dead = DeadTaxels([(5, 0.0)].into());
    let mut events: Vec<TactileStatus> = Vec::new();
    for sweep in &SWEEPS[..3] {
        assert!(!events.iter().any(is_masked));
        events = tested.sweep(*sweep).1;
    }
    if !events.iter().any(is_masked) {
        events = tested.events_until(is_masked);
    }
    let found = events.iter().find(|status| is_masked(status)).unwrap();
    assert_eq!(found.text.as_str(), "taxel 5 never changes: masked");
    // As an offline classifier that knows of the dead taxel; the beliefs before are forgotten.
    let (belief, _) = tested.sweep(SWEEPS[3]);
    assert_alike(&belief, &masked(&robot, SWEEPS[3], &[5]));
    assert!(belief.fused_sweeps <= 1, "{}", belief.fused_sweeps);
    tested.fault = SkinFault::default();
    let (belief, mut events) = tested.sweep(SWEEPS[4]);
    assert_alike(&belief, &masked(&robot, SWEEPS[4], &[5]));
    if !events.iter().any(is_masked) {
        events = tested.events_until(is_masked);
    }
    let found = events.iter().find(|status| is_masked(status)).unwrap();
    assert_eq!(found.text.as_str(), "taxel 5 changes again: not masked");
    let (belief, _) = tested.sweep(SWEEPS[5]);
    assert_alike(&belief, &offline(&robot, "models/1", SWEEPS[5]));
}

#[test]
fn known_dead_taxels_are_masked_from_the_start() {
    let robot = Robot::new("known");
    let mut tested = ServiceUnderTest::with_dead(&robot, &[3, 7]).unwrap();
    // Their values are out of range.
    tested.fault.dead = DeadTaxels([(3, -9.0), (7, 4000.0)].into());
    let (belief, events) = tested.sweep(130);
    assert_alike(&belief, &masked(&robot, 130, &[3, 7]));
    assert!(
        !events
            .iter()
            .any(|status| status.event == Event::Masked as u32)
    );
    let error = ServiceUnderTest::with_dead(&robot, &[16]).err().unwrap();
    assert_eq!(
        error.to_string(),
        "`dead`: expected numbers from 0 to 15, found 16"
    );
}

/// Returns some sweeps of the data set with all values multiplied by `gain`.
fn scaled(dataset: &Dataset, sweeps: &[usize], gain: f32) -> Dataset {
    let digits = sweeps.iter().flat_map(|sweep| dataset.sweep(*sweep));
    Dataset::new(
        "scaled",
        dataset.sample_rate_hz(),
        dataset.shape(),
        dataset.labels().clone(),
        sweeps
            .iter()
            .map(|sweep| dataset.records()[*sweep].clone())
            .collect(),
        Samples::F32(digits.map(|value| value * gain).collect()),
    )
    .unwrap()
}

#[test]
fn the_model_adapts_to_the_newest_sweeps_as_offline() {
    let robot = Robot::new("adapted");
    let mut tested = ServiceUnderTest::new(&robot);
    let text_of = |tested: &mut ServiceUnderTest, event: Event| {
        let is_it = |status: &TactileStatus| status.event == event as u32;
        let events = tested.events_until(is_it);
        events
            .iter()
            .find(|status| is_it(status))
            .unwrap()
            .text
            .as_str()
            .to_owned()
    };
    tested.adapt(16);
    let few = text_of(&mut tested, Event::Refused);
    assert!(
        few.starts_with("adapt: 16 sweeps requested, 0 complete sweeps kept"),
        "{few}"
    );
    tested.gain = 0.5;
    // Five sweeps of each material.
    let mixed: Vec<usize> = (0..4)
        .flat_map(|material| (0..5).map(move |at| 40 * material + 7 * at))
        .collect();
    for sweep in &mixed {
        tested.sweep(*sweep);
    }
    tested.adapt(4);
    let four = text_of(&mut tested, Event::Refused);
    assert!(four.contains("4 sweeps are too few"), "{four}");
    tested.adapt(mixed.len() as u32);
    let text = text_of(&mut tested, Event::Adapted);
    let recent = scaled(&tested.dataset, &mixed, 0.5);
    let view = SweepView::all(&recent);
    let new = NewSweeps {
        unlabelled: Some(&view),
        labelled: None,
    };
    let likeness = RunDir::open(&robot.lab.path("models/1"))
        .unwrap()
        .likeness()
        .unwrap();
    let before = classifier(&robot, "models/1");
    let adapted = adapt(&before, likeness.as_ref(), new, RiskPolicy::Refuse).unwrap();
    let expected = format!(
        "adapted to 20 sweeps: the taxels shifted by {:.2} training spreads; unknown materials are not detected any more",
        adapted.shift.level
    );
    assert!(text.starts_with(&expected), "{text}");
    let device = Compute::Cpu.open().unwrap();
    let after = Classifier::new(adapted.config, &adapted.weights, &device).unwrap();
    let one = scaled(&tested.dataset, &[130], 0.5);
    let probabilities = |of: &Classifier| -> Vec<f64> {
        let found = of
            .predict(&SweepView::all(&one), PredictionMethod::Plain)
            .unwrap();
        let log_p = found.sweeps[0].log_probability.iter();
        log_p.map(|log_p| log_p.exp()).collect()
    };
    let (belief, _) = tested.sweep(130);
    assert_alike(&belief, &probabilities(&after));
    assert!(belief.fused_sweeps <= 1, "{}", belief.fused_sweeps);
    // The adaptation is not one that changes nothing.
    let [old, new] = [&before, &after].map(probabilities);
    assert!(
        old.iter()
            .zip(&new)
            .any(|(old, new)| (old - new).abs() > 1e-2),
        "{old:?} {new:?}"
    );
}
