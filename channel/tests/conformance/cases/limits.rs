//! Limits of packets and ports.

use bytemuck::{Pod, Zeroable};
use tactnet_channel::{ChannelConfig, ChannelError, Packet, Priority, Start};

use super::{Reading, getter, normal, putter, reading, wait_for};
use crate::world::{SOON, World};

pub fn packets_that_are_too_large_are_refused(world: &World) {
    let ends = world.with(&[("a", normal())]);
    let put = putter(&ends.near, "a");
    let error = put.loan(5).unwrap_err();
    assert_eq!(
        error.to_string(),
        "channel `a`: expected at most 4 items in a packet, found 5"
    );
    // Packets of maximum size and empty packets arrive.
    let get = getter(&ends.far, "a");
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
    // The hub may not have taken its own place in a distributed channel yet.
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
    let get = getter(&ends.far, "a");
    let put = putter(&ends.near, "a");
    ends.settle();
    put.put_copy(&[reading(5)]).unwrap();
    let packet = get.get(SOON).unwrap().unwrap();
    drop(put);
    drop(get);
    let put = putter(&ends.near, "a");
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
    let get = getter(&ends.far, "a");
    let put = putter(&ends.near, "a");
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
