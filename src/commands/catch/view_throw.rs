//! One throw of a series in the Rerun viewer: the robot as capsules, balls, joint rates, costs of plans.

use tactnet_catching::flight::BALL_RADIUS;
use tactnet_catching_packets::{ARMS, joint};
use tactnet_catching_trials::{Series, SeriesReport, Trace, TraceTick};
use tactnet_recording::view::{Ball, Capsule, Curves, Motion, Target, show_motion};

/// Every so many ticks of 1 ms are shown.
const EVERY: usize = 4;

/// Shows the throw that a page would draw.
///
/// - `target`: a file, or the address of a viewer that runs; without it a viewer is started
pub fn view(series: &Series, report: &SeriesReport, target: Option<&str>) -> anyhow::Result<()> {
    let target = match target {
        None => Target::Viewer {
            memory_limit: "2GB".into(),
        },
        Some(url) if url.contains("://") => Target::Connect { url: url.into() },
        Some(path) => Target::File { path: path.into() },
    };
    if let Some((number, trace)) = series.drawn(report)? {
        show_motion(&target, &format!("throw {number}"), &motion(&trace))?;
    }
    Ok(())
}

fn motion(trace: &Trace) -> Motion {
    let ticks: Vec<&TraceTick> = trace.ticks.iter().step_by(EVERY).collect();
    let time_ns = |t: f64| (t * 1e9).round() as i64;
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
    let balls = (0..2)
        .filter(|ball| ticks.iter().any(|tick| tick.balls[*ball].is_some()))
        .map(|ball| Ball {
            name: format!("{}", ball + 1),
            radius: BALL_RADIUS as f32,
            places: ticks
                .iter()
                .map(|tick| tick.balls[ball].map(|p| p.into()))
                .collect(),
        })
        .collect();
    // The arm that catches, or the left one.
    let arm = trace.plans.last().map_or(0, |plan| plan.arm);
    let rates = joint::ARM[arm].clone().enumerate().map(|(i, index)| {
        let rates = ticks
            .iter()
            .map(|tick| (time_ns(tick.t), tick.measured[index]));
        (format!("joint {}", i + 1), rates.collect())
    });
    let costs = trace.plans.iter().filter(|plan| plan.arm == arm);
    let costs = costs.map(|plan| (time_ns(plan.t), plan.cost)).collect();
    Motion {
        times_ns: ticks.iter().map(|tick| time_ns(tick.t)).collect(),
        capsules,
        balls,
        curves: vec![
            Curves {
                name: "joint rates, rad/s".into(),
                lines: rates.collect(),
            },
            Curves {
                name: "cost of plans".into(),
                lines: vec![("cost".into(), costs)],
            },
        ],
    }
}
