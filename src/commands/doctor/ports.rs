//! Checks of the default ports.

use std::io::ErrorKind;
use std::net::TcpListener;

use super::{Check, Status};

pub(super) fn checks() -> Vec<Check> {
    [
        (
            "port of demo",
            8750,
            "choose another port for demo and dashboard with `--listen 127.0.0.1:8751`",
        ),
        (
            "port of serve",
            9464,
            "choose another port for serve with `--metrics 127.0.0.1:9465`",
        ),
    ]
    .map(
        |(name, port, advice)| match TcpListener::bind(("127.0.0.1", port)) {
            Ok(_) => Check::ok(name, format!("{port} is free")),
            Err(error) => {
                let found = match error.kind() {
                    ErrorKind::AddrInUse => format!("{port} is in use"),
                    _ => format!("{port}: {error}"),
                };
                Check::not_ok(Status::Note, name, found, advice)
            }
        },
    )
    .into()
}
