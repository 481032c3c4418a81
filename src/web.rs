//! What browsers and Prometheus are answered: one thread with a small HTTP server, on loopback unless told otherwise.

use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::JoinHandle;

use anyhow::Context;
use axum::Router;
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HeaderMap};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{Html, IntoResponse};
use axum::routing::{get, post};
use futures_util::stream;
use tactnet_serving::Measures;
use tokio::sync::{oneshot, watch};

/// A server; it ends when this is dropped.
pub struct Web {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Web {
    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Web {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Answers `/metrics` in Prometheus's format.
pub fn metrics(address: SocketAddr, measures: Arc<Measures>) -> anyhow::Result<Web> {
    let answer = move || {
        let text = measures.prometheus();
        async move { ([(CONTENT_TYPE, "text/plain; version=0.0.4")], text).into_response() }
    };
    serve(address, Router::new().route("/metrics", get(answer)))
}

/// Answers `/` with a page and `/events` with what is news to it; `reset` is called when somebody asks for it.
pub fn dashboard(
    address: SocketAddr,
    page: &'static str,
    news: watch::Receiver<Arc<str>>,
    reset: impl Fn() + Clone + Send + Sync + 'static,
) -> anyhow::Result<Web> {
    let events = move || {
        let news = news.clone();
        async move {
            let events = stream::unfold(news, |mut news| async move {
                news.changed().await.ok()?;
                let text = news.borrow_and_update().clone();
                Some((Ok::<_, Infallible>(Event::default().data(&*text)), news))
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
    serve(
        address,
        Router::new()
            .route("/", get(move || async move { Html(page) }))
            .route("/events", get(events))
            .route("/reset", post(reset)),
    )
}

fn serve(address: SocketAddr, router: Router) -> anyhow::Result<Web> {
    let listener =
        TcpListener::bind(address).with_context(|| format!("cannot listen at {address}"))?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
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
    let thread = std::thread::Builder::new().name("web".into()).spawn(run)?;
    Ok(Web {
        address,
        stop: Some(stop),
        thread: Some(thread),
    })
}
