//! One throw of a series in the Rerun viewer: the robot as capsules, balls, joint rates, costs of plans.

use tactnet_catching::flight::BALL_RADIUS;
use tactnet_catching::map::DistanceField;
use tactnet_catching_packets::{ARMS, joint};
use tactnet_catching_trials::{Series, SeriesReport, Trace, TraceTick};
use tactnet_catching_world::StandingBox;
use tactnet_recording::view::{Ball, Capsule, Curves, Lines, Motion, Points, Target, show_motion};

/// Number of ticks of 1 ms between two shown states.
const EVERY: usize = 4;

/// Edge length of the shown cells of a map, in cells of the map.
const COARSE: usize = 2;

/// Shows the throw that a page would draw, with the robot's map of obstacles.
pub fn view(series: &Series, report: &SeriesReport, target: &Target) -> anyhow::Result<()> {
    if let Some((number, trace)) = series.drawn(report)? {
        show_motion(target, &format!("throw {number}"), &motion(&trace))?;
    }
    Ok(())
}

fn motion(trace: &Trace) -> Motion {
    let ticks: Vec<&TraceTick> = trace.ticks.iter().step_by(EVERY).collect();
    Motion {
        times_ns: ticks.iter().map(|tick| time_ns(tick.t)).collect(),
        capsules: capsules(&ticks),
        balls: balls(&ticks),
        points: trace.field.iter().map(|field| surface(field)).collect(),
        lines: vec![Lines {
            name: "boxes".into(),
            strips: trace.boxes.iter().flat_map(edges).collect(),
        }],
        curves: curves(trace, &ticks),
    }
}

fn time_ns(t: f64) -> i64 {
    (t * 1e9).round() as i64
}

/// Returns the bodies of the robot.
fn capsules(ticks: &[&TraceTick]) -> Vec<Capsule> {
    let capsule = |name: &str, radius: f32, ends: &dyn Fn(&TraceTick) -> [[f64; 3]; 2]| Capsule {
        name: name.into(),
        radius,
        ends: ticks.iter().map(|tick| ends(tick)).collect(),
    };
    let mut capsules = vec![
        capsule("column", 0.12, &|tick| {
            let [hip, ..] = tick.torso;
            [[hip.x, hip.y, 0.1], hip.into()]
        }),
        capsule("lower-torso", 0.10, &|tick| {
            [tick.torso[0].into(), tick.torso[1].into()]
        }),
        capsule("upper-torso", 0.10, &|tick| {
            [tick.torso[1].into(), tick.torso[2].into()]
        }),
        capsule("shoulders", 0.08, &|tick| {
            tick.arms.map(|arm| arm[0].into())
        }),
        capsule("neck", 0.05, &|tick| {
            [tick.torso[2].into(), tick.head.into()]
        }),
        capsule("head", 0.10, &|tick| {
            let head = tick.head;
            [head.into(), [head.x, head.y, head.z + 0.06]]
        }),
    ];
    for (arm, side) in (0..ARMS).zip(["left", "right"]) {
        for (link, (name, radius)) in [("upper-arm", 0.06), ("forearm", 0.05), ("hand", 0.04)]
            .into_iter()
            .enumerate()
        {
            capsules.push(capsule(&format!("{side}-{name}"), radius, &|tick| {
                [tick.arms[arm][link].into(), tick.arms[arm][link + 1].into()]
            }));
        }
    }
    capsules
}

fn balls(ticks: &[&TraceTick]) -> Vec<Ball> {
    (0..2)
        .filter(|ball| ticks.iter().any(|tick| tick.balls[*ball].is_some()))
        .map(|ball| Ball {
            name: format!("{}", ball + 1),
            radius: BALL_RADIUS as f32,
            places: ticks
                .iter()
                .map(|tick| tick.balls[ball].map(|p| p.into()))
                .collect(),
        })
        .collect()
}

/// Returns the joint rates of the arm that catches, or of the left one, and the costs of its plans.
fn curves(trace: &Trace, ticks: &[&TraceTick]) -> Vec<Curves> {
    let arm = trace.plans.last().map_or(0, |plan| plan.arm);
    let rates = joint::ARM[arm].clone().enumerate().map(|(i, index)| {
        let rates = ticks
            .iter()
            .map(|tick| (time_ns(tick.t), tick.measured[index]));
        (format!("joint {}", i + 1), rates.collect())
    });
    let costs = trace.plans.iter().filter(|plan| plan.arm == arm);
    let costs = costs.map(|plan| (time_ns(plan.t), plan.cost)).collect();
    vec![
        Curves {
            name: "joint rates, rad/s".into(),
            lines: rates.collect(),
        },
        Curves {
            name: "cost of plans".into(),
            lines: vec![("cost".into(), costs)],
        },
    ]
}

/// Returns the cells at the surface of the mapped obstacles.
fn surface(field: &DistanceField) -> Points {
    let grid = field.grid();
    let near = grid.voxel * COARSE as f64;
    let steps = |axis: usize| (0..grid.cells[axis]).step_by(COARSE);
    let cells = steps(0).flat_map(|x| steps(1).flat_map(move |y| steps(2).map(move |z| [x, y, z])));
    Points {
        name: "map".into(),
        radius: (0.5 * near) as f32,
        places: cells
            .filter(|cell| (0.0..near).contains(&field.of_cell(*cell)))
            .map(|cell| grid.middle(cell).into())
            .collect(),
    }
}

/// Returns the bottom, the top and the upright edges of a box.
fn edges(of: &StandingBox) -> Vec<Vec<[f64; 3]>> {
    let (sin, cos) = of.turn.sin_cos();
    let corner = |number: usize, up: f64| {
        let [right, far] = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]][number % 4];
        let (x, y) = (right * of.size[0], far * of.size[1]);
        [
            of.middle[0] + cos * x - sin * y,
            of.middle[1] + sin * x + cos * y,
            of.middle[2] + up * of.size[2],
        ]
    };
    let round = |up: f64| (0..5).map(|number| corner(number, up)).collect();
    let mut strips = vec![round(-0.5), round(0.5)];
    strips.extend((0..4).map(|number| vec![corner(number, -0.5), corner(number, 0.5)]));
    strips
}
