//! What every domain must do.

use std::time::{Duration, Instant};

use bytemuck::{Pod, Zeroable};
use tactnet_channel::{
    ChannelConfig, ChannelError, ChannelId, GetPort, Packet, Priority, Start, Wait, now_ns,
};

use crate::world::{SOON, World};

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct Reading {
    number: u64,
    taxels: [f32; 16],
}

impl Packet for Reading {
    const NAME: &'static str = "Reading";
    const VERSION: u32 = 3;
}

fn reading(number: u64) -> Reading {
    Reading {
        number,
        taxels: [number as f32; 16],
    }
}

/// The numbers of all packets that are there.
fn numbers(port: &GetPort<Reading>) -> Vec<u64> {
    std::iter::from_fn(|| port.try_get().unwrap().map(|packet| packet[0].number)).collect()
}

/// The numbers of `packets` packets, waited for.
fn wait_for(port: &GetPort<Reading>, packets: usize) -> Vec<u64> {
    (0..packets)
        .map(|k| {
            port.get(SOON)
                .unwrap()
                .unwrap_or_else(|| panic!("packet {k} comes"))[0]
                .number
        })
        .collect()
}

fn normal() -> ChannelConfig {
    ChannelConfig::of::<Reading>(4)
}

pub fn packets_of_a_sender_arrive_in_their_order(world: &World) {
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            depth: 2000,
            ..normal()
        },
    )]);
    let get = ends.far.get_port::<Reading>("a", Start::Now).unwrap();
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::Normal)
        .unwrap();
    ends.settle();
    for number in 0..1000 {
        let mut packet = put.loan(2).unwrap();
        packet.copy_from_slice(&[reading(number), reading(number + 7)]);
        put.put(packet).unwrap();
    }
    for number in 0..1000 {
        let packet = get.get(SOON).unwrap().unwrap();
        assert_eq!(&*packet, [reading(number), reading(number + 7)]);
        assert_eq!(packet.header().sequence, number);
    }
    assert_eq!(get.lost(), 0);
}

pub fn every_getter_gets_every_packet_of_every_putter(world: &World) {
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            put_ports: 3,
            get_ports: 4,
            depth: 64,
            ..normal()
        },
    )]);
    let gets: Vec<_> = [&ends.near, &ends.far, &ends.far]
        .map(|bus| bus.get_port::<Reading>("a", Start::Now).unwrap())
        .into();
    let puts: Vec<_> = [&ends.near, &ends.far, &ends.near]
        .map(|bus| bus.put_port::<Reading>("a", Priority::Normal).unwrap())
        .into();
    ends.settle();
    for number in 0..10 {
        for (sender, put) in puts.iter().enumerate() {
            put.put_copy(&[reading(100 * sender as u64 + number)])
                .unwrap();
        }
    }
    for get in &gets {
        let mut found = wait_for(get, 30);
        std::thread::sleep(ends.travel / 10);
        assert_eq!(
            get.try_get().unwrap().map(|packet| packet[0].number),
            None,
            "nothing twice"
        );
        for sender in 0..3 {
            let of_sender: Vec<u64> = found
                .iter()
                .copied()
                .filter(|n| n / 100 == sender)
                .collect();
            assert!(of_sender.is_sorted(), "{of_sender:?}");
        }
        found.sort_unstable();
        let expected: Vec<u64> = (0..3)
            .flat_map(|sender| (0..10).map(move |n| 100 * sender + n))
            .collect();
        assert_eq!(found, expected);
    }
}

pub fn a_late_joiner_gets_the_history_it_asks_for(world: &World) {
    // History is kept where the putter is.
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            history: 5,
            ..normal()
        },
    )]);
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::Normal)
        .unwrap();
    for number in 0..9 {
        put.put_copy(&[reading(number)]).unwrap();
    }
    let three = ends
        .near
        .get_port::<Reading>("a", Start::History(3))
        .unwrap();
    let five = ends
        .near
        .get_port::<Reading>("a", Start::History(5))
        .unwrap();
    put.send_history().unwrap();
    assert_eq!(wait_for(&three, 3), [6, 7, 8]);
    assert_eq!(numbers(&five), [4, 5, 6, 7, 8]);
    put.put_copy(&[reading(9)]).unwrap();
    assert_eq!((numbers(&three), numbers(&five)), (vec![9], vec![9]));
    assert_eq!(three.lost(), 0);
    let error = ends
        .far
        .get_port::<Reading>("a", Start::History(6))
        .unwrap_err();
    assert!(
        matches!(
            error,
            ChannelError::History {
                most: 5,
                found: 6,
                ..
            }
        ),
        "{error}"
    );
}

pub fn who_starts_now_gets_nothing_old(world: &World) {
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            history: 5,
            ..normal()
        },
    )]);
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::Normal)
        .unwrap();
    put.put_copy(&[reading(1)]).unwrap();
    let get = ends.near.get_port::<Reading>("a", Start::Now).unwrap();
    put.put_copy(&[reading(2)]).unwrap();
    assert_eq!(wait_for(&get, 1), [2]);
}

pub fn a_full_ring_keeps_the_newest_and_counts_the_loss(world: &World) {
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            depth: 4,
            ..normal()
        },
    )]);
    // In the distributed domain every ring on the way may lose some; the near end shows this one alone.
    let get = ends.near.get_port::<Reading>("a", Start::Now).unwrap();
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::Normal)
        .unwrap();
    ends.settle();
    put.put_copy(&[reading(0)]).unwrap();
    assert_eq!(wait_for(&get, 1), [0]);
    for number in 1..=10 {
        put.put_copy(&[reading(number)]).unwrap();
    }
    assert_eq!(numbers(&get), [7, 8, 9, 10]);
    assert_eq!(get.lost(), 6);
}

pub fn packets_that_are_too_large_are_refused(world: &World) {
    let ends = world.with(&[("a", normal())]);
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::Normal)
        .unwrap();
    let error = put.loan(5).unwrap_err();
    assert_eq!(
        error.to_string(),
        "channel `a`: expected at most 4 items in a packet, found 5"
    );
    // Largest and empty packets travel.
    let get = ends.far.get_port::<Reading>("a", Start::Now).unwrap();
    ends.settle();
    put.put_copy(&[reading(1); 4]).unwrap();
    put.put_copy(&[]).unwrap();
    assert_eq!(get.get(SOON).unwrap().unwrap().len(), 4);
    assert_eq!(get.get(SOON).unwrap().unwrap().len(), 0);
}

pub fn ports_of_another_type_are_refused(world: &World) {
    #[repr(C)]
    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    struct Newer(Reading);
    impl Packet for Newer {
        const NAME: &'static str = "Reading";
        const VERSION: u32 = 4;
    }
    let ends = world.with(&[("a", normal())]);
    let put = ends
        .near
        .put_port::<f32>("a", Priority::Normal)
        .unwrap_err();
    assert_eq!(
        put.to_string(),
        "channel `a`: expected packets of `Reading` version 3 of 72 bytes, found `f32` version 1 of 4 bytes"
    );
    let get = ends.far.get_port::<Newer>("a", Start::Now).unwrap_err();
    assert!(
        get.to_string().contains("found `Reading` version 4"),
        "{get}"
    );
    let none = ends.far.get_port::<Newer>("b", Start::Now).unwrap_err();
    assert!(matches!(none, ChannelError::NoSuchChannel { .. }), "{none}");
}

pub fn ports_beyond_the_table_are_refused_until_one_is_dropped(world: &World) {
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            put_ports: 1,
            get_ports: 2,
            ..normal()
        },
    )]);
    let open = || ends.near.put_port::<Reading>("a", Priority::Normal);
    // The hub has a place of its own in a distributed channel, which it may not have taken yet.
    let mut puts: Vec<_> = std::iter::from_fn(|| open().ok()).take(5).collect();
    assert!((1..=2).contains(&puts.len()), "{}", puts.len());
    let error = open().unwrap_err();
    assert_eq!(error.to_string(), "channel `a`: all 1 put-ports are taken");
    puts.pop();
    puts.push(open().unwrap());
    let open = || ends.near.get_port::<Reading>("a", Start::Now);
    let gets: Vec<_> = std::iter::from_fn(|| open().ok()).take(5).collect();
    assert!((2..=3).contains(&gets.len()), "{}", gets.len());
    let error = open().unwrap_err();
    assert_eq!(error.to_string(), "channel `a`: all 2 get-ports are taken");
}

pub fn a_packet_outlives_its_ports(world: &World) {
    let ends = world.with(&[("a", normal())]);
    let get = ends.far.get_port::<Reading>("a", Start::Now).unwrap();
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::Normal)
        .unwrap();
    ends.settle();
    put.put_copy(&[reading(5)]).unwrap();
    let packet = get.get(SOON).unwrap().unwrap();
    drop(put);
    drop(get);
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::Normal)
        .unwrap();
    put.put_copy(&[reading(6)]).unwrap();
    assert_eq!(packet[0], reading(5));
}

pub fn more_packets_than_allowed_cannot_be_held_or_loaned(world: &World) {
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            held: 2,
            loaned: 1,
            ..normal()
        },
    )]);
    let get = ends.far.get_port::<Reading>("a", Start::Now).unwrap();
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::Normal)
        .unwrap();
    ends.settle();
    for number in 0..4 {
        put.put_copy(&[reading(number)]).unwrap();
    }
    let first = get.get(SOON).unwrap().unwrap();
    let _second = get.get(SOON).unwrap().unwrap();
    std::thread::sleep(ends.travel / 10);
    let error = get.try_get().unwrap_err();
    assert_eq!(
        error.to_string(),
        "channel `a`: 2 packets are held at this port; put or drop one first"
    );
    drop(first);
    assert_eq!(wait_for(&get, 1), [2]);
    let loan = put.loan(1).unwrap();
    let error = put.loan(1).unwrap_err();
    assert!(
        error.to_string().contains("1 packets are loaned"),
        "{error}"
    );
    drop(loan);
    put.loan(1).unwrap();
}

pub fn an_id_can_be_sent_over_a_channel(world: &World) {
    let ends = world.with(&[
        ("where", ChannelConfig::of::<ChannelId>(1)),
        ("there", normal()),
    ]);
    let get = ends.far.get_port::<ChannelId>("where", Start::Now).unwrap();
    let tell = ends
        .near
        .put_port::<ChannelId>("where", Priority::Normal)
        .unwrap();
    let put = ends
        .near
        .put_port::<Reading>("there", Priority::Normal)
        .unwrap();
    ends.settle();
    tell.put_copy(&[put.id()]).unwrap();
    let id = get.get(SOON).unwrap().unwrap()[0];
    let there = ends.far.get_port::<Reading>(id, Start::Now).unwrap();
    ends.settle();
    put.put_copy(&[reading(3)]).unwrap();
    assert_eq!(wait_for(&there, 1), [3]);
}

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
        // The put comes while the group sleeps.
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
    // More than the kernel sleeps on at once.
    group_of(131, world);
    // It is woken by its own bus alone.
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
    let busy = ends.far.get_port::<Reading>("busy", Start::Now).unwrap();
    let calm = ends.far.get_port::<Reading>("calm", Start::Now).unwrap();
    let mut group = ends.far.sync_group(&[&busy, &calm]).unwrap();
    let put = ends
        .near
        .put_port::<Reading>("busy", Priority::Normal)
        .unwrap();
    let seldom = ends
        .near
        .put_port::<Reading>("calm", Priority::Normal)
        .unwrap();
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
    let get = ends.far.get_port::<Reading>("a", Start::Now).unwrap();
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::Normal)
        .unwrap();
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
    let there = ends
        .near
        .put_port::<Reading>("there", Priority::Normal)
        .unwrap();
    let back = ends.near.get_port::<Reading>("back", Start::Now).unwrap();
    let (got, answer) = (
        ends.far.get_port::<Reading>("there", Start::Now).unwrap(),
        ends.far
            .put_port::<Reading>("back", Priority::Normal)
            .unwrap(),
    );
    ends.settle();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for _ in 0..ROUNDS {
                let begun = Instant::now();
                let number = wait_for(&got, 1)[0];
                // A lost wake-up shows as a packet that is found only when the wait has ended.
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

pub fn priorities_and_times_come_with_the_packet(world: &World) {
    let ends = world.with(&[("a", normal())]);
    let get = ends.far.get_port::<Reading>("a", Start::Now).unwrap();
    let put = ends
        .near
        .put_port::<Reading>("a", Priority::RealTime)
        .unwrap();
    ends.settle();
    let before = now_ns();
    put.put_copy(&[reading(1)]).unwrap();
    let packet = get.get(SOON).unwrap().unwrap();
    assert_eq!(packet.header().priority, Priority::RealTime as u8);
    assert_eq!(packet.header().bytes, 72);
    assert!((before..=now_ns()).contains(&packet.header().put_ns));
}
