use super::*;
use crate::pose::ready;
use crate::{MAX_ACROSS, Miss};
use nalgebra::Vector3;

const NOBODY: [Option<HandCommand>; ARMS] = [None; ARMS];

fn world(config: &WorldConfig, seed: u64) -> World {
    World::new(&RobotDescription::nominal(), config, seed, &ready()).unwrap()
}

fn rigid() -> WorldConfig {
    let mut config = WorldConfig::default();
    config.torso.stiffness = crate::Stiffness::Rigid;
    config
}

fn stay() -> JointCommand {
    JointCommand::still(ready())
}

/// A small motion of all joints.
fn waving(tick: u64) -> JointCommand {
    let t = tick as f64 * 1e-3;
    JointCommand::still(std::array::from_fn(|i| {
        ready()[i] + 0.1 * (3.0 * t + i as f64).sin() - 0.1 * (i as f64).sin()
    }))
}

fn senses(config: &WorldConfig, seed: u64, ticks: u64) -> (Vec<Sensed>, Vec<Truth>) {
    let mut world = world(config, seed);
    world.throw(2);
    (0..ticks)
        .map(|tick| {
            let sensed = *world.step(&waving(tick), &NOBODY);
            (sensed, world.truth())
        })
        .unzip()
}

#[test]
fn a_world_repeats_to_the_bit_from_its_seed() {
    let config = WorldConfig::default();
    let (first, truth) = senses(&config, 4, 1200);
    assert!((first.clone(), truth) == senses(&config, 4, 1200));
    assert!(first != senses(&config, 5, 1200).0);
}

#[test]
fn sensors_keep_their_rates() {
    let (senses, _) = senses(&WorldConfig::default(), 1, 2000);
    assert_eq!(senses.iter().filter(|s| s.imu.is_some()).count(), 1024);
    let pictures: Vec<_> = senses.iter().filter_map(|s| s.circles).collect();
    assert_eq!(pictures.len(), 50);
    for (frame, [left, right]) in pictures.iter().enumerate() {
        assert_eq!((left.frame, right.frame), (frame as u64, frame as u64));
        assert_eq!(left.exposure_ns, right.exposure_ns);
        assert_eq!((left.camera, right.camera), (0, 1));
        let since_ns = left.exposure_ns - pictures[0][0].exposure_ns;
        assert_eq!(since_ns, frame as u64 * 40 * TICK_NS);
    }
    for (number, sensed) in senses.iter().enumerate() {
        assert_eq!(sensed.joints.number, number as u64);
        assert_eq!(sensed.joints.sensor_ns, (number as u64 + 1) * TICK_NS);
    }
}

#[test]
fn one_parts_randomness_does_not_shift_anothers() {
    let config = WorldConfig::default();
    let mut other = config.clone();
    other.cameras.clutter = 7.0;
    other.imu.scale = 0.1;
    let (plain, truth) = senses(&config, 4, 600);
    let (noisy, same) = senses(&other, 4, 600);
    assert!(truth == same);
    assert!(plain.iter().zip(&noisy).all(|(a, b)| a.joints == b.joints));
    for (a, b) in plain.iter().zip(&noisy) {
        let (Some(a), Some(b)) = (a.circles, b.circles) else {
            continue;
        };
        assert!(a[0].exposure_ns == b[0].exposure_ns);
    }
    other.errors.platform_slip = 0.0;
    assert!(truth != senses(&other, 4, 600).1);
}

#[test]
fn a_ball_flies_as_its_true_flight_says() {
    let mut world = world(&WorldConfig::default(), 8);
    for _ in 0..100 {
        world.step(&stay(), &NOBODY);
    }
    world.throw(1);
    let flight = world.true_flight(0).unwrap();
    assert_eq!(flight[0].t_ns, 100 * TICK_NS);
    assert!(flight.len() > 500);
    for sample in &flight[1..] {
        world.step(&stay(), &NOBODY);
        let ball = world.truth().balls[0].unwrap();
        assert_eq!((world.time_ns(), ball.number), (sample.t_ns, 0));
        assert_eq!(ball.state, sample.state);
    }
    assert!(world.true_flight(1).is_none());
}

/// Throws a straight, flat ball at the left hand, `off` (in m) from its centre. The hand closes `late_ns` after the
/// crossing.
fn thrown_at_the_hand(seed: u64, off: Vector3<f64>, late_ns: i64) -> Verdict {
    let mut config = WorldConfig::default();
    let hand = world(&config, seed).truth().hands[0];
    let target = hand.position + off;
    config.thrower = crate::ThrowerConfig {
        distance: [4.0, 4.0],
        aside: [target.y, target.y],
        height: [1.5, 1.5],
        speed: [8.0, 8.0],
        box_least: target.into(),
        box_greatest: target.into(),
        gap: [0.0, 0.0],
    };
    let mut world = world(&config, seed);
    world.throw(1);
    let axis = hand.rotation.column(2).into_owned();
    let flight = world.true_flight(0).unwrap();
    let before = |sample: &FlightSample| axis.dot(&(sample.state.position - hand.position));
    let i = flight
        .iter()
        .position(|sample| before(sample) <= 0.0)
        .unwrap();
    let part = before(&flight[i]) / (before(&flight[i - 1]) - before(&flight[i]));
    let crossing_ns = flight[i].t_ns as i64 + (part * TICK_NS as f64) as i64;
    let catch = HandCommand {
        arm: 0,
        catch_ns: u64::try_from(crossing_ns + late_ns).unwrap(),
    };
    while world.verdicts().is_empty() {
        let told = world.time_ns() < 300 * TICK_NS;
        world.step(&stay(), &[told.then_some(catch), None]);
    }
    let [verdict] = world.verdicts() else {
        panic!("one ball, one verdict")
    };
    assert_eq!(world.truth().balls[0].is_none(), verdict.caught());
    *verdict
}

#[test]
fn a_hand_at_the_crossing_catches_and_one_beside_or_late_does_not() {
    let centre = Vector3::zeros();
    let aside = |size: f64| Vector3::new(0.0, size, 0.0);
    let ms = TICK_NS as i64;
    for seed in 0..5 {
        let verdict = thrown_at_the_hand(seed, centre, 0);
        assert!(verdict.caught(), "{verdict:?}");
        let crossing = verdict.crossing.unwrap();
        // Aiming uses longer steps and crossings are interpolated over 0.1 ms: errors of micrometres and
        // microseconds.
        assert!(crossing.across_m < 1e-5, "{crossing:?}");
        assert!(crossing.along_s.unwrap().abs() < 1e-5, "{crossing:?}");
        for (off, late, miss) in [
            (aside(0.04), 0, Some(Miss::Across)),
            (aside(-0.04), 0, Some(Miss::Across)),
            (aside(0.9 * MAX_ACROSS), 4 * ms, None),
            (centre, 30 * ms, Some(Miss::Late)),
            (centre, -30 * ms, Some(Miss::Early)),
        ] {
            let verdict = thrown_at_the_hand(seed, off, late);
            assert_eq!(verdict.miss, miss, "{verdict:?}");
        }
    }
}

#[test]
fn every_ball_gets_one_verdict() {
    let mut world = world(&WorldConfig::default(), 3);
    let mut causes = Vec::new();
    for _ in 0..8 {
        world.throw(2);
        // Some balls still bounce when the next are thrown.
        for _ in 0..1600 {
            world.step(&stay(), &NOBODY);
        }
        causes.extend(world.verdicts().iter().map(|verdict| verdict.miss));
    }
    let balls = world.verdicts().iter().map(|verdict| verdict.ball);
    let balls: Vec<u64> = balls.collect();
    let mut sorted = balls.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, (0..16).collect::<Vec<u64>>());
    let far = |miss: &Option<Miss>| matches!(miss, Some(Miss::NeverCameNear | Miss::NoCommand));
    assert!(causes.iter().all(far));
}

#[test]
fn commands_that_are_no_numbers_never_break_the_state() {
    let mut world = world(&WorldConfig::default(), 3);
    let before = world.truth();
    world.throw(1);
    for tick in 0..500 {
        let mut bad = stay();
        bad.q[tick % JOINTS] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][tick % 3];
        let past = HandCommand {
            arm: 5,
            catch_ns: u64::MAX,
        };
        let sensed = *world.step(&bad, &[Some(past), None]);
        assert!(sensed.joints.q == ready());
        assert!(sensed.joints.tau.iter().all(|tau| tau.is_finite()));
    }
    let moved = (world.truth().head.position - before.head.position).norm();
    assert!(moved < 1e-10, "{moved}");
    let (joints, hands) = (500, [500, 0]);
    assert_eq!(world.ignored(), Ignored { joints, hands });
}

/// Steps between targets at opposite ends of the ranges, worse than any controller.
#[test]
fn the_wildest_commands_leave_all_finite() {
    let mut world = world(&WorldConfig::default(), 3);
    for tick in 0..3000 {
        let far = if tick / 150 % 2 == 0 { 1e3 } else { -1e3 };
        let mut wild = JointCommand::still([far; JOINTS]);
        wild.dq = [far * 1e9; JOINTS];
        world.step(&wild, &NOBODY);
    }
    let (head, deflection) = (world.truth().head.position, world.truth().deflection);
    assert!(head.iter().all(|x| x.is_finite()));
    // Torques have no limits, but the torso keeps its shape.
    assert!(deflection.iter().all(|e| e.abs() < 0.5), "{deflection:?}");
}

#[test]
fn planted_errors_have_their_size() {
    let rigid = rigid();
    let mut off = rigid.clone();
    off.errors.arm_mount = 0.06;
    for seed in 0..5 {
        let (right, wrong) = (world(&rigid, seed).truth(), world(&off, seed).truth());
        for arm in 0..ARMS {
            let moved = wrong.hands[arm].position - right.hands[arm].position;
            assert!((moved.norm() - 0.06).abs() < 1e-12);
        }
        assert_eq!(right.head, wrong.head);
        let mut world = world(&rigid, seed);
        for tick in 0..1500 {
            let mut sideways = stay();
            sideways.q[0] = 0.4 * f64::from(tick) / 1500.0;
            world.step(&sideways, &NOBODY);
        }
        let truth = world.truth();
        assert!(truth.slip != 0.0 && truth.slip.abs() <= 0.006);
        let way = truth.chest.position.y - right.chest.position.y;
        assert!((way - world.robot.drives.q[0] - truth.slip).abs() < 1e-12);
    }
}

#[test]
fn a_joint_that_starts_out_of_range_is_named() {
    let mut start = ready();
    start[8] = 3.5;
    let (robot, config) = (RobotDescription::nominal(), WorldConfig::default());
    let found = World::new(&robot, &config, 1, &start);
    let error = found.err().unwrap().to_string();
    assert!(error.contains("joint 8 starts at 3.5"), "{error}");
}

#[test]
fn a_ball_leaves_the_hand_that_it_was_given_to_and_flies_on_in_another_world() {
    let mut config = WorldConfig::default();
    config.release.jitter = 0.0;
    let mut first = world(&config, 5);
    assert_eq!(first.give(1), Ok(()));
    assert_eq!(first.holding(), [false, true]);
    let full = first.give(1).unwrap_err().to_string();
    assert!(full.contains("hand 1 holds a ball"), "{full}");
    assert_eq!(first.give(2), Err(WorldError::Arm { arm: 2 }));
    let open_ns = 50 * TICK_NS + 400_000;
    for tick in 0..50 {
        let arm = u64::from(tick > 30);
        first.tell_opening(&HandOpening { arm, open_ns });
        first.step(&stay(), &NOBODY);
        assert_eq!(first.released(), None);
    }
    first.step(&stay(), &NOBODY);
    let released = *first.released().unwrap();
    assert_eq!((released.at_ns, first.holding()), (open_ns, [false; ARMS]));
    let hand = first.truth().hands[1].position;
    assert!((released.state.position - hand).norm() < 1e-9, "it stands");
    // Dropped in this world.
    let mut third = first.clone();
    third.let_fly();
    let begun = third.time_ns();
    let flight = third.flight_of(&released);
    while let Some(ball) = third.flying().copied() {
        assert_eq!(third.truth().balls[0].map(|truth| truth.state), Some(ball));
        // From one of its samples to now.
        let since = (third.time_ns() - released.at_ns) / TICK_NS;
        let part = (third.time_ns() - flight[since as usize].t_ns) as f64 * 1e-9;
        let sample = &flight[since as usize].state;
        let there = sample.position.z + (sample.velocity.z - 4.9 * part) * part;
        assert!((ball.position.z - there).abs() < 1e-4);
        third.step(&stay(), &NOBODY);
    }
    assert!((300..600).contains(&((third.time_ns() - begun) / TICK_NS)));
    assert!(third.verdicts().is_empty() && third.truth().balls == [None; MAX_BALLS]);
    // Dropped in another world, 0.6 ms later.
    let mut second = world(&config, 6);
    second.launch(&released, 0.0006);
    let flight = first.flight_of(&released);
    for _ in 0..100 {
        second.step(&stay(), &NOBODY);
    }
    let ball = second.truth().balls[0].unwrap();
    let fallen = flight[100].state.position.z - ball.state.position.z;
    // 100.6 ms compared with 100 ms, at 0.97 m/s.
    assert!((fallen - 0.0006 * 0.973).abs() < 1e-5, "{fallen}");
}

/// The hand moves as if the joint were rotated; sensors, the other arm and the head do not change.
#[test]
fn a_slipped_tendon_moves_the_hand_and_no_sensor() {
    let config = rigid();
    let mut world = world(&config, 3);
    world.step(&stay(), &NOBODY);
    let (before, sensed) = (world.truth(), world.sensed.joints.q);
    let (arm, joint, angle) = (1, 1, 0.0175);
    let slip = TendonSlip { arm, joint, angle };
    world.slip(&slip).unwrap();
    let after_step = world.step(&stay(), &NOBODY).joints.q;
    let after = world.truth();
    assert_eq!(after_step, sensed);
    let moved = |arm: usize| (after.hands[arm].position - before.hands[arm].position).norm();
    let mut turned = ready();
    turned[tactnet_catching_packets::joint::ARM[1].start + 1] += slip.angle;
    let mut there = World::new(&RobotDescription::nominal(), &config, 3, &turned).unwrap();
    there.step(&JointCommand::still(turned), &NOBODY);
    let beside = (after.hands[1].position - there.truth().hands[1].position).norm();
    assert!(beside < 1e-6 && moved(1) > 1e-3, "{beside} of {}", moved(1));
    assert!(moved(0) < 1e-9 && (after.head.position - before.head.position).norm() < 1e-9);
    let nobody = TendonSlip { arm: 7, ..slip };
    assert_eq!(world.slip(&nobody), Err(WorldError::Arm { arm: 7 }));
}
