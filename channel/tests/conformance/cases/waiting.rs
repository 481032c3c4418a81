//! Sync groups and wake-ups.

use std::time::{Duration, Instant};

use tactnet_channel::{ChannelConfig, Priority, Start, Wait};

use super::{Reading, getter, normal, numbers, putter, reading, wait_for};
use crate::world::{SOON, World};

fn group_of(ports: usize, world: &World) {
    let names: Vec<String> = (0..ports).map(|number| format!("c{number}")).collect();
    let small = ChannelConfig {
        get_ports: 1,
        depth: 2,
        held: 1,
        ..normal()
    };
    let channels: Vec<(&str, ChannelConfig)> = names
        .iter()
        .map(|name| (name.as_str(), small.clone()))
        .collect();
    let ends = world.with(&channels);
    let gets: Vec<_> = names
        .iter()
        .map(|name| {
            ends.far
                .get_port::<Reading>(name.as_str(), Start::Now)
                .unwrap()
        })
        .collect();
    let sides: Vec<&dyn tactnet_channel::GetSide> = gets.iter().map(|get| get as _).collect();
    let mut group = ends.far.sync_group(&sides).unwrap();
    let puts: Vec<_> = names
        .iter()
        .map(|name| {
            ends.near
                .put_port::<Reading>(name.as_str(), Priority::Normal)
                .unwrap()
        })
        .collect();
    ends.settle();
    let begun = Instant::now();
    let none = group
        .wait(Wait::Block {
            timeout: Duration::from_millis(30),
        })
        .unwrap();
    assert_eq!(none, None);
    assert!(begun.elapsed() >= Duration::from_millis(30));
    for number in [0, ports - 1, ports / 2] {
        // The put happens while the group sleeps.
        std::thread::scope(|scope| {
            let put = &puts[number];
            scope.spawn(move || {
                std::thread::sleep(Duration::from_millis(30));
                put.put_copy(&[reading(number as u64)]).unwrap();
            });
            let found = group.wait(SOON).unwrap();
            assert_eq!(found, Some(number));
        });
        assert_eq!(numbers(&gets[number]), [number as u64]);
    }
    assert!(
        begun.elapsed() < Duration::from_secs(15),
        "it was woken, not timed out"
    );
}

pub fn a_sync_group_finds_the_port_that_has_a_packet(world: &World) {
    group_of(5, world);
}

pub fn a_large_group_is_woken_too(world: &World) {
    // More ports than one kernel call can wait for.
    group_of(131, world);
    // Only its own bus wakes a group.
    let of_many = ChannelConfig {
        get_ports: 129,
        ..normal()
    };
    let [own, other] = [(); 2].map(|()| world.with(&[("a", of_many.clone())]));
    let mut ports: Vec<_> = (0..128)
        .map(|_| own.far.get_port::<Reading>("a", Start::Now).unwrap())
        .collect();
    ports.push(other.far.get_port("a", Start::Now).unwrap());
    let sides: Vec<&dyn tactnet_channel::GetSide> = ports.iter().map(|port| port as _).collect();
    let mixed = own.far.sync_group(&sides).unwrap_err();
    assert!(mixed.to_string().contains("from one bus"), "{mixed}");
    own.far.sync_group(&sides[1..]).unwrap();
}

pub fn a_busy_port_does_not_starve_the_group(world: &World) {
    let ends = world.with(&[
        (
            "busy",
            ChannelConfig {
                depth: 64,
                ..normal()
            },
        ),
        ("calm", normal()),
    ]);
    let busy = getter(&ends.far, "busy");
    let calm = getter(&ends.far, "calm");
    let mut group = ends.far.sync_group(&[&busy, &calm]).unwrap();
    let put = putter(&ends.near, "busy");
    let seldom = putter(&ends.near, "calm");
    ends.settle();
    for number in 0..50 {
        put.put_copy(&[reading(number)]).unwrap();
    }
    seldom.put_copy(&[reading(99)]).unwrap();
    std::thread::sleep(ends.travel / 5);
    let mut turns = 0;
    while group.wait(SOON).unwrap() != Some(1) {
        drop(busy.try_get().unwrap());
        turns += 1;
        assert!(turns < 3, "the calm port has its turn");
    }
    assert!(ends.far.sync_group(&[]).is_err());
}

pub fn blocking_gets_wake_up_and_time_out(world: &World) {
    let ends = world.with(&[("a", normal())]);
    let get = getter(&ends.far, "a");
    let put = putter(&ends.near, "a");
    ends.settle();
    let begun = Instant::now();
    let timeout = Duration::from_millis(30);
    assert!(get.get(Wait::Block { timeout }).unwrap().is_none());
    assert!(begun.elapsed() >= timeout);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(30));
            put.put_copy(&[reading(1)]).unwrap();
        });
        assert_eq!(wait_for(&get, 1), [1]);
    });
    assert!(
        begun.elapsed() < Duration::from_secs(15),
        "it was woken, not timed out"
    );
    put.put_copy(&[reading(2)]).unwrap();
    assert_eq!(get.get(Wait::Spin).unwrap().unwrap()[0].number, 2);
}

pub fn no_wake_up_is_lost(world: &World) {
    const ROUNDS: u64 = 2000;
    let ends = world.with(&[("there", normal()), ("back", normal())]);
    let there = putter(&ends.near, "there");
    let back = getter(&ends.near, "back");
    let (got, answer) = (getter(&ends.far, "there"), putter(&ends.far, "back"));
    ends.settle();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for _ in 0..ROUNDS {
                let begun = Instant::now();
                let number = wait_for(&got, 1)[0];
                // A lost wake-up appears as a packet that is found only after the timeout.
                assert!(begun.elapsed() < Duration::from_secs(15));
                answer.put_copy(&[reading(number)]).unwrap();
            }
        });
        for number in 0..ROUNDS {
            let begun = Instant::now();
            there.put_copy(&[reading(number)]).unwrap();
            assert_eq!(wait_for(&back, 1), [number]);
            assert!(begun.elapsed() < Duration::from_secs(15));
        }
    });
}
