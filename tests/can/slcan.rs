//! A USB-CAN adapter that speaks slcan (the text protocol of Lawicel's CANUSB), played on a
//! pseudo-terminal, behind the kernel's own driver.

use super::{frame, heard, soon};
use gaitway::port::can::{CanInterface, Controller, state};
use gaitway::port::{FramePort as _, Heard};
use gaitway::wire::can::{CanId, Format};
use rustix::fd::OwnedFd;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// The adapter's end of the line: what the kernel says to it, one command at a time.
struct Adapter {
    terminal: Arc<OwnedFd>,
    commands: Receiver<String>,
    daemon: Child,
}

impl Adapter {
    /// Plugs in; the interface is then called `name`.
    fn plug_in(name: &str) -> Adapter {
        let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
        grantpt(&terminal).and_then(|()| unlockpt(&terminal)).expect("a terminal");
        let path = ptsname(&terminal, Vec::new()).expect("a name").into_string().expect("ASCII");
        let terminal = Arc::new(terminal);
        let (said, commands) = channel();
        let reading = Arc::clone(&terminal);
        // The kernel waits for each command to be fetched before it goes on.
        std::thread::spawn(move || {
            let mut line = Vec::new();
            let mut byte = [0];
            while matches!(rustix::io::read(&*reading, &mut byte), Ok(1)) {
                if byte != *b"\r" {
                    line.extend(byte);
                } else if said.send(String::from_utf8_lossy(&line).into_owned()).is_err() {
                    return;
                } else {
                    line.clear();
                }
            }
        });
        let daemon = Command::new("slcand")
            .args(["-F", "-S", "1000000", &path, name])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("slcand");
        Adapter { terminal, commands, daemon }
    }

    fn hears(&self) -> String {
        self.commands.recv_timeout(Duration::from_secs(5)).expect("a command")
    }

    fn says(&self, text: &str) {
        let sent = rustix::io::write(&*self.terminal, text.as_bytes());
        assert_eq!(sent, Ok(text.len()));
    }
}

impl Drop for Adapter {
    fn drop(&mut self) {
        let _ = self.daemon.kill();
        let _ = self.daemon.wait();
    }
}

/// Until the kernel has made the interface.
fn when_there(name: &str) -> socketcan::CanInterface {
    let end = Instant::now() + Duration::from_secs(10);
    loop {
        match socketcan::CanInterface::open(name) {
            Ok(interface) => return interface,
            Err(error) => assert!(Instant::now() < end, "{name}: {error}"),
        }
        std::thread::yield_now();
    }
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_usb_adapter_carries_frames_both_ways_and_tells_of_bus_off() {
    let adapter = Adapter::plug_in("slcan0");
    let interface = when_there("slcan0");
    interface.set_bitrate(1_000_000, None).expect("a bit rate");
    interface.bring_up().expect("up");
    let commands: Vec<_> = [(); 3].iter().map(|()| adapter.hears()).collect();
    assert_eq!(commands, ["C", "S8", "O"], "closed, 1 Mbit/s, opened");
    let stands = state("slcan0").expect("a state");
    assert_eq!((stands.up, stands.bitrate_bps), (true, Some(1_000_000)));
    assert_eq!(stands.controller, Some(Controller::Active));

    let mut port = CanInterface::open("slcan0").expect("open");
    let enable = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
    port.send(&frame(CanId::standard(0x141), Format::Classic, &enable), soon()).expect("sent");
    assert_eq!(adapter.hears(), "t1418FFFFFFFFFFFFFFFC");
    port.send(&frame(CanId::extended(0x0300_FD7F), Format::Classic, &[]), soon()).expect("sent");
    assert_eq!(adapter.hears(), "T0300FD7F0");
    let request = frame(CanId::standard(0x29), Format::Remote { length: 8 }, &[]);
    port.send(&request, soon()).expect("sent");
    assert_eq!(adapter.hears(), "r0298");

    adapter.says("t011811AABBCCDDEEFF00\r");
    let whole = [0x11, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF, 0x00];
    assert_eq!(heard(&mut port), frame(CanId::standard(0x11), Format::Classic, &whole));
    adapter.says("T02007FFD3010203\r");
    let id = CanId::extended(0x0200_7FFD);
    assert_eq!(heard(&mut port), frame(id, Format::Classic, &[1, 2, 3]));

    adapter.says("sb000255\r");
    let report = match port.receive(soon()) {
        Ok(Heard::Report(report)) => report,
        other => panic!("{other:?}"),
    };
    assert!(report.bus_off(), "{report}");
    assert_eq!(state("slcan0").expect("a state").controller, Some(Controller::BusOff));
}
