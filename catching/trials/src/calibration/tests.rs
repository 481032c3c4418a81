use nalgebra::Vector3;
use tactnet_catching::calibrate::{
    CalibrationError, Phase, Picture, Recorder, SlipConfig, SlipWatch,
};
use tactnet_catching_packets::joint;
use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_world::{BallState, BallTruth, PlantedErrors, Truth, World};

use super::*;
use crate::eyes::Eyes;
use crate::parallel::on_threads;
use tactnet_plot::report::assert_page;

fn trial(seed: u64, throws: u64) -> CalibrationTrial {
    CalibrationTrial {
        robot: Robot::nominal(),
        world: WorldConfig {
            errors: PlantedErrors::uncalibrated(seed),
            ..WorldConfig::default()
        },
        config: CalibrationConfig::default(),
        routine: RoutineConfig::default(),
        seed,
        of_each_arm: 8,
        candidates: 100,
        unseen: 60,
        throws,
    }
}

/// The limits are the goals, although the test omits seven in ten configurations of the command's default.
#[test]
fn hands_at_unseen_poses_are_where_the_calibrated_stack_puts_them() {
    for seed in [2, 3] {
        let report = trial(seed, 0).run(|_| ()).unwrap();
        assert!(report.raw.worst_mm > 20.0, "{:?}", report.raw);
        assert!(report.mean_mm <= 3.9, "{}", report.mean_mm);
        assert!(report.worst_mm <= 9.1, "{}", report.worst_mm);
        assert!(report.random.log_det_gain > 0.0, "{:?}", report.random);
        assert!(report.solved.robot_seconds < 300.0);
        // Indistinguishable parameters are reported.
        let worst = &report.solved.worst_determined[0];
        assert!(worst.left > 0.99 && !worst.unknowns.is_empty(), "{worst:?}");
        // Values behind the statistics.
        let samples = &report.samples;
        for (all, mean) in [
            (&samples.raw_mm, report.raw.mean_mm),
            (&samples.found_mm, report.mean_mm),
            (&samples.random_mm, report.random.mean_mm),
        ] {
            assert_eq!(all.len(), 2 * 60);
            assert!((all.iter().sum::<f64>() / 120.0 - mean).abs() < 1e-9);
        }
        assert_eq!(samples.residuals_px.len(), report.solved.features);
        let mut sorted = samples.residuals_px.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted[sorted.len() / 2] / (1.177_410 * samples.noise_px);
        assert!((median - report.solved.fit).abs() < 0.01, "{median}");
    }
}

#[test]
fn a_calibrated_robot_catches_what_it_missed_whatever_the_number_of_threads() {
    let run = |threads: usize| {
        let mut report = on_threads(threads, || trial(4, 16).run(|_| ())).unwrap();
        report.solved.solve_seconds = 0.0;
        report
    };
    let report = run(2);
    assert!(report.in_catch_space >= 5, "{}", report.in_catch_space);
    assert!(report.catch_rate_before.unwrap() < 0.5, "{report:?}");
    assert!(report.catch_rate_after.unwrap() >= 0.8, "{report:?}");
    let page = calibration_page(&report);
    assert_page(&page);
    // Hands, markers and catches.
    assert_eq!(page.matches("<svg class=\"figure\"").count(), 3);
    let found = format!("Hands are {:.2} mm from where", report.mean_mm);
    assert!(page.contains(&found) && page.contains("mm is met"));
    let text = |report: &CalibrationReport| serde_json::to_string(report).unwrap();
    assert_eq!(text(&report), text(&run(1)));
}

/// Returns a recorded session of a robot with its model.
fn recorded() -> (Model, Session, CalibrationTrial) {
    let trial = trial(5, 0);
    let model = Model::new(&trial.robot);
    let drawn = candidates(&model, &trial.config, 5, 20).unwrap();
    let (session, _) = rehearse(&model, &trial.world(), &trial.routine, &drawn, 5).unwrap();
    (model, session, trial)
}

#[test]
fn what_no_solver_can_mend_is_named_and_the_last_calibration_stays() {
    let (model, good, trial) = recorded();
    let path = std::env::temp_dir().join(format!("tactnet-cal-{}.toml", std::process::id()));
    let calibrate = |session: &Session| -> Result<(), TrialError> {
        let (report, _) = SolveReport::new(&model, &trial.config, session, None)?;
        keep_calibration(&path, &report.kept).unwrap();
        Ok(())
    };
    calibrate(&good).unwrap();
    let kept = std::fs::read_to_string(&path).unwrap();
    assert!(KeptCalibration::parse(&kept, model.robot().description()).is_ok());
    type Spoil = fn(&mut Session);
    let cases: [(&str, Spoil); 7] = [
        ("picture 3: expected numbers, found NaN", |s| {
            s.pictures[3].q[2] = f64::NAN;
        }),
        ("rest 0: expected numbers, found inf", |s| {
            s.rests[0].acceleration[1] = f64::INFINITY;
        }),
        (
            "the right camera never saw the marker of the left arm",
            |s| {
                for picture in s.pictures.iter_mut().filter(|p| p.arm == 0) {
                    picture.features[1] = None;
                }
            },
        ),
        ("cameras are exchanged", |s| {
            for picture in &mut s.pictures {
                picture.features.reverse();
            }
        }),
        ("at least 5 configurations of the right arm, found 2", |s| {
            // Configurations alternate between both arms.
            s.pictures.retain(|p| p.arm == 0 || p.configuration < 5);
        }),
        ("expected arm 0 or 1, found 2", |s| s.pictures[7].arm = 2),
        ("the model does not fit the session", |s| {
            // Alternating left and right offsets, as if the pictures belonged to two robots.
            for (number, picture) in s.pictures.iter_mut().enumerate() {
                for feature in picture.features.iter_mut().flatten() {
                    feature[0] += if number % 2 == 0 { 2.0 } else { -2.0 };
                }
            }
        }),
    ];
    for (named, spoil) in cases {
        let mut session = good.clone();
        spoil(&mut session);
        let error = calibrate(&session).unwrap_err();
        assert!(matches!(error, TrialError::Calibration(_)), "{error}");
        assert!(error.to_string().contains(named), "{named}: {error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), kept);
    }
    std::fs::remove_file(path).unwrap();
}

/// A tendon slips by a degree after the calibration, so the sensor reads that much less.
#[test]
fn a_slipped_tendon_asks_for_calibration_and_a_good_robot_does_not() {
    let (model, session, trial) = recorded();
    let (_, solved) = SolveReport::new(&model, &trial.config, &session, None).unwrap();
    // Another session of the same robot.
    let drawn = candidates(&model, &trial.config, 6, 10).unwrap();
    let (later, _) = rehearse(&model, &trial.world(), &trial.routine, &drawn, 6).unwrap();
    let watch = |slipped: fn(&mut Picture)| -> Option<f64> {
        let mut watch = SlipWatch::new(SlipConfig::default()).unwrap();
        later.pictures.iter().find_map(|picture| {
            let mut picture = *picture;
            slipped(&mut picture);
            let (x, covariance) = (&solved.unknowns, &solved.covariance);
            watch.picture(&model, &trial.config.noise, x, covariance, &picture)
        })
    };
    assert_eq!(watch(|_| ()), None);
    assert!(watch(|p| p.q[1] -= 0.0175).is_some());
    assert!(watch(|p| p.q[4] -= 0.0175).is_some());
    assert!(watch(|p| p.neck.q[0] -= 0.0175).is_some());
}

#[test]
fn a_session_without_anything_is_refused() {
    let model = Model::new(&Robot::nominal());
    let config = CalibrationConfig::default();
    let error = calibrate(&model, &Session::default(), &config, None).unwrap_err();
    let is_unseen = matches!(error, CalibrationError::NeverSeen { arm: 0, .. });
    assert!(is_unseen, "{error}");
}

/// Returns a trial with rendered pictures, shorter sweeps and much clutter.
fn rendered() -> CalibrationTrial {
    let mut trial = trial(5, 0);
    let sweep = &mut trial.routine.sweep;
    (sweep.seconds, sweep.rounds) = (0.4, [0.5, 0.25]);
    let pictures = &mut trial.world.pictures;
    (pictures.markers, pictures.discs, pictures.people) = (true, 24, 6);
    trial
}

#[test]
fn rendered_markers_are_found_before_clutter_and_sessions_repeat_to_the_bit() {
    let trial = rendered();
    let model = Model::new(&trial.robot);
    let drawn = candidates(&model, &trial.config, 5, 4).unwrap();
    let run = |of: &[Candidate]| rehearse(&model, &trial.world(), &trial.routine, of, 5).unwrap();
    assert_eq!(run(&drawn[..1]), run(&drawn[..1]));
    let (_, features) = run(&drawn);
    assert!(features.shown > 60, "{features:?}");
    assert_eq!(
        features.found + features.missed + features.wrong,
        features.shown
    );
    // With this clutter half of them are found in both pictures of a pair; in a whole session four of five.
    assert!(10 * features.found > 4 * features.shown, "{features:?}");
    assert!(100 * features.wrong <= features.shown, "{features:?}");
    let errors = [features.error_px_median, features.error_px_p95];
    assert!(errors[0] < 0.3 && errors[1] < 2.0, "{features:?}");
}

#[test]
fn a_hidden_marker_is_missed_and_gives_no_false_place() {
    let trial = rendered();
    let (model, world) = (Model::new(&trial.robot), trial.world());
    let pose = candidates(&model, &trial.config, 5, 1).unwrap()[0];
    let mut q = trial.robot.waiting();
    q[joint::ARM[pose.arm].clone()].copy_from_slice(&pose.q);
    q[joint::NECK].copy_from_slice(&pose.gaze);
    let mut eyes = Eyes::new(&trial.robot, &world, 5).unwrap();
    let mut world = World::new(trial.robot.description(), &world, 5, &q).unwrap();
    let mut recorder = Recorder::new(1.0);
    recorder.joints(&world.step(&JointCommand::still(q), &[None; ARMS]).joints);
    let guess = trial.config.priors.guess();
    let (arm, configuration) = (pose.arm, 0);
    let mut see = |truth: &Truth| {
        let circles = eyes.see(truth, None);
        recorder.circles(
            &model,
            &guess,
            &circles,
            Phase::Marker { configuration, arm },
        )
    };
    let mut truth = world.truth();
    assert!(see(&truth).iter().all(Option::is_some));
    let marker = truth.markers[arm].position;
    // A ball between the head and the marker.
    let state = BallState {
        position: marker + (truth.head.position - marker) * 0.2,
        velocity: Vector3::zeros(),
    };
    truth.balls[0] = Some(BallTruth { number: 0, state });
    assert_eq!(see(&truth), [None; 2]);
}
