//! Downloads from a local server that follows a script, one connection after the other.

mod public_set;
mod script;

use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
use std::time::Duration;

use super::*;
use script::{Reply, Server};

const PAGE: &str = "https://example.org/page";
/// Checksum of [`Workplace::content`], from `git hash-object`.
const BLOB_ID: &str = "4b5aafc78e13e1979389caabe88bd0fbc339398e";

/// Checksum of `hello` and a line feed.
const HELLO: &str = "ce013625030ba8dba906f756967f9e9ca394464a";

fn source(url: String) -> Source {
    Source {
        url,
        page: PAGE.into(),
        git_blob_id: BLOB_ID.into(),
    }
}

/// Returns the answer to a request for bytes behind the end of the file.
fn nothing() -> Reply {
    let range = [("Content-Range", "bytes */200000")];
    Reply::new("416 Range Not Satisfiable", &range, b"")
}

/// Folder to download into, and the content to download.
struct Workplace {
    directory: tempfile::TempDir,
    content: Vec<u8>,
}

impl Workplace {
    fn new() -> Self {
        let content = (0..200_000u32).map(|i| (i % 251) as u8).collect();
        Self {
            directory: tempfile::tempdir().unwrap(),
            content,
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    fn out(&self) -> PathBuf {
        self.path("tactmat.h5")
    }

    fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.directory.path()).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// Creates the files that an attempt leaves which was interrupted after `bytes`.
    fn leave_part(&self, bytes: usize, etag: Option<&str>) {
        fs::write(self.path("tactmat.h5.part"), &self.content[..bytes]).unwrap();
        if let Some(etag) = etag {
            fs::write(self.path("tactmat.h5.part.etag"), etag).unwrap();
        }
    }

    fn fetch_from(
        &self,
        address: &str,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Fetched, FetchError> {
        let source = source(format!("http://{address}/data/tactmat.h5"));
        let patience = Patience {
            connect: Duration::from_secs(5),
            response: Duration::from_secs(5),
            silence: Duration::from_millis(300),
        };
        let agent = patience.config().proxy(None).build().new_agent();
        fetch_with(&agent, &source, &self.out(), progress)
    }

    fn fetch(&self, replies: Vec<Reply>) -> Result<Fetched, FetchError> {
        let server = Server::start(replies);
        let fetched = self.fetch_from(&server.address, &mut |_| {});
        server.finish();
        fetched
    }

    /// Downloads, and expects the right file and no other.
    fn fetch_all(&self, replies: Vec<Reply>, resumed_from: u64) {
        let fetched = self.fetch(replies).unwrap();
        assert_eq!(fetched.path, self.out());
        assert_eq!(fetched.bytes, 200_000);
        assert_eq!(fetched.origin, Origin::Downloaded { resumed_from });
        assert!(fs::read(self.out()).unwrap() == self.content);
        assert_eq!(self.files(), ["tactmat.h5"]);
    }

    /// Downloads, and expects a message of one line.
    fn complaint(&self, replies: Vec<Reply>) -> String {
        let error = self.fetch(replies).unwrap_err().to_string();
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(!self.out().exists());
        error
    }
}

#[test]
fn a_file_is_downloaded_and_its_progress_told() {
    let work = Workplace::new();
    let server = Server::start(vec![
        Reply::whole(&work.content)
            .if_not_asked("range")
            .if_asked("accept-encoding", "identity"),
    ]);
    let mut seen = Vec::new();
    let fetched = work
        .fetch_from(&server.address, &mut |progress| seen.push(progress))
        .unwrap();
    server.finish();
    assert_eq!(fetched.origin, Origin::Downloaded { resumed_from: 0 });
    assert!(fs::read(work.out()).unwrap() == work.content);
    assert_eq!(work.files(), ["tactmat.h5"]);
    assert!(seen.is_sorted_by_key(|progress| progress.done_bytes));
    assert!(
        seen.iter()
            .all(|p| p.total_bytes == Some(200_000) && p.resumed_from == 0)
    );
    assert_eq!(
        (seen[0].done_bytes, seen[seen.len() - 1].done_bytes),
        (0, 200_000)
    );
}

#[test]
fn a_file_without_announced_length_is_downloaded() {
    let work = Workplace::new();
    let content = work.content.clone();
    work.fetch_all(vec![Reply::new("200 OK", &[], &content)], 0);
}

#[test]
fn a_redirect_is_followed() {
    let work = Workplace::new();
    work.fetch_all(
        vec![
            Reply::new(
                "302 Found",
                &[("Location", "/elsewhere"), ("Content-Length", "0")],
                b"",
            ),
            Reply::whole(&work.content),
        ],
        0,
    );
}

#[test]
fn directories_are_made_on_the_way() {
    let work = Workplace::new();
    let server = Server::start(vec![Reply::whole(&work.content)]);
    let source = source(format!("http://{}/tactmat.h5", server.address));
    let out = work.path("deep/er/tactmat.h5");
    let agent = Patience::default().config().proxy(None).build().new_agent();
    fetch_with(&agent, &source, &out, &mut |_| {}).unwrap();
    server.finish();
    assert!(out.exists());
}

#[test]
fn a_broken_download_is_resumed_where_it_broke_off() {
    let work = Workplace::new();
    let error = work.complaint(vec![Reply::whole(&work.content).cut_after(70_000)]);
    assert!(
        error.contains("broke off after 70000 of 200000 bytes"),
        "{error}"
    );
    assert!(
        error.contains("tactmat.h5.part: run the same command again to resume"),
        "{error}"
    );
    assert_eq!(work.files(), ["tactmat.h5.part", "tactmat.h5.part.etag"]);

    let server = Server::start(vec![
        Reply::rest(&work.content, 70_000)
            .if_asked("range", "bytes=70000-")
            .if_asked("if-range", "\"v1\""),
    ]);
    let mut seen = Vec::new();
    let fetched = work
        .fetch_from(&server.address, &mut |progress| seen.push(progress))
        .unwrap();
    server.finish();
    assert_eq!(
        fetched.origin,
        Origin::Downloaded {
            resumed_from: 70_000
        }
    );
    assert!(fs::read(work.out()).unwrap() == work.content);
    assert_eq!(work.files(), ["tactmat.h5"]);
    let first = Progress {
        done_bytes: 70_000,
        total_bytes: Some(200_000),
        resumed_from: 70_000,
    };
    assert_eq!(seen[0], first);
    assert_eq!(seen[seen.len() - 1].done_bytes, 200_000);
}

#[test]
fn a_rest_that_is_cut_again_is_kept_too() {
    let work = Workplace::new();
    work.leave_part(50_000, None);
    let cut = Reply::rest(&work.content, 50_000).cut_after(1_000);
    let error = work.complaint(vec![
        cut.if_asked("range", "bytes=50000-")
            .if_not_asked("if-range"),
    ]);
    assert!(error.contains("after 51000 of 200000 bytes"), "{error}");
    let rest = Reply::rest(&work.content, 51_000).if_asked("range", "bytes=51000-");
    work.fetch_all(vec![rest], 51_000);
}

#[test]
fn a_rest_shorter_than_asked_for_is_no_complete_file() {
    let work = Workplace::new();
    work.leave_part(50_000, None);
    let reply = Reply::new(
        "206 Partial Content",
        &[("Content-Range", "bytes 50000-59999/200000")],
        &work.content[50_000..60_000],
    )
    .header("Content-Length", 10_000);
    let error = work.complaint(vec![reply]);
    assert!(
        error.contains("after 60000 of 200000 bytes (the server stopped sending)"),
        "{error}"
    );
}

#[test]
fn a_server_that_falls_silent_is_left() {
    let work = Workplace::new();
    let error = work.complaint(vec![
        Reply::whole(&work.content).cut_after(10).then_silent(),
    ]);
    assert!(
        error.contains("broke off after 10 of 200000 bytes (timeout"),
        "{error}"
    );
}

#[test]
fn a_server_without_ranges_makes_the_download_start_over() {
    let work = Workplace::new();
    work.leave_part(70_000, Some("\"v1\""));
    work.fetch_all(
        vec![Reply::whole(&work.content).if_asked("range", "bytes=70000-")],
        0,
    );
}

#[test]
fn a_file_that_changed_is_downloaded_from_its_beginning() {
    let work = Workplace::new();
    work.leave_part(70_000, Some("\"v0\""));
    work.fetch_all(
        vec![Reply::whole(&work.content).if_asked("if-range", "\"v0\"")],
        0,
    );

    // The same case with a server that does not support `If-Range`.
    let work = Workplace::new();
    work.leave_part(70_000, Some("\"v0\""));
    let replies = vec![
        Reply::rest(&work.content, 70_000).if_asked("if-range", "\"v0\""),
        Reply::whole(&work.content)
            .if_not_asked("range")
            .if_not_asked("if-range"),
    ];
    work.fetch_all(replies, 0);
}

#[test]
fn a_rest_from_another_place_makes_the_download_start_over() {
    let work = Workplace::new();
    work.leave_part(70_000, None);
    let replies = vec![
        Reply::rest(&work.content, 69_999),
        Reply::whole(&work.content).if_not_asked("range"),
    ];
    work.fetch_all(replies, 0);
}

#[test]
fn a_part_that_has_every_byte_needs_none() {
    let work = Workplace::new();
    work.leave_part(200_000, Some("\"v1\""));
    work.fetch_all(vec![nothing().if_asked("range", "bytes=200000-")], 200_000);
}

#[test]
fn a_part_longer_than_the_file_makes_the_download_start_over() {
    let work = Workplace::new();
    work.leave_part(200_000, None);
    fs::write(work.path("tactmat.h5.part"), vec![0; 300_000]).unwrap();
    work.fetch_all(
        vec![
            nothing().header("Content-Length", 0),
            Reply::whole(&work.content),
        ],
        0,
    );
}

#[test]
fn wrong_content_is_named_and_removed() {
    let work = Workplace::new();
    let error = work.complaint(vec![Reply::whole(b"hello\n")]);
    assert!(
        error.contains(&format!(
            "expected content with git blob id {BLOB_ID}, found {HELLO} (6 bytes)"
        )),
        "{error}"
    );
    assert!(
        error.contains("removed it: run the same command again"),
        "{error}"
    );
    assert!(error.contains(PAGE), "{error}");
    assert_eq!(work.files(), Vec::<String>::new());
    work.fetch_all(vec![Reply::whole(&work.content).if_not_asked("range")], 0);
}

#[test]
fn a_spoiled_part_is_found_out_in_the_end() {
    let work = Workplace::new();
    work.leave_part(70_000, None);
    fs::write(work.path("tactmat.h5.part"), vec![7; 70_000]).unwrap();
    let error = work.complaint(vec![Reply::rest(&work.content, 70_000)]);
    assert!(error.contains("(200000 bytes); removed it"), "{error}");
    assert_eq!(work.files(), Vec::<String>::new());
}

#[test]
fn a_missing_file_sends_people_to_the_page() {
    let work = Workplace::new();
    work.leave_part(70_000, Some("\"v1\""));
    let error = work.complaint(vec![Reply::new(
        "404 Not Found",
        &[("Content-Length", "0")],
        b"",
    )]);
    assert!(
        error.contains("/data/tactmat.h5: the server answered 404 Not Found: find the file on"),
        "{error}"
    );
    assert!(error.contains(PAGE), "{error}");
    assert_eq!(work.files(), ["tactmat.h5.part", "tactmat.h5.part.etag"]);
}

#[test]
fn without_network_one_line_says_what_to_do() {
    let work = Workplace::new();
    let nobody = {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        listener.local_addr().unwrap().to_string()
    };
    // Names with a part of more than 63 letters are refused without a look-up.
    let no_name = format!("{}.invalid", "x".repeat(64));
    for address in [&nobody, &no_name] {
        let error = work.fetch_from(address, &mut |_| {}).unwrap_err();
        assert!(matches!(error, FetchError::Unreachable { .. }), "{error:?}");
        assert_eq!(error.remedy(), Some(Remedy::PassDownloadedFile));
        let error = error.to_string();
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(
            error.contains(address.as_str()) && error.contains(PAGE),
            "{error}"
        );
    }
    assert_eq!(work.files(), Vec::<String>::new());
}

#[test]
fn a_server_that_cannot_prove_who_it_is_counts_as_none() {
    let work = Workplace::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let source = source(format!("https://{address}/tactmat.h5"));
    let thread = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream
            .write_all(b"HTTP/1.1 400 This is no TLS\r\n\r\n")
            .unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        let _ = stream.read_to_end(&mut Vec::new());
    });
    let agent = Patience::default().config().proxy(None).build().new_agent();
    let error = fetch_with(&agent, &source, &work.out(), &mut |_| {}).unwrap_err();
    thread.join().unwrap();
    assert!(
        matches!(&error, FetchError::Unreachable { reason, .. } if reason.contains("InvalidContentType")),
        "{error}"
    );
}

#[test]
fn a_file_that_is_there_is_recognised_without_network() {
    let work = Workplace::new();
    fs::write(work.out(), &work.content).unwrap();
    let fetched = work.fetch(vec![]).unwrap();
    assert_eq!(fetched.origin, Origin::AlreadyThere);
    assert_eq!(fetched.bytes, 200_000);
}

#[test]
fn a_strange_file_in_the_place_is_left_alone() {
    let work = Workplace::new();
    fs::write(work.out(), "mine").unwrap();
    let error = work.fetch(vec![]).unwrap_err().to_string();
    assert!(
        error.contains(&format!(
            "tactmat.h5: expected git blob id {BLOB_ID}, found another file"
        )),
        "{error}"
    );
    assert_eq!(fs::read(work.out()).unwrap(), b"mine");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_of_the_part() {
    let work = Workplace::new();
    std::os::unix::fs::symlink("/dev/full", work.path("tactmat.h5.part")).unwrap();
    let error = work
        .fetch(vec![Reply::whole(&work.content).cut_after(1_000)])
        .unwrap_err();
    let FetchError::Disk(DataError::Io {
        path,
        action: "write",
        source,
    }) = error
    else {
        panic!("{error:?}");
    };
    assert_eq!(path, work.path("tactmat.h5.part"));
    assert_eq!(source.kind(), ErrorKind::StorageFull);
}

#[test]
fn tactmat_is_where_its_authors_put_it() {
    let source = Source::tactmat();
    assert!(source.url.starts_with(&source.page) && source.url.ends_with("/data/tactmat.h5"));
    assert_eq!(source.git_blob_id.len(), 40);
}

#[test]
fn no_download_fails_by_a_mistake_in_the_call() {
    let unreachable = FetchError::Unreachable {
        url: "https://example.org/file".into(),
        reason: "no such host".into(),
        page: PAGE.into(),
    };
    assert!(!unreachable.is_usage());
    let full = std::io::Error::from(ErrorKind::StorageFull);
    let disk = FetchError::from(DataError::io(Path::new("file.part"), "write", full));
    assert!(!disk.is_usage());
}
