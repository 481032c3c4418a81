//! Connection of hosts.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Endpoints of the hub, like `tcp/10.0.0.2:7447`, and its certificates.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// Suffix that separates several hosts on one machine, for tests; usually empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub host: String,
    /// Endpoints that the hub listens on.
    #[serde(default)]
    pub listen: Vec<String>,
    /// Endpoints of other hubs to connect to.
    ///
    /// Hubs do not forward received packets: every pair of hubs that exchanges packets needs a direct connection.
    #[serde(default)]
    pub connect: Vec<String>,
    /// For `tls/` endpoints: PEM file with the certificate authority of this robot's hosts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub authority: Option<PathBuf>,
    /// PEM file with this host's certificate. [`put_from`](crate::ChannelConfig::put_from) and [`get_from`](crate::ChannelConfig::get_from) of other
    /// hosts use its common name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certificate: Option<PathBuf>,
    /// PEM file with the private key of the certificate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub private_key: Option<PathBuf>,
    /// Allows endpoints without TLS beyond this machine. Every computer that reaches them can then read and put
    /// packets.
    #[serde(default, skip_serializing_if = "is_false")]
    pub plain_text: bool,
}

impl Network {
    /// Returns true if the endpoints are encrypted and both sides show a certificate.
    pub(crate) fn has_tls(&self) -> bool {
        self.endpoints().any(|endpoint| endpoint.starts_with(TLS))
    }

    pub(crate) fn endpoints(&self) -> impl Iterator<Item = &String> {
        self.listen.iter().chain(&self.connect)
    }

    /// Checks that endpoints beyond this machine use TLS, unless plain text is allowed.
    pub(super) fn check(&self) -> Result<(), String> {
        let (mut tls, mut plain) = (None, None);
        for endpoint in self.endpoints() {
            if endpoint.starts_with(TLS) {
                tls = Some(endpoint);
            } else {
                plain = Some(endpoint);
            }
            if !(endpoint.starts_with(TLS) || self.plain_text || is_loopback(endpoint)) {
                return Err(format!(
                    "network: `{endpoint}` leaves this machine without encryption or access control; use `{TLS}…` with `authority`, `certificate` \
                     and `private_key`, or allow it by `plain_text = true`"
                ));
            }
        }
        if let (Some(tls), Some(plain)) = (tls, plain) {
            return Err(format!(
                "network: expected all endpoints with TLS or none, found `{tls}` and `{plain}`"
            ));
        }
        for (name, file) in [
            ("authority", &self.authority),
            ("certificate", &self.certificate),
            ("private_key", &self.private_key),
        ] {
            if let (Some(endpoint), None) = (tls, file) {
                return Err(format!("network: `{endpoint}` needs `{name}`, a PEM file"));
            }
        }
        Ok(())
    }
}

/// Prefix of encrypted endpoints.
pub(super) const TLS: &str = "tls/";

/// Returns true for endpoints of this machine, like `tcp/127.0.0.1:7447`.
fn is_loopback(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map_or(endpoint, |(_, rest)| rest);
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost"
        || host
            .parse()
            .is_ok_and(|address: std::net::IpAddr| address.is_loopback())
}

fn is_false(value: &bool) -> bool {
    !value
}
