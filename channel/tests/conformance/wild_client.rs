//! A client that overwrites all its shared memory damages only the channels that it is connected to.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tactnet_channel::{
    Bus, ChannelConfig, Domain, Hub, Priority, Start, Table, TemporaryBus, Wait, temporary_bus_name,
};

/// Environment variables with the table and the pattern for the processes.
const TABLE: &str = "TACTNET_WILD_TABLE";
const PATTERN: &str = "TACTNET_WILD_PATTERN";

/// Starts a function of this module as a process, and waits until it is ready.
fn start(function: &str, table: &Table, pattern: &str) -> Child {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "--nocapture"])
        .arg(format!("wild_client::{function}"))
        .env(TABLE, table.to_toml())
        .env(PATTERN, pattern)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stdout.as_mut().unwrap()).lines();
    assert!(lines.map_while(Result::ok).any(|line| line == "ready"));
    child
}

fn table() -> Option<Table> {
    let text = std::env::var(TABLE).ok()?;
    Some(Table::parse(&text).unwrap())
}

#[test]
#[ignore = "a hub process for the test below"]
fn hub() {
    let Some(table) = table() else { return };
    let hub = Hub::spawn(&table).unwrap();
    println!("\nready");
    let _ = std::io::stdin().read_to_end(&mut Vec::new());
    drop(hub);
}

#[test]
#[ignore = "a client process for the test below"]
fn client() {
    let Some(table) = table() else { return };
    let bus = Bus::open(Domain::Host, &table).unwrap();
    let put = bus.put_port::<u64>("wild", Priority::Normal).unwrap();
    let _get = bus.get_port::<u64>("wild", Start::Now).unwrap();
    put.put_copy(&[1; 8]).unwrap();
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let fill = |byte: usize| match std::env::var(PATTERN).unwrap().as_str() {
        "zeros" => 0,
        "ones" => 255,
        _ => (byte.wrapping_mul(0x9e37_79b9) >> 13) as u8,
    };
    let mut scribbled = 0;
    for line in maps.lines().filter(|line| line.contains(&table.bus)) {
        let mut words = line.split_whitespace();
        let (range, rights) = (words.next().unwrap(), words.next().unwrap());
        if rights != "rw-s" {
            continue;
        }
        let address = |text: &str| usize::from_str_radix(text, 16).unwrap();
        let (begin, end) = range.split_once('-').unwrap();
        let (begin, end) = (address(begin), address(end));
        for byte in (begin..end).take(1 << 20) {
            // SAFETY: mapped writable in this process, which does not use it again.
            unsafe { (byte as *mut u8).write_volatile(fill(byte)) };
        }
        scribbled += 1;
    }
    assert!(scribbled > 3, "{maps}");
    println!("\nready");
    let _ = std::io::stdin().read_to_end(&mut Vec::new());
    // Without destructors, which would use what was overwritten.
    std::process::abort();
}

#[test]
fn a_wild_client_does_not_stop_channels_that_it_is_not_connected_to() {
    for pattern in ["noise", "zeros", "ones"] {
        survives(pattern);
    }
}

fn survives(pattern: &str) {
    let config = ChannelConfig {
        put_ports: 2,
        ..ChannelConfig::of::<u64>(8)
    };
    let table = Table::new(&temporary_bus_name(&format!("{pattern}-")))
        .with("wild", config.clone())
        .with("calm", config);
    let _remove_at_the_end = TemporaryBus(&table);
    let mut hub = start("hub", &table, pattern);
    let [near, far] = [(); 2].map(|()| Bus::open(Domain::Host, &table).unwrap());
    let get = far.get_port::<u64>("calm", Start::Now).unwrap();
    let put = near.put_port::<u64>("calm", Priority::Normal).unwrap();
    let exchange = |time: Duration| {
        let begun = Instant::now();
        let mut number = 0;
        while begun.elapsed() < time {
            put.put_copy(&[number]).unwrap();
            let timeout = Duration::from_secs(5);
            let packet = get.get(Wait::Block { timeout }).unwrap();
            assert_eq!(packet.expect("it arrives")[0], number);
            number += 1;
        }
        assert_eq!(get.lost(), 0);
    };
    let mut wild = start("client", &table, pattern);
    exchange(Duration::from_millis(300));
    drop(wild.stdin.take());
    wild.wait().unwrap();
    // The hub looks for dead clients once a second.
    exchange(Duration::from_millis(1500));
    // New ports of the other channel connect.
    let bus = Bus::open(Domain::Host, &table).unwrap();
    let late = bus.get_port::<u64>("calm", Start::Now).unwrap();
    let second = bus.put_port::<u64>("calm", Priority::Normal).unwrap();
    second.put_copy(&[77]).unwrap();
    let timeout = Duration::from_secs(5);
    let packet = late.get(Wait::Block { timeout }).unwrap().unwrap();
    assert_eq!(packet[0], 77);
    drop(packet);
    assert_eq!(get.try_get().unwrap().unwrap()[0], 77);
    assert_eq!(
        hub.try_wait().unwrap(),
        None,
        "the hub runs after `{pattern}`"
    );
    drop(hub.stdin.take());
    hub.wait().unwrap();
    // The next hub takes over, or refuses the damaged channel and names what to do.
    match Hub::start(&table) {
        Ok(_) => {}
        Err(error) => {
            let text = error.to_string();
            let damaged = "channel `wild`: its shared memory is damaged";
            assert!(text.contains(damaged), "after `{pattern}`: {text}");
        }
    }
    exchange(Duration::from_millis(300));
}
