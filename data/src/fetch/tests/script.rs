//! A server that follows a script, one connection after the other.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const ETAG: (&str, &str) = ("ETag", "\"v1\"");

/// Behaviour of the server on one connection.
pub(super) struct Reply {
    /// Required headers of the request; `None` if the header must be absent.
    asked: Vec<(&'static str, Option<String>)>,
    status: &'static str,
    headers: Vec<(&'static str, String)>,
    body: Vec<u8>,
    /// True if the server stays silent after the body instead of closing the connection.
    then_silent: bool,
}

impl Reply {
    pub(super) fn new(status: &'static str, headers: &[(&'static str, &str)], body: &[u8]) -> Self {
        let headers = headers
            .iter()
            .map(|&(name, value)| (name, value.to_owned()))
            .collect();
        Self {
            asked: vec![],
            status,
            headers,
            body: body.to_vec(),
            then_silent: false,
        }
    }

    /// Returns all of `content`.
    pub(super) fn whole(content: &[u8]) -> Self {
        Self::new("200 OK", &[ETAG], content).header("Content-Length", content.len())
    }

    /// Returns `content` from byte `first` on.
    pub(super) fn rest(content: &[u8], first: usize) -> Self {
        let range = format!("bytes {first}-{}/{}", content.len() - 1, content.len());
        Self::new("206 Partial Content", &[ETAG], &content[first..])
            .header("Content-Length", content.len() - first)
            .header("Content-Range", range)
    }

    pub(super) fn header(mut self, name: &'static str, value: impl ToString) -> Self {
        self.headers.push((name, value.to_string()));
        self
    }

    /// Closes the connection after the first `bytes` of the body.
    pub(super) fn cut_after(mut self, bytes: usize) -> Self {
        self.body.truncate(bytes);
        self
    }

    pub(super) fn then_silent(mut self) -> Self {
        self.then_silent = true;
        self
    }

    pub(super) fn if_asked(mut self, header: &'static str, value: &str) -> Self {
        self.asked.push((header, Some(value.into())));
        self
    }

    pub(super) fn if_not_asked(mut self, header: &'static str) -> Self {
        self.asked.push((header, None));
        self
    }

    fn serve(self, mut stream: TcpStream) {
        stream.set_nonblocking(false).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        let mut request = Vec::new();
        let mut byte = [0];
        while !request.ends_with(b"\r\n\r\n") {
            assert_eq!(stream.read(&mut byte).unwrap(), 1, "the request ends early");
            request.push(byte[0]);
        }
        let request = String::from_utf8(request).unwrap();
        let sent: BTreeMap<String, &str> = (request.lines().skip(1))
            .filter_map(|line| line.split_once(": "))
            .map(|(name, value)| (name.to_lowercase(), value))
            .collect();
        for (name, value) in &self.asked {
            assert_eq!(
                sent.get(*name).copied(),
                value.as_deref(),
                "`{name}` in {request}"
            );
        }
        let headers: String = self
            .headers
            .iter()
            .map(|(name, value)| format!("{name}: {value}\r\n"))
            .collect();
        let head = format!(
            "HTTP/1.1 {}\r\nConnection: close\r\n{headers}\r\n",
            self.status
        );
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(&self.body).unwrap();
        if self.then_silent {
            let _ = stream.read(&mut byte);
        }
    }
}

/// Starts a server that gives these replies in order, each on a separate connection.
pub(super) struct Server {
    pub(super) address: String,
    thread: JoinHandle<()>,
}

impl Server {
    pub(super) fn start(replies: Vec<Reply>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let thread = std::thread::spawn(move || {
            for (number, reply) in replies.into_iter().enumerate() {
                let deadline = Instant::now() + Duration::from_secs(10);
                let stream = loop {
                    match listener.accept() {
                        Ok((stream, _)) => break stream,
                        Err(error) if error.kind() == ErrorKind::WouldBlock => {
                            assert!(Instant::now() < deadline, "nobody asked for reply {number}");
                            std::thread::sleep(Duration::from_millis(2));
                        }
                        Err(error) => panic!("{error}"),
                    }
                };
                reply.serve(stream);
            }
        });
        Self { address, thread }
    }

    /// Returns the errors that the server found in the requests.
    pub(super) fn finish(self) {
        self.thread
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    }
}
