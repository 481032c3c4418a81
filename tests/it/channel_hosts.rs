//! Channels between hosts: network namespaces of this machine, joined by a bridge.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::rc::Rc;
use std::time::{Duration, Instant};

use serde_json::Value;
use tactnet_channel::MEMORY_FOLDER_VARIABLE;
use tactnet_process::VirtualNetwork;
use tempfile::TempDir;

/// Size of a packet, in bytes.
const PACKET: usize = 100_000;

/// Network with three hosts: `a`, which puts and listens, `b` and `c`.
struct Hosts {
    network: Rc<VirtualNetwork>,
    /// Tables, certificates and shared memory.
    folder: TempDir,
}

#[derive(Clone, Copy)]
enum Name {
    A,
    B,
    C,
}

struct Host {
    network: Rc<VirtualNetwork>,
    name: Name,
    table: String,
    memory: String,
}

struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn sh(command: &str) -> String {
    let output = Command::new("sh").args(["-c", command]).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

impl Hosts {
    /// Returns `None`, with a message, if network namespaces are not allowed.
    fn new() -> Option<Self> {
        let network = VirtualNetwork::new(3)
            .inspect_err(|error| eprintln!("SKIPPED: {error}"))
            .ok()?;
        Some(Self {
            network: Rc::new(network),
            folder: TempDir::new_in("/dev/shm").unwrap(),
        })
    }

    /// - `network`: lines of the table about the network
    fn host(&self, name: Name, network: &str) -> Host {
        self.host_with_rights(name, network, "")
    }

    /// - `rights`: settings of the channel
    fn host_with_rights(&self, name: Name, network: &str, rights: &str) -> Host {
        let table = self.folder.path().join(format!("{}.toml", name as usize));
        let text = format!(
            "bus = \"hosts\"\n[network]\n{network}\n[channels.a]\npacket = \"u8\"\nitem_bytes = 1\nitems = {PACKET}\n\
             get_ports = 6\ndepth = 64\ndistributed = true\ncongestion = \"block\"\n{rights}"
        );
        std::fs::write(&table, text).unwrap();
        let memory = self.folder.path().join(format!("memory{}", name as usize));
        Host {
            network: Rc::clone(&self.network),
            name,
            table: table.display().to_string(),
            memory: memory.display().to_string(),
        }
    }
}

impl Host {
    fn run(&self, program: &str) -> Command {
        let mut command = self.network.command(self.name as usize, program);
        command.env(MEMORY_FOLDER_VARIABLE, &self.memory);
        command
    }

    fn channel(&self, arguments: &[&str]) -> Command {
        let mut command = self.run(env!("CARGO_BIN_EXE_tactnet"));
        command
            .arg("channel")
            .args(arguments)
            .args(["--table", &self.table]);
        command
    }

    fn hub(&self) -> Running {
        let mut child = self
            .channel(&["hub"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        assert_eq!(lines.next().unwrap().unwrap(), "ready");
        Running(child)
    }

    /// Starts to listen and waits until the hub knows.
    fn hz(&self, getters: usize, seconds: &str) -> Vec<Child> {
        let listening = (0..getters)
            .map(|_| {
                let mut hz = self.channel(&["hz", "a", "--json", "--seconds", seconds]);
                hz.stdout(Stdio::piped()).spawn().unwrap()
            })
            .collect();
        let begun = Instant::now();
        loop {
            let output = self.channel(&["list", "--json"]).output().unwrap();
            let listed: Value = serde_json::from_slice(&output.stdout).unwrap();
            // One of them is the hub's own.
            if listed[0]["get_ports"] == getters as u64 + 1 {
                return listening;
            }
            assert!(begun.elapsed() < Duration::from_secs(20), "{listed}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Returns the number of bytes that arrived over the network.
    fn received(&self) -> u64 {
        let output = self
            .run("ip")
            .args(["-s", "-j", "link", "show", "cable"])
            .output()
            .unwrap();
        let link: Value = serde_json::from_slice(&output.stdout).unwrap();
        link[0]["stats64"]["rx"]["bytes"].as_u64().unwrap()
    }
}

fn found(hz: Child) -> Value {
    serde_json::from_slice(&hz.wait_with_output().unwrap().stdout).unwrap()
}

/// Returns the table line of host `a`, or of a host that connects to it.
///
/// - `key`: `listen` or `connect`
/// - `protocol`: `tcp` or `tls`
fn endpoint(key: &str, protocol: &str) -> String {
    let address = VirtualNetwork::address(Name::A as usize);
    format!("{key} = [\"{protocol}/{address}:7447\"]")
}

/// Certificate authorities and certificates in a folder, created by openssl.
struct Certificates<'a>(&'a TempDir);

impl Certificates<'_> {
    fn openssl(&self, arguments: &str) {
        let folder = self.0.path().display();
        sh(&format!("cd {folder} && openssl {arguments} 2>&1"));
    }

    fn authority(&self, name: &str) {
        self.openssl(&format!(
            "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN={name} -keyout {name}.key -out {name}.pem"
        ));
    }

    /// Returns table lines for a host with this name and a certificate of `authority`.
    fn host(&self, name: &str, authority: &str) -> String {
        self.openssl(&format!(
            "req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN={name} -keyout {name}.key -out {name}.csr"
        ));
        let extensions = self.0.path().join(format!("{name}.ext"));
        let address = VirtualNetwork::address(Name::A as usize);
        std::fs::write(
            extensions,
            format!(
                "subjectAltName = IP:{address}\nextendedKeyUsage = serverAuth, clientAuth\nbasicConstraints = CA:FALSE\n"
            ),
        )
        .unwrap();
        self.openssl(&format!(
            "x509 -req -days 2 -in {name}.csr -CA {authority}.pem -CAkey {authority}.key -CAcreateserial -extfile {name}.ext -out {name}.pem"
        ));
        let path = |file: String| self.0.path().join(file).display().to_string();
        format!(
            "authority = {:?}\ncertificate = {:?}\nprivate_key = {:?}\n",
            path(format!("{authority}.pem")),
            path(format!("{name}.pem")),
            path(format!("{name}.key"))
        )
    }
}

/// A second hub without credentials could send and receive everything.
#[test]
fn a_host_puts_and_gets_only_what_its_certificate_allows() {
    let Some(hosts) = Hosts::new() else {
        return;
    };
    let certificates = Certificates(&hosts.folder);
    certificates.authority("robot");
    certificates.authority("stranger");
    let arm = certificates.host("arm", "robot");
    let a = hosts.host_with_rights(
        Name::A,
        &format!("{}\n{arm}", endpoint("listen", "tls")),
        "put_from = [\"head\"]\nget_from = [\"head\"]\nput_ports = 3\n",
    );
    let head = certificates.host("head", "robot");
    let tls = endpoint("connect", "tls");
    let b = hosts.host(Name::B, &format!("{tls}\n{head}"));
    // One host with a valid certificate but without rights, one of another authority, one without TLS.
    let leg = certificates.host("leg", "robot");
    let other = certificates.host("other", "stranger");
    let intruders = [
        format!("{tls}\n{leg}"),
        format!("{tls}\n{other}"),
        format!("plain_text = true\n{}", endpoint("connect", "tcp")),
    ];
    let _hubs = [a.hub(), b.hub()];
    let put = |host: &Host, count: usize| {
        let mut put = host.channel(&["put", "a", "--rate", "100"]);
        put.args(["--count", &count.to_string()]);
        assert!(put.output().unwrap().status.success());
    };
    for intruder in &intruders {
        let c = hosts.host(Name::C, intruder);
        let _hub = c.hub();
        let heard = [a.hz(1, "6"), b.hz(1, "6"), c.hz(1, "6")].map(|mut hz| hz.remove(0));
        settle();
        put(&b, 40);
        put(&c, 50);
        put(&a, 60);
        let [a, b, c] = heard.map(|hz| found(hz)["packets"].as_u64().unwrap());
        assert_eq!((a, b, c), (40 + 60, 40 + 60, 50), "{intruder}");
    }
}

/// Waits until the hubs have exchanged their subscribers.
fn settle() {
    std::thread::sleep(Duration::from_secs(2));
}

#[test]
fn packets_cross_the_wire_once_for_a_host_that_listens_and_a_killed_hub_comes_back() {
    let Some(hosts) = Hosts::new() else {
        return;
    };
    let plain = |key| format!("plain_text = true\n{}", endpoint(key, "tcp"));
    let a = hosts.host(Name::A, &plain("listen"));
    let [b, c] = [Name::B, Name::C].map(|name| hosts.host(name, &plain("connect")));
    let (_hub_a, hub_b, _hub_c) = (a.hub(), b.hub(), c.hub());
    let local = a.hz(1, "20");
    let listening = b.hz(5, "9");
    settle();
    let before = (b.received(), c.received());
    let put = |rate: &str, count: usize| {
        let put = a
            .channel(&["put", "a", "--rate", rate, "--count", &count.to_string()])
            .output()
            .unwrap();
        assert!(put.status.success());
    };
    put("100", 300);
    let after = (b.received(), c.received());
    for hz in listening {
        let rate = found(hz);
        assert_eq!(
            (&rate["packets"], &rate["lost"]),
            (&300.into(), &0.into()),
            "{rate}"
        );
    }
    let payload = (300 * PACKET) as f64;
    let wire = (after.0 - before.0) as f64 / payload;
    let idle = (after.1 - before.1) as f64 / payload;
    eprintln!("wire bytes over payload: {wire:.4} with five getters, {idle:.5} with none");
    assert!((1.0..1.01).contains(&wire), "{wire}");
    assert!(idle < 0.001, "{idle}");

    // The remote hub dies; the local receiver continues. The hub returns and packets cross again.
    drop(hub_b);
    put("100", 50);
    let _hub_b = b.hub();
    let again = b.hz(1, "6");
    settle();
    put("100", 100);
    let rate = found(again.into_iter().next().unwrap());
    assert_eq!(
        (&rate["packets"], &rate["lost"]),
        (&100.into(), &0.into()),
        "{rate}"
    );
    let rate = found(local.into_iter().next().unwrap());
    assert_eq!(
        (&rate["packets"], &rate["lost"]),
        (&450.into(), &0.into()),
        "{rate}"
    );
}

#[test]
fn answers_of_two_hosts_at_once_all_arrive() {
    let mut domains = vec!["distributed"];
    domains.extend(VirtualNetwork::new(1).is_ok().then_some("namespaces"));
    for domain in domains {
        let mut stress =
            crate::command::tactnet(["channel", "stress", "--json", "--seconds", "0.5"]);
        stress.args(["--against", "zenoh", "--domain", domain]);
        // Packets of 4 B: more than the 10 000 a second that a channel accepts from other hosts by default.
        stress.args(["--sizes", "4,65536", "--clients", "10"]);
        let output = crate::command::stdout(&crate::command::expect(0, stress));
        let result: Value = serde_json::from_str(&output).unwrap();
        let rows = result["rows"].as_array().unwrap();
        assert_eq!(rows.len(), 2 * 2, "{output}");
        for row in rows {
            assert_eq!(row["domain"], domain);
            assert_eq!(row["failures"], 0, "{output}");
            assert!(row["rounds"].as_u64().unwrap() > 10, "{output}");
        }
    }
}

/// Returns the processes in the network namespace of a process, including itself.
fn in_namespace_of(process: u32) -> Vec<u32> {
    let namespace = |process: u32| std::fs::read_link(format!("/proc/{process}/ns/net")).ok();
    let wanted = namespace(process);
    let entries = std::fs::read_dir("/proc").unwrap().flatten();
    let processes = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    processes
        .filter(|other| namespace(*other) == wanted)
        .collect()
}

#[test]
fn a_killed_stress_test_leaves_no_network_namespace() {
    if VirtualNetwork::new(1).is_err() {
        return eprintln!("SKIPPED: network namespaces are not allowed");
    }
    let mut stress = crate::command::tactnet(["channel", "stress", "--domain", "namespaces"]);
    stress.args(["--sizes", "4", "--clients", "2", "--seconds", "60"]);
    let mut stress = stress.spawn().unwrap();
    let begun = Instant::now();
    // The master, the sleeping process that keeps its namespace, and its hub.
    let namespace = loop {
        let found = in_namespace_of(stress.id());
        if found.len() == 3 {
            break found;
        }
        assert!(begun.elapsed() < Duration::from_secs(20), "{found:?}");
        std::thread::sleep(Duration::from_millis(20));
    };
    stress.kill().unwrap();
    stress.wait().unwrap();
    while namespace
        .iter()
        .any(|process| std::path::Path::new(&format!("/proc/{process}")).exists())
    {
        assert!(begun.elapsed() < Duration::from_secs(40), "{namespace:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}
