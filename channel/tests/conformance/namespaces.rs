//! Two hosts on this machine: one hub process in each of two network namespaces, connected by a virtual cable.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

use tactnet_channel::{Congestion, Hub, Network, Table};

/// Environment variable with the table for the hub process.
const TABLE: &str = "TACTNET_CONFORMANCE_HUB";
const ADDRESSES: [&str; 2] = ["10.78.0.1", "10.78.0.2"];

/// Removes hubs, namespaces and cable when dropped.
pub struct Namespaces {
    names: [String; 2],
    hubs: Vec<Child>,
}

/// Returns true if this process can create network namespaces.
pub fn are_allowed() -> bool {
    let name = format!("tactnet-try-{}-{}", std::process::id(), number());
    let added = ip(&format!("netns add {name}"));
    added && ip(&format!("netns del {name}"))
}

fn number() -> u32 {
    static NUMBERS: AtomicU32 = AtomicU32::new(0);
    NUMBERS.fetch_add(1, Ordering::Relaxed)
}

fn ip(arguments: &str) -> bool {
    let mut ip = Command::new("ip");
    ip.args(arguments.split(' ')).stderr(Stdio::null());
    ip.status().is_ok_and(|status| status.success())
}

impl Namespaces {
    /// Starts both hubs. Returns the table of each host; all its channels are distributed.
    pub fn with_hubs(table: &Table) -> (Self, [Table; 2]) {
        let number = number();
        let names = ["a", "b"].map(|end| format!("{}{number}{end}", std::process::id()));
        let mut made = Self {
            names: names.clone(),
            hubs: Vec::new(),
        };
        for name in &names {
            assert!(ip(&format!("netns add {name}")));
        }
        let [a, b] = &names;
        assert!(ip(&format!(
            "link add cable netns {a} type veth peer name cable netns {b}"
        )));
        for (name, address) in names.iter().zip(ADDRESSES) {
            assert!(ip(&format!("-n {name} addr add {address}/24 dev cable")));
            assert!(ip(&format!("-n {name} link set cable up")));
        }
        let endpoint = vec![format!("tcp/{}:7447", ADDRESSES[0])];
        let networks = [
            Network {
                host: "a".into(),
                listen: endpoint.clone(),
                plain_text: true,
                ..Network::default()
            },
            Network {
                host: "b".into(),
                connect: endpoint,
                plain_text: true,
                ..Network::default()
            },
        ];
        let tables = networks.map(|network| {
            let mut table = Table {
                network,
                ..table.clone()
            };
            for channel in table.channels.values_mut() {
                channel.distributed = true;
                channel.congestion = Congestion::Block;
            }
            table
        });
        for (name, table) in names.iter().zip(&tables) {
            made.hubs.push(start_hub(name, table));
        }
        (made, tables)
    }
}

/// Starts this test program in the namespace, to run [`hub_of_a_namespace`] only.
fn start_hub(namespace: &str, table: &Table) -> Child {
    let mut hub = Command::new("ip")
        .args(["netns", "exec", namespace])
        .arg(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "--nocapture"])
        .arg("namespaces::hub_of_a_namespace")
        .env(TABLE, toml::to_string(table).unwrap())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(hub.stdout.as_mut().unwrap()).lines();
    assert!(lines.map_while(Result::ok).any(|line| line == "ready"));
    hub
}

/// Not a test: the hub process of [`start_hub`]. Ends with its standard input.
#[test]
#[ignore = "a hub for the distributed suite, which starts it"]
fn hub_of_a_namespace() {
    let Ok(table) = std::env::var(TABLE) else {
        return;
    };
    let hub = Hub::spawn(&toml::from_str(&table).unwrap()).unwrap();
    println!("\nready");
    let _ = std::io::stdin().read_to_end(&mut Vec::new());
    hub.stop().unwrap();
}

impl Drop for Namespaces {
    fn drop(&mut self) {
        for hub in &mut self.hubs {
            drop(hub.stdin.take());
            let _ = hub.wait();
        }
        for name in &self.names {
            ip(&format!("netns del {name}"));
        }
    }
}
