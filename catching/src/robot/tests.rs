use super::*;
use proptest::prelude::*;
use tactnet_catching_packets::Arm;

fn angles() -> impl Strategy<Value = [f64; ARM_JOINTS]> {
    proptest::array::uniform7(-3.0..3.0f64)
}

/// Returns the product of homogeneous transformations, following the description literally.
fn by_transformations(arm: &Arm, q: &[f64; ARM_JOINTS]) -> Isometry3<f64> {
    let about = |axis: nalgebra::Unit<Vector3<f64>>, angle: f64| {
        Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_axis_angle(&axis, angle),
        )
    };
    let up = |z: f64| Isometry3::translation(0.0, 0.0, z);
    let (y, z) = (Vector3::y_axis(), Vector3::z_axis());
    Isometry3::translation(arm.position[0], arm.position[1], arm.position[2])
        * about(Vector3::x_axis(), arm.lean)
        * up(arm.base_to_shoulder)
        * about(z, q[0])
        * about(-y, q[1])
        * about(z, q[2])
        * up(arm.shoulder_to_elbow)
        * about(y, q[3])
        * about(z, q[4])
        * up(arm.elbow_to_wrist)
        * about(-y, q[5])
        * about(z, q[6])
        * up(arm.wrist_to_catch)
}

#[test]
fn between_held_up_and_waiting_no_bodies_touch() {
    let robot = Robot::nominal();
    let bodies = crate::safety::Bodies::new(robot.description());
    let waiting = robot.waiting();
    let mut up = waiting;
    for arm in 0..ARMS {
        up[joint::ARM[arm].clone()].copy_from_slice(&robot.raised(arm));
    }
    for step in 0..=100 {
        let share = f64::from(step) / 100.0;
        let q = std::array::from_fn(|i| up[i] + share * (waiting[i] - up[i]));
        assert!(bodies.least(&q) > 0.02, "at {share}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn forward_kinematics_are_the_product_of_transformations(q in angles(), arm in 0..ARMS) {
        let robot = Robot::nominal();
        let expected = by_transformations(&robot.description().arms[arm], &q);
        let pose = robot.arm(arm).forward(&q);
        prop_assert!((pose.position - expected.translation.vector).norm() < 1e-12);
        prop_assert!((pose.rotation - expected.rotation.to_rotation_matrix().into_inner()).norm() < 1e-12);
    }

    #[test]
    fn the_way_back_leads_to_the_same_hand(q in angles(), elbow in -3.2..3.2f64, arm in 0..ARMS) {
        let robot = Robot::nominal();
        let arm = robot.arm(arm);
        let pose = arm.forward(&q);
        let mut ways = 0;
        let mut worst: f64 = 0.0;
        arm.inverse(&pose, elbow, |found| {
            ways += 1;
            let there = arm.forward(&found);
            worst = worst.max((there.position - pose.position).norm()).max((there.rotation - pose.rotation).norm());
            worst = worst.max(found.iter().map(|q| q.abs() - std::f64::consts::PI).fold(0.0, f64::max));
        });
        prop_assume!(q[3].abs() > 2e-3);
        prop_assert_eq!(ways, 8);
        prop_assert!(worst < 1e-6, "{}", worst);
    }

    #[test]
    fn among_all_elbow_angles_are_the_joint_angles_that_one_came_from(q in angles(), arm in 0..ARMS) {
        prop_assume!(q[3].abs() > 0.05 && q[1].abs() > 0.05 && q[5].abs() > 0.05);
        let robot = Robot::nominal();
        let arm = robot.arm(arm);
        let pose = arm.forward(&q);
        let distance = |elbow: f64| {
            let mut nearest = f64::INFINITY;
            arm.inverse(&pose, elbow, |found| {
                let d = found.iter().zip(&q).map(|(a, b)| (a - b).sin().abs().max(1.0 - (a - b).cos())).fold(0.0, f64::max);
                nearest = nearest.min(d);
            });
            nearest
        };
        let steps = 240;
        let at = |i: f64| i * std::f64::consts::TAU / f64::from(steps);
        let best = (0..steps).map(f64::from).min_by(|a, b| distance(at(*a)).total_cmp(&distance(at(*b)))).unwrap();
        let (mut low, mut high) = (best - 1.0, best + 1.0);
        for _ in 0..60 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if distance(at(a)) < distance(at(b)) { high = b } else { low = a }
        }
        prop_assert!(distance(at(low)) < 1e-4, "{}", distance(at(low)));
    }

    #[test]
    fn jacobians_are_differences(q in angles(), arm in 0..ARMS) {
        let robot = Robot::nominal();
        let arm = robot.arm(arm);
        let (pose, jacobian) = arm.jacobian(&q);
        let h = 1e-6;
        for i in 0..ARM_JOINTS {
            let (mut more, mut less) = (q, q);
            more[i] += h;
            less[i] -= h;
            let (more, less) = (arm.forward(&more), arm.forward(&less));
            let velocity = (more.position - less.position) / (2.0 * h);
            prop_assert!((velocity - jacobian.fixed_view::<3, 1>(0, i)).norm() < 1e-8);
            let spin = (more.rotation - less.rotation) / (2.0 * h) * pose.rotation.transpose();
            let rate = Vector3::new(spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]);
            prop_assert!((rate - jacobian.fixed_view::<3, 1>(3, i)).norm() < 1e-8);
        }
    }

    #[test]
    fn a_head_that_looks_at_a_point_has_it_ahead(x in 0.3..5.0f64, y in -2.0..2.0f64, z in -1.0..2.0f64) {
        let robot = Robot::nominal();
        let mut q = [0.0; JOINTS];
        [q[4], q[5]] = robot.look_at(&Vector3::new(x, y, z));
        let there = robot.head(&q).inverse() * nalgebra::Point3::new(x, y, z);
        prop_assert!(there.x > 0.0 && there.y.abs() < 1e-9 && there.z.abs() < 1e-9);
    }
}
