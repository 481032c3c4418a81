//! Live catching and throwing back: one thread per process, on channels, in the simulated world.
#![allow(clippy::unwrap_used)]

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Scope;
use std::time::{Duration, Instant};

use tactnet_catching_roles::channels::{CATCH_OUTCOME, THROW_OUTCOME, THROW_STATE};
use tactnet_catching_roles::{Role, RoleSettings, catching_channels};
use tactnet_catching_stage::{WorldRole, WorldSettings};
use tactnet_channel::{Bus, Domain, Hub, Table, remove_bus};

/// Timeout of the test, far above its usual duration.
const PATIENCE: Duration = Duration::from_secs(120);

/// Starts the world and all processes of the stack that catches and throws.
fn start_all<'scope>(
    scope: &'scope Scope<'scope, '_>,
    table: &'scope Table,
    stopped: &'scope (impl Fn() -> bool + Sync),
) {
    scope.spawn(move || {
        let world = WorldRole {
            settings: WorldSettings {
                seed: 3,
                throw_back: true,
                ..WorldSettings::default()
            },
        };
        let bus = Bus::open(Domain::Host, table).unwrap();
        world.run(&bus, &|| (), stopped).unwrap();
    });
    for role in Role::ALL {
        if matches!(role, Role::Eyes | Role::Feel | Role::SlipWatch) {
            continue;
        }
        scope.spawn(move || {
            let bus = Bus::open(Domain::Host, table).unwrap();
            role.run(&bus, &|| (), stopped).unwrap();
        });
    }
}

#[test]
fn a_caught_ball_is_thrown_back_and_comes_down_near_its_target() {
    let mut stack = RoleSettings::default();
    stack.throw.at = Some([3.5, 0.0, 1.2]);
    let name = format!("throw-back{}", std::process::id());
    let table = stack.into_table(catching_channels(Table::new(&name), None));
    let hub = Hub::spawn(&table).unwrap();
    let stop = AtomicBool::new(false);
    let stopped = || stop.load(Ordering::Relaxed);
    let bus = Bus::open(Domain::Host, &table).unwrap();
    let outcomes = CATCH_OUTCOME.get(&bus).unwrap();
    let states = THROW_STATE.get(&bus).unwrap();
    let backs = THROW_OUTCOME.get(&bus).unwrap();
    let (mut caught, mut thrown, mut failed) = (0, Vec::new(), Vec::new());
    std::thread::scope(|scope| {
        start_all(scope, &table, &stopped);
        let begun = Instant::now();
        let mut reasons = 0;
        while thrown.is_empty() && begun.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(10));
            while let Some(packet) = outcomes.try_get().unwrap() {
                caught += packet.iter().filter(|outcome| outcome.caught == 1).count();
            }
            while let Some(packet) = states.try_get().unwrap() {
                for status in packet.iter() {
                    if status.failed > reasons {
                        failed.push(status.reason.as_str().to_string());
                    }
                    reasons = status.failed;
                }
            }
            while let Some(packet) = backs.try_get().unwrap() {
                thrown.extend(packet.iter().copied());
            }
        }
        println!("{:?}", begun.elapsed());
        stop.store(true, Ordering::Relaxed);
    });
    println!("{caught} {failed:?} {thrown:?}");
    let back = thrown.first().expect("thrown back");
    assert!(caught >= 1, "before it was thrown: {failed:?}");
    assert_eq!(back.target, [3.5, 0.0, 1.2]);
    // Half a millisecond of jitter.
    assert!(back.left_ns.abs_diff(back.open_ns) < 3_000_000, "{back:?}");
    assert!(back.miss < 0.8, "{back:?}");
    drop((outcomes, states, backs, bus, hub));
    remove_bus(&table).unwrap();
}
