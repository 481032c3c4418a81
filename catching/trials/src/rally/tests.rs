use tactnet_catching::throw::NoThrow;

use super::*;
use crate::parallel::on_threads;
use tactnet_plot::report::assert_page;

fn rally(config: RallyConfig, rallies: usize) -> Rally {
    Rally {
        config,
        robot: Robot::nominal(),
        world: WorldConfig::default(),
        rallies,
        seed: 3,
    }
}

fn short() -> RallyConfig {
    RallyConfig {
        practice: 2,
        most: 2,
        ..RallyConfig::default()
    }
}

#[test]
fn robots_play_catch_and_games_repeat_to_the_bit_whatever_the_number_of_threads() {
    let run = |threads: usize| {
        let report = on_threads(threads, || rally(short(), 2).run(|| ())).unwrap();
        let page = rally_page(&report);
        (serde_json::to_value(&report).unwrap(), report.flights, page)
    };
    let (report, flights, page) = run(2);
    assert_eq!((report.clone(), flights.clone(), page.clone()), run(1));
    assert_page(&page);
    let title = format!("{} flights from the side, up to 4.", flights.len());
    assert!(page.contains(&title) && page.contains("throws were caught"));
    assert_eq!(Some(flights.len() as u64), report["throws"].as_u64());
    assert!(report["flights"].is_null());
    for flight in flights {
        let [far, high] = *flight.path.last().unwrap();
        assert!((4.0..5.0).contains(&far) && (1.2..1.3).contains(&high));
    }
    assert!(report["throws"].as_u64().unwrap() >= 2);
    // Usually all four throws are caught.
    assert!(report["catches"].as_u64().unwrap() >= 2, "{report}");
    let flown = report["distance_m"].as_f64().unwrap();
    assert!((4.0..5.0).contains(&flown), "{flown}");
    let lost = report["distance_lost_mm_at_2ms"].as_f64().unwrap();
    assert!((1.0..100.0).contains(&lost), "{lost}");
    for key in ["longest", "rate", "ci95_low", "ci95_high", "causes"] {
        assert!(!report[key].is_null(), "{key}");
    }
}

/// Four times the drag that planner and tracker assume.
#[test]
fn balls_that_fly_as_nobody_expects_are_missed() {
    let mut windy = rally(short(), 2);
    windy.config.practice = 0;
    windy.world.ball.drag = [2.0, 2.0];
    // The throws that happen must be possible.
    windy.world.thrower.distance = [1.5, 2.0];
    let report = windy.run(|| ()).unwrap();
    assert!(report.catches < report.throws, "{report:?}");
    let missed: usize = report.causes.values().sum();
    assert_eq!(missed, report.throws - report.catches);
    assert!(report.beside_mm_rms > Some(300.0), "{report:?}");
}

#[test]
fn practice_brings_throws_nearer_to_their_target() {
    let beside = |practice: usize| {
        let config = RallyConfig {
            practice,
            most: 1,
            ..RallyConfig::default()
        };
        let mut rally = rally(config, 2);
        // The planner expects more drag, so the balls fly too far.
        rally.world.ball.drag = [0.1, 0.1];
        rally.run(|| ()).unwrap().beside_mm_rms.unwrap()
    };
    let (without, with) = (beside(0), beside(3));
    assert!(with < 0.7 * without, "{without} {with}");
}

#[test]
fn what_makes_no_sense_is_refused_with_its_setting() {
    let refused = |spoil: fn(&mut RallyConfig)| {
        let mut config = RallyConfig::default();
        spoil(&mut config);
        rally(config, 1).run(|| ()).unwrap_err()
    };
    let far = refused(|config| config.distance = 9.0);
    let is_far = matches!(far, TrialError::Throw(NoThrow::OutOfReach { .. }));
    assert!(is_far, "{far}");
    type Spoil = fn(&mut RallyConfig);
    let cases: [(Spoil, &str); 5] = [
        (|config| config.distance = 1.0, "`distance`"),
        (|config| config.target = [4.8, 0.0, 1.0], "`target`"),
        (|config| config.gain = -1.0, "`gain`"),
        (|config| config.most = 0, "`most`"),
        (|config| config.wheels = Some(0.0), "`wheels`"),
    ];
    for (spoil, named) in cases {
        let error = refused(spoil).to_string();
        assert!(error.contains(named), "{named}: {error}");
    }
    let unknown = serde_json::from_str::<RallyConfig>(r#"{"distanc": 5}"#);
    assert!(unknown.unwrap_err().to_string().contains("unknown field"));
}

#[test]
fn a_hand_without_a_ball_throws_nothing() {
    let mut player = rally(short(), 1).player(1).unwrap();
    let error = player.throw(0).unwrap_err();
    assert_eq!(error, TrialError::Throw(NoThrow::NoBall));
}

#[test]
fn a_ball_crosses_to_the_other_robot_and_back() {
    let rally = rally(short(), 1);
    let released = Released {
        arm: 0,
        at_ns: 5,
        state: BallState {
            position: Vector3::new(0.5, 0.3, 1.4),
            velocity: Vector3::new(5.0, -1.0, 3.0),
        },
        spin: Vector3::new(1.0, 2.0, 3.0),
        drag: 0.47,
    };
    let there = rally.handed_over(&released);
    assert!((there.state.position - Vector3::new(4.5, -0.3, 1.4)).norm() < 1e-12);
    assert!((there.state.velocity - Vector3::new(-5.0, 1.0, 3.0)).norm() < 1e-12);
    let back = rally.handed_over(&there);
    assert!((back.state.velocity - released.state.velocity).norm() < 1e-12);
    assert!((back.spin - released.spin).norm() < 1e-12);
}
