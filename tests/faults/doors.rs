//! Strangers at the doors: the TCP port of the simulator, and the UDP port for SlimeVR trackers.

use super::forty;
use gaitway_sim::{Door, Options, World};
use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream, UdpSocket};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Time in which anything that happens at all has happened, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(60);
/// A ping of FEETECH servo 1, and its answer: nothing is wrong.
const PING: [u8; 6] = [0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFB];
const PONG: [u8; 6] = [0xFF, 0xFF, 0x01, 0x02, 0x00, 0xFC];

/// Asks until the answer comes: a line loses what is said while another instruction is under way.
fn is_answered(client: &mut TcpStream) -> bool {
    let began = Instant::now();
    client.set_read_timeout(Some(Duration::from_millis(200))).expect("a time-out");
    let mut heard = Vec::new();
    while began.elapsed() < PATIENCE {
        if client.write_all(&PING).is_err() {
            return false;
        }
        let mut buffer = [0; 64];
        match client.read(&mut buffer) {
            Ok(0) => return false,
            Ok(count) => heard.extend_from_slice(&buffer[..count]),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => return false,
        }
        if heard.windows(PONG.len()).any(|window| window == PONG) {
            return true;
        }
    }
    false
}

/// True if whoever is at the other end closes this connection without a word.
fn is_sent_away(client: &mut TcpStream) -> bool {
    client.set_read_timeout(Some(PATIENCE)).expect("a time-out");
    match client.read(&mut [0; 16]) {
        Ok(count) => count == 0,
        Err(e) => e.kind() == ErrorKind::ConnectionReset,
    }
}

#[test]
fn w40_a_tcp_door_serves_one_and_sends_a_thousand_others_away() {
    let file = gaitway_profiles::robot("so101").expect("a shipped robot");
    let world = World::new(&file, Options::default()).expect("a virtual robot");
    let world = Arc::new(Mutex::new(world));
    let local = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let door = Door::open_tcp(Arc::clone(&world), 0, local).expect("a port");
    let address = door.path().to_str().expect("UTF-8").trim_start_matches("tcp:").to_owned();
    let mut host = TcpStream::connect(&address).expect("a connection");
    assert!(is_answered(&mut host), "the first host is not heard");
    let mut cases = 0;
    for stranger in 0..1_000_usize {
        let mut client = TcpStream::connect(&address).expect("a connection");
        // Some begin with noise, some with a goal of their own.
        let noise: Vec<u8> = (0..stranger % 7 * 100).map(|k| (k * stranger) as u8).collect();
        let _ = client.write_all(&noise);
        let _ = client.write_all(&[0xFF, 0xFF, 0x01, 0x04, 0x03, 0x28, 0x01, 0xCE]);
        assert!(is_sent_away(&mut client), "stranger {stranger} was served");
        cases += 1;
    }
    assert!(is_answered(&mut host), "the first host is not heard any more");
    // Garbage of the one who is served costs nobody anything but that.
    for burst in 0..200_usize {
        let noise: Vec<u8> =
            (0..999).map(|k: usize| (k.wrapping_mul(burst + 7) >> 2) as u8).collect();
        host.write_all(&noise).expect("taken");
        cases += 1;
    }
    assert!(is_answered(&mut host), "garbage broke the door");
    let torque = world.lock().expect("a world").register("shoulder_pan", "Torque Enable");
    assert_eq!(torque, Some(0), "a stranger switched torque on");
    forty::ran("w40_a_tcp_door_serves_one_and_sends_a_thousand_others_away", cases);
}

#[test]
fn w40_the_tcp_door_of_simulate_listens_to_this_machine_alone() {
    let mut child = crate::program::gaitway()
        .args(["simulate", "so101", "--tcp", "0"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the simulator");
    let mut line = String::new();
    let stdout = child.stdout.take().expect("its output");
    std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut line).expect("a line");
    let _ = child.kill();
    let _ = child.wait();
    assert!(line.starts_with("tcp:127.0.0.1:"), "{line:?}");
}

/// A handshake as a tracker with this address sends it.
fn handshake(mac: [u8; 6]) -> Vec<u8> {
    let mut packet = vec![0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0];
    for word in [4_u32, 4, 2, 0, 0, 0, 19] {
        packet.extend(word.to_be_bytes());
    }
    packet.extend([3, b's', b'i', b'm']);
    packet.extend(mac);
    packet
}

#[test]
fn w40_a_udp_port_takes_garbage_and_a_crowd_and_goes_on() {
    let free = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|s| s.local_addr());
    let server = free.expect("a port");
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("w40-udp");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    let file = folder.join("take.mcap");
    let mut child = crate::program::gaitway()
        .args(["record", &format!("imu:slimevr@udp:{}", server.port()), "--json", "-o"])
        .arg(&file)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("a recorder");
    let socket = || {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a socket");
        socket.connect(server).expect("an address");
        socket.set_read_timeout(Some(Duration::from_millis(100))).expect("a time-out");
        socket
    };
    let answered = |socket: &UdpSocket, mac: [u8; 6]| {
        // Nobody listens at first; later the queue of the socket may be full.
        socket.send(&handshake(mac)).is_ok() && socket.recv(&mut [0; 64]).is_ok()
    };
    let first = socket();
    let began = Instant::now();
    while !answered(&first, [2, 0, 0, 0, 0, 1]) {
        assert!(began.elapsed() < PATIENCE, "nobody listens");
        assert!(child.try_wait().expect("a child").is_none(), "it ended at once");
    }
    // It listens on this machine alone: at no other address of it.
    let elsewhere = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, server.port()));
    assert!(elsewhere.is_err() || is_bound_to(server), "it listens to the network");
    let mut cases = 0;
    for length in 0..1_000_usize {
        let datagram: Vec<u8> = (0..length).map(|k| (k * 31 + length) as u8).collect();
        let _ = first.send(&datagram);
        cases += 1;
    }
    let began = Instant::now();
    while !answered(&first, [2, 0, 0, 0, 0, 1]) {
        assert!(began.elapsed() < PATIENCE, "garbage made it deaf");
    }
    // A crowd: no more than 64 are served, the first among them.
    let crowd: Vec<UdpSocket> = (0..100).map(|_| socket()).collect();
    for (number, one) in crowd.iter().enumerate() {
        let _ = one.send(&handshake([2, 0, 0, 0, 1, number as u8]));
        cases += 1;
    }
    let served = crowd.iter().filter(|one| one.recv(&mut [0; 64]).is_ok()).count();
    assert!(served < 64, "{served} were served");
    assert!(child.try_wait().expect("a child").is_none(), "strangers ended it");
    let kill = Command::new("kill").args(["-s", "INT", &child.id().to_string()]).status();
    assert!(kill.is_ok_and(|status| status.success()));
    let output = child.wait_with_output().expect("its output");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!said.contains("panicked"), "{said}");
    assert!(output.status.code().is_some(), "it died of a signal: {said}");
    forty::ran("w40_a_udp_port_takes_garbage_and_a_crowd_and_goes_on", cases);
}

/// True if the kernel has this very address, and not all, for the port.
fn is_bound_to(address: SocketAddr) -> bool {
    let table = std::fs::read_to_string("/proc/net/udp").expect("a table");
    let wanted = format!("0100007F:{:04X}", address.port());
    table.contains(&wanted) && !table.contains(&format!("00000000:{:04X}", address.port()))
}
