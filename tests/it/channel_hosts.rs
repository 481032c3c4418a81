//! Channels between hosts: network namespaces of this machine, each with its own `/dev/shm`, connected by virtual cables.
//!
//! ```text
//! a (putter, listens) ─┬─ b
//!                      └─ c
//! ```

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tactnet_channel::MEMORY_FOLDER_VARIABLE;
use tempfile::TempDir;

/// Size of a packet, in bytes.
const PACKET: usize = 100_000;

struct Host {
    /// Keeps the namespaces alive.
    anchor: Child,
    table: String,
}

struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        let _ = self.anchor.kill();
        let _ = self.anchor.wait();
    }
}

fn sh(command: &str) -> String {
    let output = Command::new("sh").args(["-c", command]).output().unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

impl Host {
    fn new(folder: &TempDir, name: &str, network: &str) -> Self {
        Self::with_rights(folder, name, network, "")
    }

    /// - `rights`: settings of the channel
    fn with_rights(folder: &TempDir, name: &str, network: &str, rights: &str) -> Self {
        let script =
            "mount -t tmpfs shm /dev/shm && ip link set lo up && echo ready && exec sleep 1000";
        let mut anchor = Command::new("unshare")
            .args(["--net", "--mount", "sh", "-c", script])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(anchor.stdout.take().unwrap()).lines();
        assert_eq!(lines.next().unwrap().unwrap(), "ready");
        let table = folder.path().join(format!("{name}.toml"));
        let text = format!(
            "bus = \"hosts\"\n[network]\n{network}\n[channels.a]\npacket = \"u8\"\nitem_bytes = 1\nitems = {PACKET}\n\
             get_ports = 6\ndepth = 64\ndistributed = true\ncongestion = \"block\"\n{rights}"
        );
        std::fs::write(&table, text).unwrap();
        Self {
            anchor,
            table: table.display().to_string(),
        }
    }

    fn run(&self, program: &str) -> Command {
        let mut command = Command::new("nsenter");
        command
            .arg(format!("--target={}", self.anchor.id()))
            .args(["--net", "--mount", "--"])
            .arg(program)
            .env(MEMORY_FOLDER_VARIABLE, "/dev/shm/tactnet");
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

    /// Returns the number of bytes received over a cable.
    fn received(&self, cable: &str) -> u64 {
        let output = self
            .run("ip")
            .args(["-s", "-j", "link", "show", cable])
            .output()
            .unwrap();
        let link: Value = serde_json::from_slice(&output.stdout).unwrap();
        link[0]["stats64"]["rx"]["bytes"].as_u64().unwrap()
    }

    fn configure(&self, cable: &str, address: &str) {
        for arguments in [
            vec!["addr", "add", address, "dev", cable],
            vec!["link", "set", cable, "up"],
        ] {
            assert!(self.run("ip").args(arguments).status().unwrap().success());
        }
    }
}

fn found(hz: Child) -> Value {
    serde_json::from_slice(&hz.wait_with_output().unwrap().stdout).unwrap()
}

fn three_hosts(folder: &TempDir) -> [Host; 3] {
    let a = Host::new(
        folder,
        "a",
        "plain_text = true\nlisten = [\"tcp/10.77.1.1:7447\", \"tcp/10.77.2.1:7447\"]",
    );
    let b = Host::new(
        folder,
        "b",
        "plain_text = true\nconnect = [\"tcp/10.77.1.1:7447\"]",
    );
    let c = Host::new(
        folder,
        "c",
        "plain_text = true\nconnect = [\"tcp/10.77.2.1:7447\"]",
    );
    connect(&a, &b, &c);
    [a, b, c]
}

/// Cables from `a` to both other hosts.
fn connect(a: &Host, b: &Host, c: &Host) {
    for (number, other) in [(1, b), (2, c)] {
        let (near, far) = (
            format!("tn{number}a{}", a.anchor.id()),
            format!("tn{number}b{}", a.anchor.id()),
        );
        sh(&format!("ip link add {near} type veth peer name {far}"));
        for (cable, host, end) in [(&near, a, 1), (&far, other, 2)] {
            sh(&format!("ip link set {cable} netns {}", host.anchor.id()));
            host.configure(cable, &format!("10.77.{number}.{end}/24"));
        }
    }
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
        std::fs::write(
            extensions,
            "subjectAltName = IP:10.77.1.1, IP:10.77.2.1\nextendedKeyUsage = serverAuth, clientAuth\nbasicConstraints = CA:FALSE\n",
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

fn may_have_namespaces() -> bool {
    let may = Command::new("unshare")
        .args(["--net", "--mount", "true"])
        .output();
    let may = may.is_ok_and(|output| output.status.success());
    if !may {
        eprintln!("SKIPPED: network namespaces need root");
    }
    may
}

/// A second hub without credentials could send and receive everything.
#[test]
fn a_host_puts_and_gets_only_what_its_certificate_allows() {
    if !may_have_namespaces() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let certificates = Certificates(&folder);
    certificates.authority("robot");
    certificates.authority("stranger");
    let arm = certificates.host("arm", "robot");
    let a = Host::with_rights(
        &folder,
        "a",
        &format!("listen = [\"tls/10.77.1.1:7447\", \"tls/10.77.2.1:7447\"]\n{arm}"),
        "put_from = [\"head\"]\nget_from = [\"head\"]\nput_ports = 3\n",
    );
    let head = certificates.host("head", "robot");
    let b = Host::new(
        &folder,
        "b",
        &format!("connect = [\"tls/10.77.1.1:7447\"]\n{head}"),
    );
    // One host with a valid certificate but without rights, one of another authority, one without TLS.
    let leg = certificates.host("leg", "robot");
    let other = certificates.host("other", "stranger");
    let intruders = [
        format!("connect = [\"tls/10.77.2.1:7447\"]\n{leg}"),
        format!("connect = [\"tls/10.77.2.1:7447\"]\n{other}"),
        "plain_text = true\nconnect = [\"tcp/10.77.2.1:7447\"]".to_owned(),
    ];
    let c = Host::new(&folder, "c", &intruders[0]);
    connect(&a, &b, &c);
    let _hubs = [a.hub(), b.hub()];
    let put = |host: &Host, count: usize| {
        let mut put = host.channel(&["put", "a", "--rate", "100"]);
        put.args(["--count", &count.to_string()]);
        assert!(put.output().unwrap().status.success());
    };
    for intruder in &intruders {
        let table = std::fs::read_to_string(&c.table).unwrap();
        let begin = table.find("[network]").unwrap() + "[network]\n".len();
        let end = table.find("[channels.a]").unwrap();
        let table = format!("{}{intruder}\n{}", &table[..begin], &table[end..]);
        std::fs::write(&c.table, table).unwrap();
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

fn cable(a: &Host, number: usize) -> String {
    format!("tn{number}b{}", a.anchor.id())
}

/// Waits until the hubs have exchanged their subscribers.
fn settle() {
    std::thread::sleep(Duration::from_secs(2));
}

#[test]
fn packets_cross_the_wire_once_for_a_host_that_listens_and_a_killed_hub_comes_back() {
    if !may_have_namespaces() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let [a, b, c] = three_hosts(&folder);
    let (_hub_a, hub_b, _hub_c) = (a.hub(), b.hub(), c.hub());
    let local = a.hz(1, "20");
    let listening = b.hz(5, "9");
    settle();
    let (cable_b, cable_c) = (cable(&a, 1), cable(&a, 2));
    let before = (b.received(&cable_b), c.received(&cable_c));
    let put = |rate: &str, count: usize| {
        let put = a
            .channel(&["put", "a", "--rate", rate, "--count", &count.to_string()])
            .output()
            .unwrap();
        assert!(put.status.success());
    };
    put("100", 300);
    let after = (b.received(&cable_b), c.received(&cable_c));
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
    let mut stress = crate::command::tactnet(["channel", "stress", "--json", "--seconds", "0.5"]);
    stress.args([
        "--domain",
        "distributed",
        "--sizes",
        "65536",
        "--clients",
        "6",
    ]);
    let output = crate::command::stdout(&crate::command::expect(0, stress));
    let result: Value = serde_json::from_str(&output).unwrap();
    assert_eq!(result["rows"][0]["failures"], 0, "{output}");
    assert!(
        result["rows"][0]["rounds"].as_u64().unwrap() > 10,
        "{output}"
    );
}
