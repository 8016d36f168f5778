//! Chromium without a window, told what to do through its DevTools protocol
//! (<https://chromedevtools.github.io/devtools-protocol/>): a WebSocket (RFC 6455) and JSON.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// How long an answer may take on a busy machine that draws without a graphics card.
const PATIENCE: Duration = Duration::from_secs(120);

/// A browser with one page.
pub struct Browser {
    child: Child,
    socket: BufReader<TcpStream>,
    session: String,
    asked: u64,
    /// What the page complained of, and what it asked the network for.
    complaints: Vec<String>,
    /// Where the page is from, if it is served.
    home: String,
    loaded: bool,
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Browser {
    /// A browser that keeps what it keeps in `folder`; why not, if there is none.
    pub fn start(folder: &Path) -> Result<Self, String> {
        let mut last = String::new();
        for name in ["chromium", "chromium-browser", "google-chrome"] {
            match Self::start_as(name, folder) {
                Ok(browser) => return Ok(browser),
                Err(cause) if last.is_empty() => last = cause,
                Err(_) => {}
            }
        }
        Err(last)
    }

    fn start_as(name: &str, folder: &Path) -> Result<Self, String> {
        // As on a desktop, a browser is a session of its own: the kernel shares its processors out by sessions.
        let mut child = Command::new("setsid")
            .arg(name)
            .args(["--headless=new", "--no-sandbox", "--no-first-run", "--disable-dev-shm-usage"])
            .args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"])
            .args(["--disable-background-networking", "--disable-extensions", "--mute-audio"])
            .arg("--remote-debugging-port=0")
            .arg(format!("--user-data-dir={}", folder.display()))
            .arg("about:blank")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|cause| format!("{name}: {cause}"))?;
        let mut told = BufReader::new(child.stderr.take().expect("piped"));
        let mut said = String::new();
        let address = loop {
            let mut line = String::new();
            if told.read_line(&mut line).unwrap_or(0) == 0 {
                let _ = child.wait();
                return Err(format!("{name} ended: {said}"));
            }
            if let Some((_, address)) = line.split_once("listening on ws://") {
                break address.trim().to_owned();
            }
            said += &line;
        };
        // What nobody reads would fill the pipe.
        std::thread::spawn(move || std::io::copy(&mut told, &mut std::io::sink()));
        let (host, path) = address.split_once('/').expect("a path");
        let stream = TcpStream::connect(host).map_err(|cause| format!("{host}: {cause}"))?;
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        let mut socket = BufReader::new(stream);
        let ask = format!(
            "GET /{path} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
        );
        socket.get_mut().write_all(ask.as_bytes()).expect("asked");
        loop {
            let mut line = String::new();
            socket.read_line(&mut line).expect("an answer");
            if line.trim().is_empty() {
                break;
            }
        }
        let (session, complaints, home) = (String::new(), Vec::new(), "about:blank".to_owned());
        let mut browser =
            Self { child, socket, session, asked: 0, complaints, home, loaded: false };
        let target = browser.ask("Target.createTarget", json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let attached = browser.ask("Target.attachToTarget", attach);
        browser.session = attached["sessionId"].as_str().expect("a session").to_owned();
        for domain in ["Page.enable", "Runtime.enable", "Log.enable", "Network.enable"] {
            browser.ask(domain, json!({}));
        }
        Ok(browser)
    }

    fn send(&mut self, text: &str) {
        let length = text.len();
        let mut frame = vec![0x81];
        match length {
            0..=125 => frame.push(0x80 | length as u8),
            126..=0xffff => {
                frame.push(0x80 | 126);
                frame.extend((length as u16).to_be_bytes());
            }
            _ => {
                frame.push(0x80 | 127);
                frame.extend((length as u64).to_be_bytes());
            }
        }
        // A client masks what it says; with zeros, it stays as it is.
        frame.extend([0; 4]);
        frame.extend(text.as_bytes());
        self.socket.get_mut().write_all(&frame).expect("sent");
    }

    fn next(&mut self) -> Value {
        let mut message = Vec::new();
        loop {
            let mut head = [0; 2];
            self.socket.read_exact(&mut head).expect("Chromium answers");
            let length = match head[1] & 0x7f {
                126 => {
                    let mut length = [0; 2];
                    self.socket.read_exact(&mut length).expect("a length");
                    u64::from(u16::from_be_bytes(length))
                }
                127 => {
                    let mut length = [0; 8];
                    self.socket.read_exact(&mut length).expect("a length");
                    u64::from_be_bytes(length)
                }
                short => short.into(),
            };
            let mut part = vec![0; length as usize];
            self.socket.read_exact(&mut part).expect("a frame");
            message.extend(part);
            if head[0] & 0x80 != 0 {
                return serde_json::from_slice(&message).expect("JSON");
            }
        }
    }

    /// Takes note of what happens meanwhile.
    fn heard(&mut self, event: &Value) {
        let of = &event["params"];
        match event["method"].as_str().unwrap_or_default() {
            "Page.loadEventFired" => self.loaded = true,
            "Runtime.exceptionThrown" => {
                self.complaints.push(of["exceptionDetails"].to_string());
            }
            "Runtime.consoleAPICalled" if of["type"] == "error" || of["type"] == "warning" => {
                self.complaints.push(of["args"].to_string());
            }
            "Log.entryAdded" if of["entry"]["level"] == "error" => {
                self.complaints.push(of["entry"].to_string());
            }
            "Network.requestWillBeSent" => {
                let url = of["request"]["url"].as_str().unwrap_or_default();
                let own = ["file:", "about:", "data:", &self.home];
                if !own.iter().any(|own| url.starts_with(own)) {
                    self.complaints.push(format!("it asks for {url}"));
                }
            }
            _ => {}
        }
    }

    /// Asks for something and waits for the answer.
    pub fn ask(&mut self, method: &str, params: Value) -> Value {
        self.asked += 1;
        let mut request = json!({ "id": self.asked, "method": method, "params": params });
        if !self.session.is_empty() {
            request["sessionId"] = self.session.clone().into();
        }
        self.send(&request.to_string());
        loop {
            let answer = self.next();
            if answer["id"] == self.asked {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
            self.heard(&answer);
        }
    }

    /// Opens a page and waits until it is there and has been drawn.
    pub fn open(&mut self, page: &Path, hash: &str) {
        self.home = "about:blank".to_owned();
        self.load(&format!("file://{}{hash}", page.display()));
    }

    /// Opens a page that is served, which may ask its server for more.
    pub fn open_served(&mut self, url: &str) {
        self.home = url.to_owned();
        self.load(url);
    }

    fn load(&mut self, url: &str) {
        self.complaints.clear();
        self.ask("Page.navigate", json!({ "url": "about:blank" }));
        self.loaded = false;
        self.ask("Page.navigate", json!({ "url": url }));
        while !self.loaded {
            let event = self.next();
            self.heard(&event);
        }
        self.frames(2);
    }

    /// A script that runs before those of every page that is opened from now on.
    pub fn beforehand(&mut self, script: &str) {
        self.ask("Page.addScriptToEvaluateOnNewDocument", json!({ "source": script }));
    }

    /// What an expression of the page is.
    pub fn value(&mut self, expression: &str) -> Value {
        let ask = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.ask("Runtime.evaluate", ask);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {answer:#}");
        answer["result"]["value"].clone()
    }

    /// Waits until so many frames are drawn.
    pub fn frames(&mut self, count: usize) {
        self.value(&format!(
            "new Promise(done => {{ let left = {count}; \
             const next = () => left-- > 0 ? requestAnimationFrame(next) : done(true); next(); }})"
        ));
    }

    /// Presses a key and lets it go.
    pub fn key(&mut self, key: &str, code: &str) {
        for kind in ["keyDown", "keyUp"] {
            let mut event = json!({ "type": kind, "key": key, "code": code });
            if kind == "keyDown" && key.len() == 1 {
                event["text"] = key.into();
            }
            self.ask("Input.dispatchKeyEvent", event);
        }
    }

    /// Clicks at a place of the window.
    pub fn click(&mut self, x: f64, y: f64) {
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1 });
            self.ask("Input.dispatchMouseEvent", event);
        }
    }

    /// How large the window is, and whether it is dark.
    pub fn look(&mut self, width: u32, height: u32, dark: bool) {
        let phone = width < 600;
        let size = json!({
            "width": width, "height": height, "deviceScaleFactor": 1, "mobile": phone,
        });
        self.ask("Emulation.setDeviceMetricsOverride", size);
        let scheme = if dark { "dark" } else { "light" };
        let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.ask("Emulation.setEmulatedMedia", media);
    }

    /// A picture of the window (PNG, base64).
    pub fn picture(&mut self) -> String {
        let picture = self.ask("Page.captureScreenshot", json!({ "format": "png" }));
        picture["data"].as_str().expect("a picture").to_owned()
    }

    /// What the page complained of since it was opened.
    pub fn complaints(&mut self) -> Vec<String> {
        // Whatever is on its way comes before the answer.
        self.value("1");
        std::mem::take(&mut self.complaints)
    }
}
