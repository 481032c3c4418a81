//! Zenoh configuration: endpoints, certificates, and access rules of every host.

use serde_json::{Value, json};

use crate::{ChannelConfig, ChannelError, Table};

/// Upper bound of the overhead of a packet on the network, in bytes.
const BESIDE: usize = 1 << 16;

/// Returns the zenoh key of a channel. Hubs with different packet types use different keys.
pub(crate) fn key(table: &Table, id: &str, config: &ChannelConfig) -> String {
    let letters = config.packet.chars().filter(char::is_ascii_alphanumeric);
    format!(
        "{}/{id}/{}-{}-{}",
        table.bus,
        letters.collect::<String>(),
        config.version,
        config.item_bytes
    )
}

/// Returns the configuration of zenoh.
///
/// # Errors
/// Zenoh rejects an endpoint.
pub(crate) fn settings(table: &Table) -> Result<zenoh::Config, ChannelError> {
    let network = &table.network;
    let largest = distributed(table)
        .map(|(_, config)| config.packet_bytes())
        .max()
        .unwrap_or(0);
    let mut settings = vec![
        ("mode", json!("peer")),
        ("listen/endpoints", json!(network.listen)),
        ("connect/endpoints", json!(network.connect)),
        // Hubs connect only to the endpoints of the table.
        ("scouting/multicast/enabled", json!(false)),
        ("scouting/gossip/enabled", json!(false)),
        // Packets are in shared memory already on both sides.
        ("transport/shared_memory/enabled", json!(false)),
        (
            "transport/link/rx/max_message_size",
            json!(largest + BESIDE),
        ),
    ];
    if network.has_tls() {
        settings.extend([
            ("transport/link/protocols", json!(["tls"])),
            (
                "transport/link/tls",
                json!({
                    "root_ca_certificate": network.authority,
                    "enable_mtls": true,
                    "listen_certificate": network.certificate,
                    "listen_private_key": network.private_key,
                    "connect_certificate": network.certificate,
                    "connect_private_key": network.private_key,
                    "verify_name_on_connect": true,
                    "close_link_on_expiration": true,
                }),
            ),
            ("access_control", access_control(table)),
        ]);
    } else {
        settings.push(("transport/link/protocols", json!(["tcp"])));
    }
    let mut config = zenoh::Config::default();
    for (key, value) in settings {
        config
            .insert_json5(key, &value.to_string())
            .map_err(|error| ChannelError::transport(key, error))?;
    }
    Ok(config)
}

fn distributed(table: &Table) -> impl Iterator<Item = (&String, &ChannelConfig)> {
    table
        .channels
        .iter()
        .filter(|(_, config)| config.distributed)
}

/// Returns access rules that forbid everything except what the table's channels allow.
fn access_control(table: &Table) -> Value {
    // This hub's packets may go to every host that subscribes.
    let mut rules = vec![json!({
        "id": "own", "permission": "allow", "flows": ["egress"], "messages": ["put", "declare_subscriber"],
        "key_exprs": [format!("{}/**", table.bus)],
    })];
    let mut subjects = vec![json!({"id": "every host"})];
    let mut policies = vec![json!({"rules": ["own"], "subjects": ["every host"]})];
    let mut named: Vec<&String> = Vec::new();
    for (id, config) in distributed(table) {
        for (message, hosts) in [
            ("put", &config.put_from),
            ("declare_subscriber", &config.get_from),
        ] {
            let rule = format!("{message} {id}");
            rules.push(json!({
                "id": rule, "permission": "allow", "flows": ["ingress"], "messages": [message],
                "key_exprs": [key(table, id, config)],
            }));
            let allowed = if hosts.is_empty() {
                vec!["every host".to_owned()]
            } else {
                named.extend(hosts);
                hosts.iter().map(|host| format!("host {host}")).collect()
            };
            policies.push(json!({"rules": [rule], "subjects": allowed}));
        }
    }
    named.sort();
    named.dedup();
    for host in named {
        subjects.push(json!({"id": format!("host {host}"), "cert_common_names": [host]}));
    }
    json!({
        "enabled": true, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies,
    })
}
