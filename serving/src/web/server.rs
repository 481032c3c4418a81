//! An HTTP server that clients cannot exhaust: so many connections and no more, each with a time limit.

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

/// What clients may use.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Connections at a time; more are closed at once.
    pub connections: usize,
    /// Time for the head of a request, also of the next one on the same connection.
    pub head: Duration,
    /// Time in which a client takes what it was sent.
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

/// Answers until it is dropped.
pub(super) async fn answer(listener: TcpListener, router: Router, limits: Limits) {
    let free = Arc::new(Semaphore::new(limits.connections));
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            // The client has gone, or descriptors are short: who waits, waits on.
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
            // Whatever ends it, it is the client's matter.
            let _ = connection.await;
            drop(place);
        });
    }
}

/// Lets the kernel end a connection whose client takes nothing.
fn with_patience(
    stream: tokio::net::TcpStream,
    unread: Duration,
) -> std::io::Result<tokio::net::TcpStream> {
    let stream: TcpStream = stream.into_std()?;
    SockRef::from(&stream).set_tcp_user_timeout(Some(unread))?;
    tokio::net::TcpStream::from_std(stream)
}
