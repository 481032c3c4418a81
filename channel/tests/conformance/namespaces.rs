//! Two hosts on this machine: one hub process in each of two network namespaces.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Stdio};

use tactnet_channel::{Congestion, Hub, Network, Table};
use tactnet_process::VirtualNetwork;

/// Environment variable with the table for the hub process.
const TABLE: &str = "TACTNET_CONFORMANCE_HUB";

/// Ends the hubs and removes the namespaces when dropped.
pub struct Namespaces {
    hubs: [Child; 2],
    _network: VirtualNetwork,
}

/// Returns true if this process can create network namespaces; otherwise prints why.
pub fn are_allowed() -> bool {
    VirtualNetwork::new(1)
        .inspect_err(|error| eprintln!("SKIPPED: {error}"))
        .is_ok()
}

impl Namespaces {
    /// Starts both hubs. Returns the table of each host; all its channels are distributed.
    pub fn with_hubs(table: &Table) -> (Self, [Table; 2]) {
        let endpoint = vec![format!("tcp/{}:7447", VirtualNetwork::address(0))];
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
        let network = VirtualNetwork::new(2).unwrap();
        let hubs = [0, 1].map(|host| start_hub(&network, host, &tables[host]));
        let made = Self {
            hubs,
            _network: network,
        };
        (made, tables)
    }
}

/// Starts this test program on a host, to run [`hub_of_a_namespace`] only.
fn start_hub(network: &VirtualNetwork, host: usize, table: &Table) -> Child {
    let mut hub = network
        .command(host, std::env::current_exe().unwrap())
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
    }
}
