//! Access control. A loopback server accepts requests addressed by number or `localhost`; other servers require the token.
//!
//! With DNS rebinding a page of another site sends that site's name as `Host`; a cross-site request names its site in
//! `Origin`. Both are refused.

use std::fs::File;
use std::io::Read;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::header::{AUTHORIZATION, COOKIE, HOST, ORIGIN, SET_COOKIE};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Environment variable with the access token of servers beyond loopback; without it a random token is generated.
pub const TOKEN_VARIABLE: &str = "TACTNET_WEB_TOKEN";
const COOKIE_NAME: &str = "tactnet";
/// Security headers of every response: no foreign content, no framing, no guessing of media types.
const SAFETY: [(&str, &str); 4] = [
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
];

/// Access rule of a server.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    /// Token required if other machines can connect.
    token: Option<Arc<str>>,
}

impl Guard {
    /// Creates the access rule of a server at `address`.
    ///
    /// # Errors
    /// Fails if no random token can be generated.
    pub fn at(address: SocketAddr) -> std::io::Result<Self> {
        if address.ip().is_loopback() {
            return Ok(Self { token: None });
        }
        let given = std::env::var(TOKEN_VARIABLE).ok();
        let token = match given.filter(|token| !token.is_empty()) {
            Some(token) => token,
            None => drawn_token()?,
        };
        Ok(Self {
            token: Some(token.into()),
        })
    }

    /// Returns the query part of a link, with the token.
    pub fn query(&self) -> String {
        self.token
            .as_ref()
            .map_or_else(String::new, |token| format!("?token={token}"))
    }

    /// Returns an HTTP status and a message if the request is refused.
    fn refuse(&self, headers: &HeaderMap, uri: &Uri) -> Result<(), (StatusCode, &'static str)> {
        let host = headers.get(HOST).map(|value| value.to_str().unwrap_or(""));
        if let (None, Some(host)) = (&self.token, host)
            && !is_number_or_localhost(host)
        {
            return Err((
                StatusCode::MISDIRECTED_REQUEST,
                "address this host by its number or as `localhost`\n",
            ));
        }
        if let Some(origin) = headers.get(ORIGIN) {
            let own = host.map(|host| format!("http://{host}"));
            if own.as_deref() != origin.to_str().ok() {
                return Err((
                    StatusCode::FORBIDDEN,
                    "requested from a page of another site\n",
                ));
            }
        }
        match &self.token {
            Some(token) if !given_tokens(headers, uri).any(|given| same(given, token)) => Err((
                StatusCode::UNAUTHORIZED,
                "open the printed link with the token, or send `Authorization: Bearer TOKEN`\n",
            )),
            _ => Ok(()),
        }
    }
}

/// Handles a request if it is allowed, and adds the security headers to the response.
pub(super) async fn check(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    let asked = guard.refuse(request.headers(), request.uri());
    let by_link = query_token(request.uri()).is_some();
    let mut response = match asked {
        Ok(()) => next.run(request).await,
        Err(refusal) => refusal.into_response(),
    };
    if let (Ok(()), Some(token), true) = (asked, &guard.token, by_link) {
        let cookie = format!("{COOKIE_NAME}={token}; Path=/; HttpOnly; SameSite=Strict");
        if let Ok(cookie) = HeaderValue::from_str(&cookie) {
            response.headers_mut().insert(SET_COOKIE, cookie);
        }
    }
    for (name, value) in SAFETY {
        response.headers_mut().insert(
            HeaderName::from_static(name),
            HeaderValue::from_static(value),
        );
    }
    response
}

/// Returns true if another site cannot have this host name: an IP address or `localhost`.
fn is_number_or_localhost(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or(""),
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok()
}

fn given_tokens<'a>(headers: &'a HeaderMap, uri: &'a Uri) -> impl Iterator<Item = &'a str> {
    let text = |value: &'a HeaderValue| value.to_str().ok();
    let bearer = headers
        .get_all(AUTHORIZATION)
        .into_iter()
        .filter_map(text)
        .filter_map(|value| value.strip_prefix("Bearer "));
    let cookies = headers
        .get_all(COOKIE)
        .into_iter()
        .filter_map(text)
        .flat_map(|value| value.split(';'))
        .filter_map(|pair| pair.trim().strip_prefix(COOKIE_NAME)?.strip_prefix('='));
    query_token(uri).into_iter().chain(bearer).chain(cookies)
}

fn query_token(uri: &Uri) -> Option<&str> {
    let mut pairs = uri.query()?.split('&');
    pairs.find_map(|pair| pair.strip_prefix("token="))
}

/// Compares in constant time.
fn same(given: &str, token: &str) -> bool {
    let pairs = given.bytes().zip(token.bytes());
    given.len() == token.len() && pairs.fold(0, |all, (a, b)| all | (a ^ b)) == 0
}

fn drawn_token() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(guard: &Guard, uri: &str, headers: &[(&str, &str)]) -> u16 {
        let map: HeaderMap = headers
            .iter()
            .map(|(name, value)| {
                let name = HeaderName::from_bytes(name.as_bytes()).unwrap();
                (name, HeaderValue::from_str(value).unwrap())
            })
            .collect();
        match guard.refuse(&map, &uri.parse().unwrap()) {
            Ok(()) => 200,
            Err((status, _)) => status.as_u16(),
        }
    }

    #[test]
    fn names_of_other_sites_are_not_answered() {
        let guard = Guard::at("127.0.0.1:8750".parse().unwrap()).unwrap();
        assert_eq!(guard.query(), "");
        for (host, origin, status) in [
            ("127.0.0.1:8750", None, 200),
            ("localhost:8750", Some("http://localhost:8750"), 200),
            ("[::1]:8750", None, 200),
            ("evil.example", Some("http://evil.example"), 421),
            ("localhost.evil.example:8750", None, 421),
            ("127.0.0.1.evil.example", None, 421),
            ("", None, 421),
            ("127.0.0.1:8750", Some("http://evil.example"), 403),
            ("127.0.0.1:8750", Some("null"), 403),
            ("127.0.0.1:8750", Some("http://127.0.0.1:9000"), 403),
        ] {
            let mut headers = vec![("host", host), ("x-tactnet", "1")];
            headers.extend(origin.map(|origin| ("origin", origin)));
            assert_eq!(asked(&guard, "/reset", &headers), status, "{headers:?}");
        }
        assert_eq!(asked(&guard, "/metrics", &[]), 200, "no browser");
    }

    #[test]
    fn beyond_loopback_everybody_needs_the_token() {
        let guard = Guard::at("0.0.0.0:8750".parse().unwrap()).unwrap();
        let token = guard.token.clone().unwrap();
        assert_eq!(token.len(), 32);
        let other = Guard::at("0.0.0.0:8750".parse().unwrap()).unwrap();
        assert_ne!(Some(&token), other.token.as_ref());
        let with = |name: &'static str, value: String| {
            asked(&guard, "/events", &[("host", "robot:8750"), (name, &value)])
        };
        assert_eq!(with("accept", "*/*".into()), 401);
        assert_eq!(with("authorization", format!("Bearer {token}")), 200);
        assert_eq!(with("authorization", format!("Bearer {token}0")), 401);
        assert_eq!(with("cookie", format!("a=b; tactnet={token}")), 200);
        assert_eq!(with("cookie", format!("tactnet={}", &token[1..])), 401);
        let link = format!("/?token={token}");
        assert_eq!(asked(&guard, &link, &[("host", "robot:8750")]), 200);
        assert_eq!(format!("/{}", guard.query()), link);
        let elsewhere = [("host", "robot:8750"), ("origin", "http://evil.example")];
        assert_eq!(asked(&guard, &link, &elsewhere), 403);
    }
}
