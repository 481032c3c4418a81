use tactnet_catching::Robot;
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_trials::*;
use tactnet_catching_world::WorldConfig;

fn main() {
    let arg = |i: usize| std::env::args().nth(i);
    let config: ThrowBenchConfig = arg(3)
        .map(|t| serde_json::from_str(&t).unwrap())
        .unwrap_or_default();
    let bench = ThrowBench {
        config,
        robot: Robot::new(RobotDescription::nominal()),
        world: WorldConfig::default(),
        timing: Timing::ours(),
        throws: arg(1).unwrap().parse().unwrap(),
        seed: arg(2).unwrap().parse().unwrap(),
    };
    if arg(4).is_some() {
        println!(
            "{}",
            serde_json::to_string(&peer_throws(&bench.robot, bench.seed, bench.throws).unwrap())
                .unwrap()
        );
        return;
    }
    let t = std::time::Instant::now();
    let report = bench.run(|| ()).unwrap();
    println!("{}", serde_json::to_string_pretty(&report).unwrap());
    eprintln!("{:?}", t.elapsed());
}
