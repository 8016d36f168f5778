//! The page, served while something happens: to browsers of this machine, one picture after the other.
//!
//! A server of one thread listens on the loopback. Whoever knows the address, which holds a random token, gets the
//! page, the stream of what is told (server-sent events, HTML Living Standard, section 9.2), and a way to wish for a
//! stop. It serves nothing else, reads no file and writes none. What is told is kept once, the newest only: a browser
//! that reads slowly sees fewer pictures, and nobody who tells ever waits.

mod request;

use super::ViewPage;
use crate::error::Error;
use crate::time::Duration;
use request::{Asked, Denial, PageRequest};
use serde::Serialize;
use std::fmt::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

/// Most connections at once, and most of them that hear the stream.
const CONNECTIONS: usize = 48;
const LISTENERS: usize = 16;
/// Longest request, bytes.
const REQUEST: usize = 8 << 10;
/// How long a request may take, and a browser to take what it asked for.
const PATIENCE: Duration = Duration::from_secs(5);
/// A stream says at least so often that it is there.
const BEAT: Duration = Duration::from_secs(2);
/// Bytes of the token.
const TOKEN: usize = 16;

/// What is told at one time. Joints are in the robot's order.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LiveFrame {
    /// Since the first, s.
    pub time_s: f64,
    /// Where each joint is to be, rad; null: nobody knows.
    pub goal_rad: Vec<Option<f64>>,
    /// Where it is, rad.
    pub present_rad: Vec<Option<f64>>,
    /// What else was read of joints just now.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<LiveQuantity>,
}

/// Another quantity of the joints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveQuantity {
    /// What it is called.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Of each joint; null: not read just now.
    pub values: Vec<Option<f64>>,
}

impl LiveFrame {
    /// A frame of goals and angles, rad; what is not finite is not known.
    #[must_use]
    pub fn of(time_s: f64, joints_rad: impl Iterator<Item = [f64; 2]>) -> Self {
        let known = |rad: f64| rad.is_finite().then(|| (rad * 1e5).round() / 1e5);
        let (goal_rad, present_rad) =
            joints_rad.map(|[goal, present]| (known(goal), known(present))).unzip();
        Self { time_s, goal_rad, present_rad, others: Vec::new() }
    }
}

/// How the server was used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LiveCounts {
    /// Pages that were given out.
    pub pages: u64,
    /// Streams that were begun.
    pub streams: u64,
    /// Requests that were refused: a wrong address, another origin, no HTTP, too many at once.
    pub refused: u64,
    /// Connections that were given up because nobody read or wrote on them.
    pub stalled: u64,
}

#[derive(Default)]
struct Counters {
    pages: AtomicU64,
    streams: AtomicU64,
    refused: AtomicU64,
    stalled: AtomicU64,
    connections: AtomicUsize,
    listeners: AtomicUsize,
}

/// What a connection needs to know.
struct Hall {
    page: String,
    token: String,
    port: u16,
    frames: watch::Receiver<Arc<str>>,
    wants_to_stop: Arc<AtomicBool>,
    /// Whether there is something that the page may stop.
    can_stop: bool,
    counters: Arc<Counters>,
}

/// A page that is served.
pub struct LiveView {
    token: String,
    port: u16,
    frames: watch::Sender<Arc<str>>,
    wants_to_stop: Arc<AtomicBool>,
    counters: Arc<Counters>,
    closed: Option<tokio::sync::oneshot::Sender<()>>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl LiveView {
    /// Serves a page to which something is told, on the loopback, at `port`, or a free one if that is 0. A page of a session
    /// stops nothing.
    ///
    /// # Errors
    /// A port that is taken, no randomness, no thread, a page that cannot be written.
    pub fn open(page: &ViewPage, port: u16) -> Result<Self, Error> {
        Self::at(page.live_html()?, port, !page.scene.is_session)
    }

    /// Serves a page that is whole.
    ///
    /// # Errors
    /// A port that is taken, no randomness, no thread.
    pub fn serving(html: String, port: u16) -> Result<Self, Error> {
        Self::at(html, port, false)
    }

    fn at(html: String, port: u16, can_stop: bool) -> Result<Self, Error> {
        let failed = |cause: std::io::Error| {
            Error::of((&cause).into(), "the page cannot be served")
                .at(format!("127.0.0.1:{port}"))
                .got(cause.to_string())
                .remedy("choose another port, or none: a free one is found")
        };
        let token = token().map_err(failed)?;
        let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let port = listener.local_addr().map_err(failed)?.port();
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()
            .map_err(failed)?;
        let (frames, newest) = watch::channel(Arc::from(""));
        let (closed, closing) = tokio::sync::oneshot::channel();
        let (wants_to_stop, counters) = (Arc::default(), Arc::<Counters>::default());
        let hall = Hall {
            page: html,
            token: token.clone(),
            port,
            frames: newest,
            wants_to_stop: Arc::clone(&wants_to_stop),
            can_stop,
            counters: Arc::clone(&counters),
        };
        let thread = std::thread::Builder::new()
            .name("view".to_owned())
            .spawn(move || {
                runtime.block_on(async move {
                    tokio::select! {
                        () = serve(listener, Arc::new(hall)) => {}
                        _ = closing => {}
                    }
                });
            })
            .map_err(failed)?;
        let (closed, thread) = (Some(closed), Some(thread));
        Ok(Self { token, port, frames, wants_to_stop, counters, closed, thread })
    }

    /// Where a browser finds it.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Tells whoever looks on; never waits.
    pub fn tell<T: Serialize>(&self, frame: &T) {
        // Numbers and nulls can always be written.
        if let Ok(text) = serde_json::to_string(frame) {
            self.frames.send_replace(format!("data: {text}\n\n").into());
        }
    }

    /// True once somebody pressed the button.
    #[must_use]
    pub fn wants_to_stop(&self) -> bool {
        self.wants_to_stop.load(Ordering::Acquire)
    }

    /// How it was used so far.
    #[must_use]
    pub fn counts(&self) -> LiveCounts {
        let of = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let Counters { pages, streams, refused, stalled, .. } = &*self.counters;
        LiveCounts {
            pages: of(pages),
            streams: of(streams),
            refused: of(refused),
            stalled: of(stalled),
        }
    }
}

impl Drop for LiveView {
    fn drop(&mut self) {
        if let Some(closed) = self.closed.take() {
            let _ = closed.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A word nobody can guess.
fn token() -> std::io::Result<String> {
    let mut bytes = [0_u8; TOKEN];
    rustix::rand::getrandom(&mut bytes, rustix::rand::GetRandomFlags::empty())?;
    Ok(bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    }))
}

/// A place that is taken as long as this lives.
struct Place<'a>(&'a AtomicUsize);

impl<'a> Place<'a> {
    fn take(count: &'a AtomicUsize, most: usize) -> Option<Self> {
        let free = |taken: usize| (taken < most).then_some(taken + 1);
        count.fetch_update(Ordering::Relaxed, Ordering::Relaxed, free).ok().map(|_| Self(count))
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

async fn serve(listener: std::net::TcpListener, hall: Arc<Hall>) {
    let Ok(listener) = TcpListener::from_std(listener) else { return };
    loop {
        match listener.accept().await {
            Ok((stream, from)) => {
                let hall = Arc::clone(&hall);
                tokio::spawn(async move { answer(stream, from, &hall).await });
            }
            // Out of file descriptors, most likely: others may be closed meanwhile.
            Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
        }
    }
}

async fn answer(mut stream: TcpStream, from: SocketAddr, hall: &Hall) {
    let counters = &hall.counters;
    let place = Place::take(&counters.connections, CONNECTIONS);
    if place.is_none() || !from.ip().is_loopback() {
        counters.refused.fetch_add(1, Ordering::Relaxed);
        return;
    }
    let asked = match tokio::time::timeout(PATIENCE, heard(&mut stream)).await {
        Ok(Some(bytes)) => PageRequest::read(&bytes).and_then(|of| of.asks(&hall.token, hall.port)),
        Ok(None) => Err(Denial::NoRequest),
        Err(_) => {
            counters.stalled.fetch_add(1, Ordering::Relaxed);
            return;
        }
    };
    let written = match asked {
        Ok(Asked::Page) => {
            counters.pages.fetch_add(1, Ordering::Relaxed);
            let kind = "text/html; charset=utf-8";
            write(&mut stream, &response("200 OK", kind, hall.page.len()), &hall.page).await
        }
        Ok(Asked::Stop) if !hall.can_stop => {
            refuse(&mut stream, Denial::NoSuchPlace, counters).await
        }
        Ok(Asked::Stop) => {
            hall.wants_to_stop.store(true, Ordering::Release);
            write(&mut stream, &response("204 No Content", "text/plain", 0), "").await
        }
        Ok(Asked::Frames) => match Place::take(&counters.listeners, LISTENERS) {
            Some(_place) => {
                counters.streams.fetch_add(1, Ordering::Relaxed);
                tell(&mut stream, hall.frames.clone()).await
            }
            None => refuse(&mut stream, Denial::TooMany, counters).await,
        },
        Err(refusal) => refuse(&mut stream, refusal, counters).await,
    };
    if written == Written::Stalled {
        counters.stalled.fetch_add(1, Ordering::Relaxed);
    }
}

/// The head of a request, if it ends where it may.
async fn heard(stream: &mut TcpStream) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(1 << 10);
    while !bytes.windows(4).any(|end| end == b"\r\n\r\n") {
        let mut some = [0; 1 << 10];
        let count = stream.read(&mut some).await.ok().filter(|count| *count > 0)?;
        bytes.extend_from_slice(&some[..count]);
        if bytes.len() > REQUEST {
            return None;
        }
    }
    Some(bytes)
}

/// What became of words for a browser.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Written {
    All,
    Gone,
    Stalled,
}

async fn write(stream: &mut TcpStream, head: &str, body: &str) -> Written {
    let all = async {
        stream.write_all(head.as_bytes()).await?;
        stream.write_all(body.as_bytes()).await
    };
    match tokio::time::timeout(PATIENCE, all).await {
        Ok(Ok(())) => Written::All,
        Ok(Err(_)) => Written::Gone,
        Err(_) => Written::Stalled,
    }
}

async fn refuse(stream: &mut TcpStream, refusal: Denial, counters: &Counters) -> Written {
    counters.refused.fetch_add(1, Ordering::Relaxed);
    let (status, words) = refusal.words();
    write(stream, &response(status, "text/plain; charset=utf-8", words.len()), words).await
}

/// What is told from now on, until nobody tells or nobody listens.
async fn tell(stream: &mut TcpStream, mut frames: watch::Receiver<Arc<str>>) -> Written {
    let head = head("200 OK", "text/event-stream") + "\r\n";
    let mut written = write(stream, &head, "retry: 1000\n\n").await;
    frames.mark_changed();
    while written == Written::All {
        let text = match tokio::time::timeout(BEAT, frames.changed()).await {
            Ok(Ok(())) => Arc::clone(&frames.borrow_and_update()),
            Ok(Err(_)) => break,
            Err(_) => Arc::from(": still here\n\n"),
        };
        written = write(stream, &text, "").await;
    }
    written
}

fn response(status: &str, kind: &str, length: usize) -> String {
    format!("{}Content-Length: {length}\r\n\r\n", head(status, kind))
}

/// The page has its own content security policy besides.
fn head(status: &str, kind: &str) -> String {
    format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nConnection: close\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\n\
         Content-Security-Policy: frame-ancestors 'none'\r\n"
    )
}
