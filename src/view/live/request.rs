//! What somebody asks of the server, and whether they may. Bytes in, a decision out.

use httparse::{EMPTY_HEADER, Status};

/// Most lines of a head.
const LINES: usize = 64;

/// What can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// The page.
    Page,
    /// What is told from now on.
    Frames,
    /// That the robot comes to rest.
    Stop,
}

/// Why not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Denial {
    /// These bytes are no HTTP.
    NoRequest,
    /// There is nothing at that address; without its token all addresses are wrong.
    NoSuchPlace,
    /// Another way to ask than this place is asked in.
    NoSuchWay,
    /// A page from elsewhere asks, or this server was called by another name than its own.
    Stranger,
    /// There are enough.
    TooMany,
}

impl Denial {
    /// Status line and words.
    pub const fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::NoRequest => ("400 Bad Request", "this is no request\n"),
            Self::NoSuchPlace => (
                "404 Not Found",
                "nothing is here: open the address that gaitway printed, all of it\n",
            ),
            Self::NoSuchWay => {
                ("405 Method Not Allowed", "GET the page and its frames, POST stop\n")
            }
            Self::Stranger => ("403 Forbidden", "only the page itself may ask\n"),
            Self::TooMany => ("503 Service Unavailable", "enough others look on\n"),
        }
    }
}

/// A request's line, and of its head what matters.
#[derive(Debug, PartialEq, Eq)]
pub struct PageRequest {
    method: String,
    path: String,
    host: Vec<String>,
    origin: Vec<String>,
}

impl PageRequest {
    /// Reads the head of a request.
    ///
    /// # Errors
    /// Bytes that are no HTTP/1.
    pub fn read(bytes: &[u8]) -> Result<Self, Denial> {
        let mut lines = [EMPTY_HEADER; LINES];
        let mut request = httparse::Request::new(&mut lines);
        let Ok(Status::Complete(_)) = request.parse(bytes) else { return Err(Denial::NoRequest) };
        let all = |name: &str| -> Vec<String> {
            let named = request.headers.iter().filter(|line| line.name.eq_ignore_ascii_case(name));
            named.map(|line| String::from_utf8_lossy(line.value).into_owned()).collect()
        };
        let (host, origin) = (all("host"), all("origin"));
        let word = |of: Option<&str>| of.unwrap_or_default().to_owned();
        Ok(Self { method: word(request.method), path: word(request.path), host, origin })
    }

    /// What is asked for, by whoever knows the token, of a server at this port of the loopback.
    ///
    /// # Errors
    /// See [`Denial`].
    pub fn asks(&self, token: &str, port: u16) -> Result<Asked, Denial> {
        // A name that somebody else resolved to this machine is none of its own (DNS rebinding).
        let own = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}"));
        let is_own = |said: &String| own.contains(said);
        let comes_from_here =
            |origin: &String| own.iter().any(|host| *origin == format!("http://{host}"));
        if self.host.len() != 1 || !self.host.iter().all(is_own) {
            return Err(Denial::Stranger);
        }
        if !self.origin.iter().all(comes_from_here) {
            return Err(Denial::Stranger);
        }
        let rest = self.path.strip_prefix('/').and_then(|path| path.strip_prefix(token));
        let (asked, way) = match rest {
            Some("/") => (Asked::Page, "GET"),
            Some("/frames") => (Asked::Frames, "GET"),
            Some("/stop") => (Asked::Stop, "POST"),
            _ => return Err(Denial::NoSuchPlace),
        };
        if self.method == way { Ok(asked) } else { Err(Denial::NoSuchWay) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TOKEN: &str = "00ff";

    fn asked(text: &str) -> Result<Asked, Denial> {
        PageRequest::read(text.as_bytes()).and_then(|request| request.asks(TOKEN, 8000))
    }

    #[test]
    fn the_page_and_what_it_needs_are_given_to_whoever_knows_the_address() {
        for host in ["127.0.0.1:8000", "localhost:8000"] {
            let get = |path| asked(&format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n"));
            assert_eq!(get("/00ff/"), Ok(Asked::Page));
            assert_eq!(get("/00ff/frames"), Ok(Asked::Frames));
            assert_eq!(get("/00ff/stop"), Err(Denial::NoSuchWay));
            for wrong in ["/", "/00ff", "/00fe/", "/00ff/../00ff/", "/00ff/x", "//00ff/", "/00FF/"]
            {
                assert_eq!(get(wrong), Err(Denial::NoSuchPlace), "{wrong}");
            }
        }
        let stop = "POST /00ff/stop HTTP/1.1\r\nhost: 127.0.0.1:8000\r\nOrigin: http://127.0.0.1:8000\r\n\r\n";
        assert_eq!(asked(stop), Ok(Asked::Stop));
    }

    #[test]
    fn pages_from_elsewhere_and_other_names_of_this_machine_are_strangers() {
        for head in [
            "Host: evil.example:8000",
            "Host: 127.0.0.1:8001",
            "Host: 127.0.0.1",
            "X: y",
            "Host: 127.0.0.1:8000\r\nHost: evil.example",
            "Host: 127.0.0.1:8000\r\nOrigin: https://evil.example",
            "Host: 127.0.0.1:8000\r\nOrigin: null",
            "Host: 127.0.0.1:8000\r\nOrigin: http://127.0.0.1:8001",
            "Host: 127.0.0.1:8000\r\nOrigin: http://127.0.0.1:8000.evil.example",
        ] {
            for (way, path) in [("GET", "/00ff/"), ("GET", "/00ff/frames"), ("POST", "/00ff/stop")]
            {
                let request = format!("{way} {path} HTTP/1.1\r\n{head}\r\n\r\n");
                assert_eq!(asked(&request), Err(Denial::Stranger), "{request}");
            }
        }
    }

    #[test]
    fn what_is_no_request_is_refused() {
        for text in ["", "\r\n\r\n", "GET\r\n\r\n", "GET / HTTP/9\r\n\r\n", "\u{0}\u{1}\r\n\r\n"] {
            assert_eq!(asked(text), Err(Denial::NoRequest), "{text:?}");
        }
        let many = "A: b\r\n".repeat(LINES + 1);
        assert_eq!(asked(&format!("GET /00ff/ HTTP/1.1\r\n{many}\r\n")), Err(Denial::NoRequest));
    }

    proptest! {
        #[test]
        fn no_bytes_break_it(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = PageRequest::read(&bytes).map(|request| request.asks(TOKEN, 8000));
        }
    }
}
