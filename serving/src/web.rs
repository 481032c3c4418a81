//! HTTP server for browsers and Prometheus, on one thread.

mod dashboard;
mod guard;
mod likeness_banner;
mod listen;
mod objects;
mod range;
mod server;
mod view;

use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::JoinHandle;

use axum::Router;
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HeaderMap};
use axum::middleware::from_fn_with_state;
use axum::response::IntoResponse;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::routing::{get, post};
use futures_util::stream;
use tokio::sync::{oneshot, watch};

use crate::{Metrics, ServeError};
pub use dashboard::{Dashboard, StageSource};
use guard::Guard;
pub use guard::TOKEN_VARIABLE;
pub use listen::{Holder, listen};
use server::Limits;

/// A running server; dropping it stops the server.
#[derive(Debug)]
pub struct WebServer {
    address: SocketAddr,
    guard: Guard,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl WebServer {
    /// Returns the address at which the server listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns the link to a path such as `/`. It contains the token if other machines can connect.
    pub fn link_to(&self, path: &str) -> String {
        format!("http://{}{path}{}", self.address, self.guard.query())
    }
}

impl Drop for WebServer {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Serves `/metrics` in Prometheus's format.
///
/// # Errors
/// Fails if the server cannot listen at the address.
pub fn metrics(address: SocketAddr, metrics: Arc<Metrics>) -> Result<WebServer, ServeError> {
    let answer = move || {
        let text = metrics.prometheus();
        async move { ([(CONTENT_TYPE, "text/plain; version=0.0.4")], text).into_response() }
    };
    let router = Router::new().route("/metrics", get(answer));
    serve(listen(address)?, router)
}

/// Files of the live page: path, media type and text. The page loads nothing else.
const PAGE: [(&str, &str, &str); 3] = [
    (
        "/",
        "text/html; charset=utf-8",
        include_str!("web/dashboard.html"),
    ),
    (
        "/dashboard.css",
        "text/css; charset=utf-8",
        include_str!("web/dashboard.css"),
    ),
    (
        "/dashboard.js",
        "text/javascript; charset=utf-8",
        include_str!("web/dashboard.js"),
    ),
];

/// Serves the page, and `/events` with a stream of `views`; calls `reset` when a browser requests it.
fn dashboard(
    listener: TcpListener,
    views: watch::Receiver<Arc<str>>,
    reset: impl Fn() + Clone + Send + Sync + 'static,
) -> Result<WebServer, ServeError> {
    let events = move || {
        let views = views.clone();
        async move {
            let events = stream::unfold(views, |mut views| async move {
                views.changed().await.ok()?;
                let text = views.borrow_and_update().clone();
                Some((Ok::<_, Infallible>(Event::default().data(&*text)), views))
            });
            Sse::new(events).keep_alive(KeepAlive::default())
        }
    };
    // Pages of other sites cannot send this header without a CORS preflight.
    let reset = move |headers: HeaderMap| {
        let own = headers.contains_key("x-tactnet");
        if own {
            reset();
        }
        async move {
            if own {
                StatusCode::OK
            } else {
                StatusCode::FORBIDDEN
            }
        }
    };
    let mut router = Router::new()
        .route("/events", get(events))
        .route("/reset", post(reset));
    for (path, kind, text) in PAGE {
        let answer = move || async move { ([(CONTENT_TYPE, kind)], text) };
        router = router.route(path, get(answer));
    }
    serve(listener, router)
}

fn serve(listener: TcpListener, router: Router) -> Result<WebServer, ServeError> {
    serve_within(listener, router, Limits::default())
}

fn serve_within(
    listener: TcpListener,
    router: Router,
    limits: Limits,
) -> Result<WebServer, ServeError> {
    let address = listener.local_addr().map_err(ServeError::Web)?;
    let failed = |source| ServeError::Listen { address, source };
    let guard = Guard::at(address).map_err(failed)?;
    let router = router.layer(from_fn_with_state(guard.clone(), guard::check));
    listener.set_nonblocking(true).map_err(failed)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(failed)?;
    let (stop, stopped) = oneshot::channel::<()>();
    let run = move || {
        runtime.block_on(async {
            let Ok(listener) = tokio::net::TcpListener::from_std(listener) else {
                return;
            };
            // Open event streams never end by themselves, so they are cut off.
            tokio::select! {
                () = server::answer(listener, router, limits) => {}
                _ = stopped => {}
            }
        });
    };
    let thread = std::thread::Builder::new().name("web".into());
    let thread = thread.spawn(run).map_err(failed)?;
    Ok(WebServer {
        address,
        guard,
        stop: Some(stop),
        thread: Some(thread),
    })
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpStream;
    use std::time::{Duration, Instant};

    use super::*;

    fn asked(stream: &mut TcpStream, path: &str, host: &str) -> String {
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
        let mut answer = [0; 4096];
        let read = stream.read(&mut answer).unwrap();
        String::from_utf8_lossy(&answer[..read]).into_owned()
    }

    /// Returns true if the server closes the connection within two seconds.
    fn is_closed(stream: &mut TcpStream) -> bool {
        stream
            .set_read_timeout(Some(Duration::from_secs(2)))
            .unwrap();
        let mut rest = Vec::new();
        match stream.read_to_end(&mut rest) {
            Ok(_) => true,
            Err(error) => error.kind() == std::io::ErrorKind::ConnectionReset,
        }
    }

    #[test]
    fn idle_and_slow_clients_are_let_go_and_never_more_than_the_limit_are_held() {
        let limits = Limits {
            connections: 4,
            head: Duration::from_millis(300),
            ..Limits::default()
        };
        let listener = listen("127.0.0.1:0".parse().unwrap()).unwrap();
        let router = Router::new().route("/", get(|| async { "here" }));
        let server = serve_within(listener, router, limits).unwrap();
        let open = || TcpStream::connect(server.address()).unwrap();
        let mut held: Vec<TcpStream> = (0..4).map(|_| open()).collect();
        for stream in &mut held {
            assert!(asked(stream, "/", "localhost").ends_with("here"));
        }
        // All four wait for their next request; further ones are closed.
        let begun = Instant::now();
        assert!(is_closed(&mut open()));
        assert!(begun.elapsed() < Duration::from_millis(250), "at once");
        assert!(held.iter_mut().all(is_closed), "idle ones time out");
        // Sends its request header one letter at a time.
        let mut slow = open();
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(2) && slow.write_all(b"G").is_ok() {
            std::thread::sleep(Duration::from_millis(50));
        }
        assert!(begun.elapsed() < Duration::from_millis(1500), "{begun:?}");
        assert!(asked(&mut open(), "/", "localhost").ends_with("here"));
    }

    #[test]
    fn answers_forbid_frames_and_foreign_content_and_foreign_names_get_none() {
        let listener = listen("127.0.0.1:0".parse().unwrap()).unwrap();
        let router = Router::new().route("/", get(|| async { "here" }));
        let server = serve(listener, router).unwrap();
        let open = || TcpStream::connect(server.address()).unwrap();
        let answer = asked(&mut open(), "/", "127.0.0.1");
        for header in ["frame-ancestors 'none'", "nosniff", "x-frame-options: DENY"] {
            assert!(answer.contains(header), "{answer}");
        }
        let answer = asked(&mut open(), "/", "evil.example");
        assert!(answer.starts_with("HTTP/1.1 421 "), "{answer}");
        assert!(!answer.contains("here"), "{answer}");
        assert_eq!(server.link_to("/"), format!("http://{}/", server.address()));
    }
}
