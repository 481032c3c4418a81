//! What zenoh is told: where hubs meet, who may join, and what each host may put and get.

use serde_json::{Value, json};

use crate::{ChannelConfig, ChannelError, Table};

/// What a packet's wire form takes beside its data at most, bytes.
const BESIDE: usize = 1 << 16;

/// Returns the name of a channel between hosts. Hubs whose packets differ do not hear each other.
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

/// Returns zenoh's configuration.
///
/// # Errors
/// Endpoints that zenoh does not take.
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
        // Hubs meet where the table says and nowhere else.
        ("scouting/multicast/enabled", json!(false)),
        ("scouting/gossip/enabled", json!(false)),
        // A packet is in shared memory already, before and after.
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

/// Everything is forbidden but what the table's channels allow.
fn access_control(table: &Table) -> Value {
    // Ours go out to everybody who may have asked for them.
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
