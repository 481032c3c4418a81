//! The coordinator's process on its channels, compared with the coordinator of stepped time.
#![allow(clippy::unwrap_used)]

use std::fmt::Debug;

use tactnet_catching::coordinate::{CoordinatorInputs, CoordinatorOutputs};
use tactnet_catching::{CatchSpace, Robot};
use tactnet_catching_roles::{
    RoleSettings, Times, catching_channels, channels, coordinator_shell, drain,
};
use tactnet_catching_trials::ThrowConfig;
use tactnet_catching_world::WorldConfig;
use tactnet_channel::{Bus, Domain, GetPort, Packet, PutPort, Table};

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
    let robot = Robot::nominal();
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
    let (_, mut step) = coordinator_shell(&bus).unwrap();
    let joints = channels::JOINT_STATE.put(&bus).unwrap();
    let head = channels::HEAD_POSE.put(&bus).unwrap();
    let controller = channels::CONTROLLER_STATE.put(&bus).unwrap();
    let predictions = channels::PREDICTION.put(&bus).unwrap();
    let results = channels::PLAN_RESULT.put(&bus).unwrap();
    let requests = channels::PLAN_REQUEST.get(&bus).unwrap();
    let paths = channels::ARM_PATH.get(&bus).unwrap();
    let bodies = channels::BODY_PATH.get(&bus).unwrap();
    let gazes = channels::HEAD_GAZE.get(&bus).unwrap();
    let hands = channels::HAND_COMMAND.get(&bus).unwrap();
    let orders = channels::CONTROLLER_COMMAND.get(&bus).unwrap();
    let states = channels::CATCH_STATE.get(&bus).unwrap();
    let (mut compared, mut times) = ([0; 7], Times::at(1));
    let mut steps = |now_ns, inputs: &CoordinatorInputs<'_>, outputs: &CoordinatorOutputs| {
        send(&joints, inputs.joints);
        send(&head, inputs.head);
        send(&controller, inputs.controller);
        send(&predictions, inputs.predictions);
        send(&results, inputs.results);
        step(&mut coordinator, now_ns, &mut times).unwrap();
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
    let outcome = config.run(3, 1, &oracle, Some(&mut steps)).unwrap();
    assert!(outcome.balls[0].planned, "{outcome:?}");
    let [requests, paths, bodies, gazes, hands, _, states] = compared;
    // A path follows from most of about ten pictures.
    let least = requests.min(gazes).min(hands);
    assert!(paths > 5 && least >= paths, "{compared:?}");
    assert!(bodies == 1 && states > 10, "{compared:?}");
}
