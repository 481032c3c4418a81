//! Answers to browsers and Prometheus: one thread with a small HTTP server.

mod dashboard;
mod listen;
mod objects;
mod view;

use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::JoinHandle;

use axum::Router;
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HeaderMap};
use axum::response::IntoResponse;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::routing::{get, post};
use futures_util::stream;
use tokio::sync::{oneshot, watch};

use crate::{Measures, ServeError};
pub use dashboard::Dashboard;
pub use listen::{Holder, listen};

/// A server; it ends when this is dropped.
#[derive(Debug)]
pub struct WebServer {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl WebServer {
    /// Returns the address that it listens at.
    pub fn address(&self) -> SocketAddr {
        self.address
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

/// Answers `/metrics` in Prometheus's format.
///
/// # Errors
/// The address cannot be had.
pub fn metrics(address: SocketAddr, measures: Arc<Measures>) -> Result<WebServer, ServeError> {
    let answer = move || {
        let text = measures.prometheus();
        async move { ([(CONTENT_TYPE, "text/plain; version=0.0.4")], text).into_response() }
    };
    let router = Router::new().route("/metrics", get(answer));
    serve(listen(address)?, router)
}

/// The page and what belongs to it: path, type and text. It needs nothing else.
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

/// Answers with the page, and `/events` with a stream of `views`; `reset` is called when somebody asks for it.
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
    // A header of our own: pages of other sites cannot send it without being asked first.
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
    let address = listener.local_addr().map_err(ServeError::Web)?;
    let failed = |source| ServeError::Listen { address, source };
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
            let server = axum::serve(listener, router);
            // Open streams of events never end by themselves, so they are cut off.
            tokio::select! {
                _ = server => {}
                _ = stopped => {}
            }
        });
    };
    let thread = std::thread::Builder::new().name("web".into());
    let thread = thread.spawn(run).map_err(failed)?;
    Ok(WebServer {
        address,
        stop: Some(stop),
        thread: Some(thread),
    })
}
