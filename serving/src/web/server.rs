//! HTTP server with limits on connections and time, so that clients cannot exhaust it.

use std::net::TcpStream;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use socket2::SockRef;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

/// Limits on clients.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Maximum number of connections; further ones are closed at once.
    pub connections: usize,
    /// Timeout for the header of a request, also of later ones on the same connection.
    pub head: Duration,
    /// Timeout for a client to receive a response.
    pub unread: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 32,
            head: Duration::from_secs(5),
            unread: Duration::from_secs(20),
        }
    }
}

/// Serves requests until it is dropped.
pub(super) async fn answer(listener: TcpListener, router: Router, limits: Limits) {
    let free = Arc::new(Semaphore::new(limits.connections));
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            // The client has left, or descriptors are exhausted: wait, then continue.
            Err(_) => {
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        let Ok(place) = free.clone().try_acquire_owned() else {
            continue;
        };
        let Ok(stream) = with_patience(stream, limits.unread) else {
            continue;
        };
        let service = TowerToHyperService::new(router.clone());
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(limits.head)
            .max_buf_size(16 << 10)
            .serve_connection(TokioIo::new(stream), service);
        tokio::spawn(async move {
            // Errors of one connection concern only its client.
            let _ = connection.await;
            drop(place);
        });
    }
}

/// Sets the kernel's timeout for a client that receives nothing.
fn with_patience(
    stream: tokio::net::TcpStream,
    unread: Duration,
) -> std::io::Result<tokio::net::TcpStream> {
    let stream: TcpStream = stream.into_std()?;
    SockRef::from(&stream).set_tcp_user_timeout(Some(unread))?;
    tokio::net::TcpStream::from_std(stream)
}
