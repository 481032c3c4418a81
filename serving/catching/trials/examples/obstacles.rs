fn main() {
    use tactnet_catching::Robot;
    use tactnet_catching_packets::RobotDescription;
    use tactnet_catching_trials::*;
    use tactnet_catching_world::{ObstaclesConfig, WorldConfig};
    let arguments: Vec<String> = std::env::args().collect();
    let mut config = ThrowConfig {
        robot: Robot::new(RobotDescription::nominal()),
        world: Default::default(),
        timing: Timing::ours(),
        without: vec![],
        balls: 1,
        mapping: Mapping::Off,
        perfect_perception: false,
        pixels: false,
        watch: true,
        closing_error: 0.0,
    };
    if arguments[1] == "baseline" {
        for (balls, throws) in [(1, 40), (2, 20)] {
            config.balls = balls;
            let report = Series {
                config: config.clone(),
                throws,
                seed: 7,
            }
            .run(|| ())
            .unwrap();
            println!("{}", serde_json::to_string(&report).unwrap());
            for outcome in &report.outcomes {
                println!("{outcome:?}");
            }
        }
        return;
    }
    config.world = WorldConfig {
        obstacles: ObstaclesConfig::table_and_box(),
        ..Default::default()
    };
    config.mapping = Mapping::Depth;
    config.watch = false;
    if arguments[3] == "blind" { config.mapping = Mapping::Blind; }
    let series = Series {
        config,
        throws: arguments[1].parse().unwrap(),
        seed: arguments[2].parse().unwrap(),
    };
    let report = if arguments[3] == "both" {
        series.run_with_and_without_map(|| ())
    } else {
        series.run(|| ())
    }
    .unwrap();
    println!("{}", serde_json::to_string_pretty(&report).unwrap());
    for outcome in &report.outcomes {
        let o = outcome.obstacles.unwrap();
        eprintln!(
            "{} caught {:?} no_plans {} obstr {} up {} contacts {:?} {:?} plan {:?} look {:.0}",
            outcome.number,
            outcome
                .balls
                .iter()
                .map(|b| (b.caught(), b.arms))
                .collect::<Vec<_>>(),
            outcome.no_plans,
            o.obstructed,
            o.arms_held_up,
            o.contacts.ticks,
            o.contacts.deepest,
            o.plan_seconds,
            o.look_seconds * 1e3
        );
    }
}
