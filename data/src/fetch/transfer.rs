//! HTTP download into a part file that resumes an interrupted attempt.

use super::part::Part;
use super::{FetchError, Progress, Source};
use crate::DataError;
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::time::Duration;
use ureq::config::ConfigBuilder;
use ureq::http::header::{CONTENT_LENGTH, CONTENT_RANGE, ETAG, HeaderMap, HeaderName};
use ureq::http::{Response, StatusCode};
use ureq::typestate::AgentScope;
use ureq::{Agent, Body};

/// Timeouts of a silent server. The whole download has no time limit.
pub(super) struct Patience {
    /// Timeout of the name look-up, and of connection and TLS together.
    pub(super) connect: Duration,
    /// Timeout from the request to the end of the response's header.
    pub(super) response: Duration,
    /// Timeout between two pieces of the content.
    pub(super) silence: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            connect: Duration::from_secs(20),
            response: Duration::from_secs(30),
            silence: Duration::from_secs(30),
        }
    }
}

impl Patience {
    /// Returns the client's settings. The environment names the proxy (`HTTPS_PROXY`, `NO_PROXY`).
    pub(super) fn config(&self) -> ConfigBuilder<AgentScope> {
        Agent::config_builder()
            .http_status_as_error(false)
            .user_agent(concat!("tactnet/", env!("CARGO_PKG_VERSION")))
            .timeout_resolve(Some(self.connect))
            .timeout_connect(Some(self.connect))
            .timeout_recv_response(Some(self.response))
            .timeout_per_read(Some(self.silence))
    }
}

/// Completes `part` and returns the number of bytes that it had before.
///
/// Requests only the missing bytes, on condition (`If-Range`) that the content is the version that the part belongs to.
/// If the server sends all bytes or another range, the download starts anew, at most once.
pub(super) fn transfer(
    agent: &Agent,
    source: &Source,
    part: &Part,
    progress: &mut dyn FnMut(Progress),
) -> Result<u64, FetchError> {
    let mut there = part.len()?;
    loop {
        let etag = if there > 0 { part.etag()? } else { None };
        let response = ask(agent, source, there, etag.as_deref())?;
        let headers = response.headers();
        match Answer::read(response.status(), headers, there, etag.as_deref()) {
            Answer::Whole { total } => {
                let file = part.start(strong_etag(headers))?;
                let state = Progress {
                    done_bytes: 0,
                    total_bytes: total,
                    resumed_from: 0,
                };
                receive(response, file, source, part, state, progress)?;
                return Ok(0);
            }
            Answer::Rest { total } => {
                let file = part.append()?;
                let state = Progress {
                    done_bytes: there,
                    total_bytes: total,
                    resumed_from: there,
                };
                receive(response, file, source, part, state, progress)?;
                return Ok(there);
            }
            Answer::NothingLeft => return Ok(there),
            Answer::OtherContent => {
                part.remove()?;
                there = 0;
            }
            Answer::Refusal => {
                return Err(FetchError::Refused {
                    url: source.url.clone(),
                    status: response.status().to_string(),
                    page: source.page.clone(),
                });
            }
        }
    }
}

fn ask(
    agent: &Agent,
    source: &Source,
    there: u64,
    etag: Option<&str>,
) -> Result<Response<Body>, FetchError> {
    let mut request = agent.get(&source.url).header("Accept-Encoding", "identity");
    if there > 0 {
        request = request.header("Range", format!("bytes={there}-"));
        if let Some(etag) = etag {
            request = request.header("If-Range", etag);
        }
    }
    request.call().map_err(|error| FetchError::Unreachable {
        url: source.url.clone(),
        reason: error.to_string(),
        page: source.page.clone(),
    })
}

/// Meaning of a response for a part of `there` bytes.
#[derive(Debug, PartialEq, Eq)]
enum Answer {
    /// The response has all of the content, from its first byte.
    Whole { total: Option<u64> },
    /// The response has the content from byte `there` on.
    Rest { total: Option<u64> },
    /// The part already has all bytes.
    NothingLeft,
    /// The part belongs to another version of the file.
    OtherContent,
    /// The response has no content.
    Refusal,
}

impl Answer {
    fn read(status: StatusCode, headers: &HeaderMap, there: u64, etag: Option<&str>) -> Self {
        let range = text(headers, CONTENT_RANGE).and_then(ContentRange::parse);
        match (status, range) {
            (StatusCode::OK, _) => Self::Whole {
                total: text(headers, CONTENT_LENGTH).and_then(|n| n.parse().ok()),
            },
            (
                StatusCode::PARTIAL_CONTENT,
                Some(ContentRange {
                    first: Some(first),
                    total,
                }),
            ) if there > 0
                && first == there
                && (etag.is_none() || etag == strong_etag(headers)) =>
            {
                Self::Rest { total }
            }
            (StatusCode::RANGE_NOT_SATISFIABLE, Some(ContentRange { first: None, total }))
                if there > 0 && total == Some(there) =>
            {
                Self::NothingLeft
            }
            (StatusCode::PARTIAL_CONTENT | StatusCode::RANGE_NOT_SATISFIABLE, _) if there > 0 => {
                Self::OtherContent
            }
            _ => Self::Refusal,
        }
    }
}

/// Range of the header `Content-Range` (RFC 9110, 14.4): `bytes 5-9/10`, `bytes 5-9/*` or `bytes */10`.
struct ContentRange {
    first: Option<u64>,
    total: Option<u64>,
}

impl ContentRange {
    fn parse(value: &str) -> Option<Self> {
        let (range, total) = value.strip_prefix("bytes ")?.trim().split_once('/')?;
        let total = if total == "*" {
            None
        } else {
            Some(total.parse().ok()?)
        };
        let first = match range.split_once('-') {
            Some((first, _)) => Some(first.parse().ok()?),
            None if range == "*" => None,
            None => return None,
        };
        Some(Self { first, total })
    }
}

fn text(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

/// Returns the ETag if it is strong: `If-Range` requires equality byte by byte.
fn strong_etag(headers: &HeaderMap) -> Option<&str> {
    text(headers, ETAG).filter(|etag| etag.starts_with('"'))
}

fn receive(
    response: Response<Body>,
    mut file: File,
    source: &Source,
    part: &Part,
    mut state: Progress,
    progress: &mut dyn FnMut(Progress),
) -> Result<(), FetchError> {
    let unwritable = |error| DataError::io(part.path(), "write", error);
    let cut = |state: Progress, reason: String| FetchError::Cut {
        url: source.url.clone(),
        done_bytes: state.done_bytes,
        total_bytes: state.total_bytes,
        reason,
        part: part.path().to_path_buf(),
    };
    let mut body = response.into_body().into_reader();
    let mut buffer = vec![0; 1 << 16];
    progress(state);
    loop {
        match body.read(&mut buffer) {
            Ok(0) => break,
            Ok(read) => {
                file.write_all(&buffer[..read]).map_err(unwritable)?;
                state.done_bytes += read as u64;
                progress(state);
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(cut(state, error.to_string())),
        }
    }
    if state
        .total_bytes
        .is_some_and(|total| state.done_bytes < total)
    {
        return Err(cut(state, "the server stopped sending".into()));
    }
    file.sync_all().map_err(unwritable)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(
        status: u16,
        headers: &[(&'static str, &str)],
        there: u64,
        etag: Option<&str>,
    ) -> Answer {
        let headers: HeaderMap = headers
            .iter()
            .map(|(name, value)| (HeaderName::from_static(name), value.parse().unwrap()))
            .collect();
        Answer::read(StatusCode::from_u16(status).unwrap(), &headers, there, etag)
    }

    #[test]
    fn a_rest_must_begin_where_the_part_ends() {
        let range = |value, there| answer(206, &[("content-range", value)], there, None);
        assert_eq!(range("bytes 5-9/10", 5), Answer::Rest { total: Some(10) });
        assert_eq!(range("bytes 5-9/*", 5), Answer::Rest { total: None });
        for odd in [
            "bytes 4-9/10",
            "bytes 6-9/10",
            "bytes */10",
            "5-9/10",
            "bytes 5-9",
            "bytes a-9/10",
            "bytes 5-9/x",
        ] {
            assert_eq!(range(odd, 5), Answer::OtherContent, "{odd}");
        }
        assert_eq!(answer(206, &[], 5, None), Answer::OtherContent);
    }

    #[test]
    fn a_rest_must_belong_to_the_content_of_the_part() {
        let served = |etag| {
            answer(
                206,
                &[("content-range", "bytes 5-9/10"), ("etag", etag)],
                5,
                Some("\"a\""),
            )
        };
        assert_eq!(served("\"a\""), Answer::Rest { total: Some(10) });
        assert_eq!(served("\"b\""), Answer::OtherContent);
        assert_eq!(served("W/\"a\""), Answer::OtherContent);
    }

    #[test]
    fn an_unsatisfiable_range_means_complete_or_changed() {
        let range = |value| answer(416, &[("content-range", value)], 10, None);
        assert_eq!(range("bytes */10"), Answer::NothingLeft);
        assert_eq!(range("bytes */9"), Answer::OtherContent);
        assert_eq!(range("bytes */*"), Answer::OtherContent);
    }

    #[test]
    fn answers_to_ranges_that_nobody_asked_for_are_refusals() {
        assert_eq!(
            answer(206, &[("content-range", "bytes 0-9/10")], 0, None),
            Answer::Refusal
        );
        assert_eq!(
            answer(416, &[("content-range", "bytes */0")], 0, None),
            Answer::Refusal
        );
        assert_eq!(answer(404, &[], 5, None), Answer::Refusal);
        assert_eq!(answer(304, &[], 5, None), Answer::Refusal);
    }

    #[test]
    fn the_whole_content_may_come_without_its_length() {
        assert_eq!(
            answer(200, &[("content-length", "10")], 5, None),
            Answer::Whole { total: Some(10) }
        );
        assert_eq!(answer(200, &[], 0, None), Answer::Whole { total: None });
    }
}
