//! The page, served while something happens: to browsers of this machine, one picture after the other.
//!
//! A server of one thread listens on the loopback. Whoever knows the address, which holds a random token, gets the
//! page, the stream of what is told (server-sent events, HTML Living Standard, section 9.2), and a way to wish for a
//! stop. It serves nothing else, reads no file and writes none. Of pictures the newest only is kept: a browser that reads
//! slowly sees fewer, and nobody who tells ever waits. What happens once is numbered and kept, the last
//! [`MOST_KEPT`] of it, for every browser to be told in order.

mod request;

use super::ViewPage;
use super::session::{PersonNow, SensorRow};
use super::tracks::SpanKind;
use crate::error::Error;
use crate::time::Duration;
use request::{Asked, Denial, PageRequest};
use serde::Serialize;
use std::collections::VecDeque;
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
/// Of what happened so much is kept for browsers that come later, or read slowly.
pub const MOST_KEPT: usize = 1000;
/// At the end browsers have so long to hear what was told last.
const FAREWELL: Duration = Duration::from_millis(500);

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
    /// Who wears sensors; of nobody: empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub persons: Vec<PersonNow>,
    /// Angles of the first of them, in the order of the page, rad.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub angles_rad: Vec<f64>,
    /// How sensors are heard.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<SensorRow>,
    /// What else there is to know: a name, and words.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub facts: Vec<(&'static str, String)>,
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
        Self { time_s, goal_rad, present_rad, ..Self::default() }
    }
}

/// Something that happened at one time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveEvent {
    /// When, on the clock of the frames, s; `None`: before that clock ran.
    pub time_s: Option<f64>,
    /// For so long, s.
    pub lasts_s: f64,
    /// What it is about.
    pub kind: SpanKind,
    /// The line of the time line it stands in.
    pub row: String,
    /// What it says.
    pub label: String,
    /// Links of the robot that it is about.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<usize>,
}

/// What browsers are told.
struct Newest {
    /// The newest frame, as it is sent, and its number.
    frame: Arc<str>,
    frame_number: u64,
    /// What happened, and the number of the first that is kept.
    events: VecDeque<LiveEvent>,
    first: u64,
}

impl Newest {
    /// The number of what happens next.
    fn next(&self) -> u64 {
        self.first + self.events.len() as u64
    }

    fn happened(&mut self, event: LiveEvent) {
        self.events.push_back(event);
        if self.events.len() > MOST_KEPT {
            self.events.pop_front();
            self.first += 1;
        }
    }

    /// What happened from this number on, as it is sent.
    fn since(&self, number: u64) -> impl Iterator<Item = String> {
        let numbered = (self.first..).zip(&self.events).skip_while(move |(at, _)| *at < number);
        numbered.filter_map(|(at, event)| {
            // Words and numbers can always be written.
            let text = serde_json::to_string(event).ok()?;
            Some(format!("event: happened\nid: {at}\ndata: {text}\n\n"))
        })
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
    newest: watch::Receiver<Newest>,
    wants_to_stop: Arc<AtomicBool>,
    /// Whether there is something that the page may stop.
    can_stop: bool,
    counters: Arc<Counters>,
}

/// A page that is served.
pub struct LiveView {
    token: String,
    port: u16,
    /// Names of the joints on the page.
    joints: Vec<String>,
    /// `None` only while it is closed.
    newest: Option<watch::Sender<Newest>>,
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
        let joints = page.scene.joints.iter().flat_map(|of| &of.joints);
        let joints = joints.map(|joint| joint.name.clone()).collect();
        Self::at(page.live_html()?, joints, port, !page.scene.is_session)
    }

    /// Serves a page that is whole.
    ///
    /// # Errors
    /// A port that is taken, no randomness, no thread.
    pub fn serving(html: String, port: u16) -> Result<Self, Error> {
        Self::at(html, Vec::new(), port, false)
    }

    fn at(html: String, joints: Vec<String>, port: u16, can_stop: bool) -> Result<Self, Error> {
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
        let (telling, newest) = watch::channel(Newest {
            frame: Arc::from(""),
            frame_number: 0,
            events: VecDeque::new(),
            first: 0,
        });
        let (closed, closing) = tokio::sync::oneshot::channel();
        let (wants_to_stop, counters) = (Arc::default(), Arc::<Counters>::default());
        let hall = Hall {
            page: html,
            token: token.clone(),
            port,
            newest,
            wants_to_stop: Arc::clone(&wants_to_stop),
            can_stop,
            counters: Arc::clone(&counters),
        };
        let thread = std::thread::Builder::new()
            .name("view".to_owned())
            .spawn(move || {
                runtime.block_on(async move {
                    let hall = Arc::new(hall);
                    tokio::select! {
                        () = serve(listener, Arc::clone(&hall)) => {}
                        _ = closing => {}
                    }
                    let all_gone = async {
                        while hall.counters.listeners.load(Ordering::Relaxed) > 0 {
                            tokio::time::sleep(Duration::from_millis(5)).await;
                        }
                    };
                    let _ = tokio::time::timeout(FAREWELL, all_gone).await;
                });
            })
            .map_err(failed)?;
        let (closed, thread) = (Some(closed), Some(thread));
        let newest = Some(telling);
        Ok(Self { token, port, joints, newest, wants_to_stop, counters, closed, thread })
    }

    /// Where a browser finds it.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Names of the joints on the page, in its order.
    #[must_use]
    pub fn joint_names(&self) -> &[String] {
        &self.joints
    }

    /// Tells whoever looks on; never waits.
    pub fn tell<T: Serialize>(&self, frame: &T) {
        // Numbers and nulls can always be written.
        let (Ok(text), Some(newest)) = (serde_json::to_string(frame), &self.newest) else { return };
        let text = format!("data: {text}\n\n").into();
        newest.send_modify(|newest| {
            newest.frame = text;
            newest.frame_number += 1;
        });
    }

    /// Tells whoever looks on, or will, that something happened; never waits.
    pub fn happened(&self, event: LiveEvent) {
        if let Some(newest) = &self.newest {
            newest.send_modify(|newest| newest.happened(event));
        }
    }

    /// The clock of the frames begins anew: what happened so far was before that.
    pub fn begins_anew(&self) {
        if let Some(newest) = &self.newest {
            newest.send_modify(|newest| {
                newest.events.iter_mut().for_each(|event| event.time_s = None);
            });
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
        // Streams tell what is left, and end.
        self.newest = None;
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
                tell(&mut stream, hall.newest.clone()).await
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

/// What happened so far and is told from now on, until nobody tells or nobody listens.
async fn tell(stream: &mut TcpStream, mut newest: watch::Receiver<Newest>) -> Written {
    let head = head("200 OK", "text/event-stream") + "\r\n";
    let mut written = write(stream, &head, "retry: 1000\n\n").await;
    let (mut next, mut framed) = (0, 0);
    newest.mark_changed();
    while written == Written::All {
        let is_last = match tokio::time::timeout(BEAT, newest.changed()).await {
            Ok(changed) => changed.is_err(),
            Err(_) => {
                written = write(stream, ": still here\n\n", "").await;
                continue;
            }
        };
        let mut texts = Vec::new();
        {
            let newest = newest.borrow_and_update();
            if newest.frame_number > framed {
                framed = newest.frame_number;
                texts.push(newest.frame.to_string());
            }
            texts.extend(newest.since(next));
            next = newest.next();
        }
        for text in texts {
            written = write(stream, &text, "").await;
            if written != Written::All {
                break;
            }
        }
        if is_last {
            break;
        }
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
