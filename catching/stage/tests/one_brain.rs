//! The coordinator's process on its channels, compared with the coordinator of stepped time.
#![allow(clippy::unwrap_used)]

use std::fmt::Debug;

use tactnet_catching::coordinate::{CoordinatorInputs, CoordinatorOutputs};
use tactnet_catching::{CatchSpace, Robot};
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, BodyPath, CatchStatus, ControllerCommand, ControllerState, Gaze,
    HandCommand, HeadPose, JointState, PlanRequest, PlanResult,
};
use tactnet_catching_roles::{CoordinatorPorts, RoleSettings, catching_channels, drain};
use tactnet_catching_trials::ThrowConfig;
use tactnet_catching_world::WorldConfig;
use tactnet_channel::{Bus, Domain, GetPort, Packet, Priority, PutPort, Start, Table};

fn put<T: Packet>(bus: &Bus, id: &str) -> PutPort<T> {
    bus.put_port(id, Priority::Normal).unwrap()
}

fn get<T: Packet>(bus: &Bus, id: &str) -> GetPort<T> {
    bus.get_port(id, Start::Now).unwrap()
}

fn send<'a, T: Packet + Copy + 'a>(port: &PutPort<T>, packets: impl IntoIterator<Item = &'a T>) {
    for packet in packets {
        port.put_copy(&[*packet]).unwrap();
    }
}

/// Compares all waiting packets with those of a step and returns their number.
fn compare<T: Packet + Copy + PartialEq + Debug>(port: &GetPort<T>, sent: &[Option<T>]) -> usize {
    let mut received = Vec::new();
    drain(port, |packet| received.push(*packet)).unwrap();
    let sent: Vec<T> = sent.iter().copied().flatten().collect();
    assert_eq!(received, sent);
    received.len()
}

#[test]
fn the_process_of_the_coordinator_sends_the_packets_of_stepped_time_one_by_one() {
    let robot = Robot::new(RobotDescription::nominal());
    let oracle = CatchSpace::new(&robot, true);
    let config = ThrowConfig::new(robot, WorldConfig::default());
    let settings = RoleSettings {
        coordinator: config.coordination(),
        drives: config.timing.drives,
        ..RoleSettings::default()
    };
    let name = format!("one-brain{}", std::process::id());
    let table = settings.into_table(catching_channels(Table::new(&name), None));
    let bus = Bus::open(Domain::Process, &table).unwrap();
    let mut coordinator = settings.new_coordinator().unwrap();
    let mut ports = CoordinatorPorts::open(&bus).unwrap();
    let joints = put::<JointState>(&bus, "joint/state");
    let head = put::<HeadPose>(&bus, "head/pose");
    let controller = put::<ControllerState>(&bus, "controller/state");
    let predictions = put::<BallPredictions>(&bus, "ball/prediction");
    let results = put::<PlanResult>(&bus, "plan/result");
    let requests = get::<PlanRequest>(&bus, "plan/request");
    let paths = get::<ArmPath>(&bus, "arm/path");
    let bodies = get::<BodyPath>(&bus, "body/path");
    let gazes = get::<Gaze>(&bus, "head/gaze");
    let hands = get::<HandCommand>(&bus, "hand/command");
    let orders = get::<ControllerCommand>(&bus, "controller/command");
    let states = get::<CatchStatus>(&bus, "catch/state");
    let mut compared = [0; 7];
    let mut steps = |now_ns, inputs: &CoordinatorInputs<'_>, outputs: &CoordinatorOutputs| {
        send(&joints, inputs.joints);
        send(&head, inputs.head);
        send(&controller, inputs.controller);
        send(&predictions, inputs.predictions);
        send(&results, inputs.results);
        ports.step(&mut coordinator, now_ns).unwrap();
        let counts = [
            compare(&requests, &outputs.requests),
            compare(&paths, &outputs.paths),
            compare(&bodies, &[outputs.body]),
            compare(&gazes, &[outputs.gaze]),
            compare(&hands, &outputs.hands),
            compare(&orders, &[outputs.order]),
            compare(&states, &[outputs.status]),
        ];
        for (sum, count) in compared.iter_mut().zip(counts) {
            *sum += count;
        }
    };
    let ready = config.ready();
    let outcome = config.observe(3, 1, &ready, &oracle, &mut steps).unwrap();
    assert!(outcome.balls[0].planned, "{outcome:?}");
    let [requests, paths, bodies, gazes, hands, _, states] = compared;
    // A path follows from most of about ten pictures.
    assert!(
        paths > 5 && requests >= paths && gazes >= paths && hands >= paths,
        "{compared:?}"
    );
    assert!(bodies == 1 && states > 10, "{compared:?}");
}
