//! Promises of section 2.2 of the thesis: order, fairness, priorities, losses, own channels.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tactnet_channel::{
    Bus, ChannelConfig, ChannelError, ChannelId, GetPort, Priority, PutPort, Start, Wait,
};

use super::{Reading, getter, normal, numbers, putter, reading, wait_for};
use crate::world::{SOON, World};

fn shared(put_ports: usize, depth: usize) -> ChannelConfig {
    ChannelConfig {
        put_ports,
        depth,
        ..normal()
    }
}

fn putter_of(bus: &Bus, priority: Priority) -> PutPort<Reading> {
    bus.put_port("a", priority).unwrap()
}

/// Stops a thread, also when the test fails.
struct StopAtTheEnd<'a>(&'a AtomicBool);

impl Drop for StopAtTheEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Gets packets until none has come for a while, and returns their numbers.
fn all_numbers(port: &GetPort<Reading>) -> Vec<u64> {
    let wait = Wait::Block {
        timeout: Duration::from_millis(200),
    };
    std::iter::from_fn(|| port.get(wait).unwrap().map(|packet| packet[0].number)).collect()
}

pub fn packets_of_all_put_ports_arrive_in_the_order_of_their_puts(world: &World) {
    let ends = world.with(&[("a", shared(3, 64))]);
    let gets = [getter(&ends.near, "a"), getter(&ends.far, "a")];
    let puts = [(); 3].map(|()| putter(&ends.near, "a"));
    ends.settle();
    for number in 0..45 {
        // Port 2 starts, port 0 stops, as in the report.
        puts[2 - number as usize % 3]
            .put_copy(&[reading(number)])
            .unwrap();
    }
    for get in gets {
        assert_eq!(wait_for(&get, 45), (0..45).collect::<Vec<_>>());
        assert_eq!(get.lost(), 0);
    }
}

pub fn a_late_getter_gets_the_history_of_all_put_ports_in_order(world: &World) {
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            history: 8,
            ..shared(2, 16)
        },
    )]);
    let puts = [(); 2].map(|()| putter(&ends.near, "a"));
    for number in 0..12 {
        puts[number as usize % 2]
            .put_copy(&[reading(number)])
            .unwrap();
    }
    let late = ends
        .near
        .get_port::<Reading>("a", Start::History(6))
        .unwrap();
    // At once, and also where only one of the put-ports goes on.
    assert_eq!(numbers(&late), (0..12).collect::<Vec<_>>());
    let later = ends
        .near
        .get_port::<Reading>("a", Start::History(2))
        .unwrap();
    puts[0].put_copy(&[reading(12)]).unwrap();
    assert_eq!(numbers(&later), (8..13).collect::<Vec<_>>());
    assert_eq!(numbers(&late), [12]);
    assert_eq!((late.lost(), later.lost()), (0, 0));
}

pub fn a_history_read_during_puts_has_no_gap(world: &World) {
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            history: 4,
            get_ports: 2,
            // Deep enough for a while without the getter, on a busy machine.
            ..shared(1, 4096)
        },
    )]);
    let put = putter(&ends.near, "a");
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for number in 0.. {
                put.put_copy(&[reading(number); 4]).unwrap();
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                std::thread::sleep(Duration::from_micros(200));
            }
        });
        let _stop = StopAtTheEnd(&stop);
        for _ in 0..25 {
            let late = ends
                .near
                .get_port::<Reading>("a", Start::History(4))
                .unwrap();
            let first = wait_for(&late, 1)[0];
            for number in first + 1..first + 12 {
                let packet = late.get(SOON).unwrap().unwrap();
                assert_eq!(packet[3], reading(number), "lost {}", late.lost());
                assert_eq!(packet[0], packet[3]);
            }
        }
    });
}

pub fn order_holds_between_put_ports_of_two_threads(world: &World) {
    const PACKETS: u64 = 3000;
    let ends = world.with(&[("a", shared(2, PACKETS as usize))]);
    let get = getter(&ends.near, "a");
    let puts = [(); 2].map(|()| putter(&ends.near, "a"));
    ends.settle();
    // A put ends before the next one begins, in whichever thread.
    let next = Mutex::new(0);
    std::thread::scope(|scope| {
        for put in &puts {
            let next = &next;
            scope.spawn(move || {
                loop {
                    let mut next = next.lock().unwrap();
                    if *next == PACKETS {
                        break;
                    }
                    put.put_copy(&[reading(*next)]).unwrap();
                    *next += 1;
                }
            });
        }
        let mut found = Vec::new();
        while found.len() < PACKETS as usize {
            found.push(get.get(SOON).unwrap().unwrap()[0].number);
        }
        assert!(found.is_sorted(), "{found:?}");
    });
}

pub fn a_bulk_sender_that_connected_first_starves_nobody(world: &World) {
    // Deep enough for all other packets, on however busy a machine.
    let ends = world.with(&[("a", shared(2, 128))]);
    let get = getter(&ends.near, "a");
    let (bulk, other) = (putter(&ends.near, "a"), putter(&ends.near, "a"));
    ends.settle();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !stop.load(Ordering::Relaxed) {
                bulk.put_copy(&[reading(0)]).unwrap();
            }
        });
        scope.spawn(|| {
            for number in 1..=100 {
                std::thread::sleep(Duration::from_millis(2));
                other.put_copy(&[reading(number)]).unwrap();
            }
        });
        let stop = StopAtTheEnd(&stop);
        let mut found = Vec::new();
        let begun = Instant::now();
        while found.len() < 100 && begun.elapsed() < Duration::from_secs(20) {
            let number = get.get(SOON).unwrap().unwrap()[0].number;
            found.extend((number > 0).then_some(number));
            let busy = Instant::now();
            while busy.elapsed() < Duration::from_micros(30) {}
        }
        drop(stop);
        assert_eq!(found, (1..=100).collect::<Vec<_>>());
    });
}

pub fn losses_count_from_the_opening_and_the_putter_knows_them(world: &World) {
    let ends = world.with(&[("a", shared(2, 4))]);
    // Both on one host: in the distributed domain, several rings can lose packets.
    let slow = getter(&ends.near, "a");
    let put = putter(&ends.near, "a");
    let fast = getter(&ends.near, "a");
    for number in 0..10 {
        put.put_copy(&[reading(number)]).unwrap();
        assert_eq!(wait_for(&fast, 1), [number]);
    }
    assert_eq!(slow.lost(), 6, "before its first look");
    assert_eq!(numbers(&slow), [6, 7, 8, 9]);
    assert_eq!((slow.lost(), fast.lost()), (6, 0));
    let losses = put.losses();
    let of_slow = losses.iter().find(|loss| loss.getter == slow.number());
    assert_eq!(of_slow.unwrap().packets, 6);
    assert!(losses.iter().all(|loss| loss.getter != fast.number()));
}

pub fn packets_of_a_closed_put_port_arrive(world: &World) {
    let ends = world.with(&[("a", shared(1, 16))]);
    let get = getter(&ends.far, "a");
    ends.settle();
    for first in [0, 3] {
        let put = putter(&ends.near, "a");
        for number in first..first + 3 {
            put.put_copy(&[reading(number)]).unwrap();
        }
        drop(put);
    }
    let found = wait_for(&get, if ends.is_distributed() { 6 } else { 3 });
    if ends.is_distributed() {
        assert_eq!(found, [0, 1, 2, 3, 4, 5]);
    } else {
        // One closed port is kept for each put-port of the channel; the older one was overwritten.
        assert_eq!((found, get.lost()), (vec![3, 4, 5], 3));
    }
    // A sync group wakes for such packets, too.
    let mut group = ends.far.sync_group(&[&get]).unwrap();
    putter(&ends.near, "a").put_copy(&[reading(6)]).unwrap();
    assert_eq!(group.wait(SOON).unwrap(), Some(0));
    let packet = get.get(SOON).unwrap().unwrap();
    assert_eq!(*packet, [reading(6)]);
    assert_eq!(packet.header().sequence, 0);
}

pub fn what_a_closed_port_had_lost_is_counted(world: &World) {
    let ends = world.with(&[("a", shared(2, 4))]);
    let get = getter(&ends.near, "a");
    let first = putter(&ends.near, "a");
    let second = putter(&ends.near, "a");
    for number in 0..10 {
        let port = [&first, &second][number as usize % 2];
        port.put_copy(&[reading(number)]).unwrap();
    }
    drop((first, second));
    assert_eq!(all_numbers(&get), [2, 3, 4, 5, 6, 7, 8, 9]);
    assert_eq!(get.lost(), 2);
    assert!(get.try_get().unwrap().is_none(), "nothing twice");
}

pub fn urgent_packets_overtake_waiting_bulk(world: &World) {
    let ends = world.with(&[("a", shared(2, 32))]);
    let get = getter(&ends.far, "a");
    let bulk = putter_of(&ends.near, Priority::Bulk);
    let urgent = putter_of(&ends.near, Priority::RealTime);
    ends.settle();
    for number in 0..20 {
        bulk.put_copy(&[reading(number)]).unwrap();
    }
    urgent.put_copy(&[reading(100)]).unwrap();
    std::thread::sleep(ends.travel / 5);
    assert_eq!(wait_for(&get, 2), [100, 0]);
    urgent.put_copy(&[reading(101)]).unwrap();
    std::thread::sleep(ends.travel / 5);
    assert_eq!(wait_for(&get, 2), [101, 1]);
}

pub fn bulk_displaces_no_urgent_packet(world: &World) {
    let ends = world.with(&[("a", shared(2, 4))]);
    let get = getter(&ends.near, "a");
    let urgent = putter_of(&ends.near, Priority::High);
    let bulk = putter_of(&ends.near, Priority::Bulk);
    ends.settle();
    for number in 0..4 {
        urgent.put_copy(&[reading(100 + number)]).unwrap();
    }
    for number in 0..50 {
        bulk.put_copy(&[reading(number)]).unwrap();
    }
    let found = numbers(&get);
    assert_eq!(found, [100, 101, 102, 103, 46, 47, 48, 49]);
    assert_eq!(get.lost(), 46);
}

pub fn a_sync_group_names_the_urgent_port_first(world: &World) {
    let ends = world.with(&[("a", normal()), ("b", normal())]);
    let gets = ["a", "b"].map(|channel| getter(&ends.near, channel));
    gets[1].set_priority(Priority::RealTime);
    let mut group = ends.near.sync_group(&[&gets[0], &gets[1]]).unwrap();
    let puts = ["a", "b"].map(|channel| putter(&ends.near, channel));
    for _ in 0..3 {
        for put in &puts {
            put.put_copy(&[reading(1)]).unwrap();
        }
    }
    let mut named = Vec::new();
    while let Some(port) = group
        .wait(Wait::Block {
            timeout: Duration::ZERO,
        })
        .unwrap()
    {
        drop(gets[port].try_get().unwrap());
        named.push(port);
    }
    assert_eq!(named, [1, 1, 1, 0, 0, 0]);
}

pub fn a_channel_can_be_created_at_run_time(world: &World) {
    let ends = world.with(&[("where", ChannelConfig::of::<ChannelId>(1))]);
    // Such channels are on one host.
    let (creator, other) = if ends.is_distributed() {
        (ends.near.clone(), ends.near.clone())
    } else {
        (ends.near.clone(), ends.far.clone())
    };
    let told = other.get_port::<ChannelId>("where", Start::Now).unwrap();
    let tell = creator
        .put_port::<ChannelId>("where", Priority::Normal)
        .unwrap();
    let id = creator.create_channel("own/reply", shared(2, 16)).unwrap();
    let again = creator.create_channel(id, normal()).unwrap_err();
    assert!(
        matches!(again, ChannelError::ChannelExists { .. }),
        "{again}"
    );
    let distributed = ChannelConfig {
        distributed: true,
        ..normal()
    };
    let refused = creator.create_channel("b", distributed).unwrap_err();
    assert!(refused.to_string().contains("other hosts"), "{refused}");
    tell.put_copy(&[id]).unwrap();
    let id = told.get(SOON).unwrap().unwrap()[0];
    let get = getter(&other, id);
    let put = creator.put_port::<Reading>(id, Priority::Normal).unwrap();
    put.put_copy(&[reading(7)]).unwrap();
    assert_eq!(wait_for(&get, 1), [7]);
    let unknown = other.get_port::<Reading>("b", Start::Now).unwrap_err();
    assert!(
        matches!(unknown, ChannelError::NoSuchChannel { .. }),
        "{unknown}"
    );
}
