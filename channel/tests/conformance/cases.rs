//! Requirements on every domain.

mod limits;
mod promises;
mod waiting;

use bytemuck::{Pod, Zeroable};
use tactnet_channel::{
    AsChannelId, Bus, ChannelConfig, ChannelError, ChannelId, GetPort, Packet, Priority, PutPort,
    Start, now_ns,
};

use crate::world::{SOON, World};

pub use limits::{
    a_packet_outlives_its_ports, more_packets_than_allowed_cannot_be_held_or_loaned,
    packets_that_are_too_large_are_refused,
    ports_beyond_the_table_are_refused_until_one_is_dropped, ports_of_another_type_are_refused,
};
pub use promises::{
    a_bulk_sender_that_connected_first_starves_nobody, a_channel_can_be_created_at_run_time,
    a_history_read_during_puts_has_no_gap,
    a_late_getter_gets_the_history_of_all_put_ports_in_order,
    a_sync_group_names_the_urgent_port_first, bulk_displaces_no_urgent_packet,
    losses_count_from_the_opening_and_the_putter_knows_them,
    order_holds_between_put_ports_of_two_threads, packets_of_a_closed_put_port_arrive,
    packets_of_all_put_ports_arrive_in_the_order_of_their_puts,
    urgent_packets_overtake_waiting_bulk, what_a_closed_port_had_lost_is_counted,
};
pub use waiting::{
    a_busy_port_does_not_starve_the_group, a_large_group_is_woken_too,
    a_sync_group_finds_the_port_that_has_a_packet, blocking_gets_wake_up_and_time_out,
    no_wake_up_is_lost,
};

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

fn putter(bus: &Bus, channel: &str) -> PutPort<Reading> {
    bus.put_port(channel, Priority::Normal).unwrap()
}

/// Returns a port that gets the packets from now on.
fn getter(bus: &Bus, channel: impl AsChannelId) -> GetPort<Reading> {
    bus.get_port(channel, Start::Now).unwrap()
}

/// Gets all available packets and returns their numbers.
fn numbers(port: &GetPort<Reading>) -> Vec<u64> {
    std::iter::from_fn(|| port.try_get().unwrap().map(|packet| packet[0].number)).collect()
}

/// Waits for `packets` packets and returns their numbers.
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
    let get = getter(&ends.far, "a");
    let put = putter(&ends.near, "a");
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
    // The putter's host keeps the history.
    let ends = world.with(&[(
        "a",
        ChannelConfig {
            history: 5,
            ..normal()
        },
    )]);
    let put = putter(&ends.near, "a");
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
    let put = putter(&ends.near, "a");
    put.put_copy(&[reading(1)]).unwrap();
    let get = getter(&ends.near, "a");
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
    // In the distributed domain several rings lose packets; the near end has a single one.
    let get = getter(&ends.near, "a");
    let put = putter(&ends.near, "a");
    ends.settle();
    put.put_copy(&[reading(0)]).unwrap();
    assert_eq!(wait_for(&get, 1), [0]);
    for number in 1..=10 {
        put.put_copy(&[reading(number)]).unwrap();
    }
    assert_eq!(numbers(&get), [7, 8, 9, 10]);
    assert_eq!(get.lost(), 6);
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
    let put = putter(&ends.near, "there");
    ends.settle();
    tell.put_copy(&[put.id()]).unwrap();
    let id = get.get(SOON).unwrap().unwrap()[0];
    let there = getter(&ends.far, id);
    ends.settle();
    put.put_copy(&[reading(3)]).unwrap();
    assert_eq!(wait_for(&there, 1), [3]);
}

pub fn priorities_and_times_come_with_the_packet(world: &World) {
    let ends = world.with(&[("a", normal())]);
    let get = getter(&ends.far, "a");
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
