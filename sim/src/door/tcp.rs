//! A TCP port that carries the line's bytes as they are.

use rustix::event::PollFlags;
use rustix::fd::{AsFd, BorrowedFd};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};

/// A port and the one program that is connected to it.
pub(super) struct TcpEnd {
    listener: TcpListener,
    address: SocketAddr,
    client: Option<TcpStream>,
    /// The adapter is pulled out: whoever comes is sent away.
    away: bool,
}

impl TcpEnd {
    pub fn listen(address: SocketAddr) -> std::io::Result<TcpEnd> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        Ok(TcpEnd { listener, address, client: None, away: false })
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    pub fn waits_for(&self, hungry: bool) -> Vec<(BorrowedFd<'_>, PollFlags)> {
        let mut ends = vec![(self.listener.as_fd(), PollFlags::IN)];
        if let Some(client) = &self.client {
            let flags = if hungry { PollFlags::IN } else { PollFlags::empty() };
            ends.push((client.as_fd(), flags));
        }
        ends
    }

    pub fn read(&mut self, hungry: bool, bytes: &mut [u8]) -> usize {
        let mut count = 0;
        if let Some(client) = &mut self.client {
            // A program that left is noticed even if nothing is wanted of it.
            let got = if hungry { client.read(bytes) } else { client.peek(&mut [0]) };
            match got {
                Ok(0) => self.client = None,
                Ok(read) if hungry => count = read,
                Ok(_) => {}
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                Err(_) => self.client = None,
            }
        }
        while let Ok((client, _)) = self.listener.accept() {
            let usable = client.set_nonblocking(true).and_then(|()| client.set_nodelay(true));
            if self.client.is_none() && !self.away && usable.is_ok() {
                self.client = Some(client);
            }
            // A second program is sent away: a line has one host.
        }
        count
    }

    pub fn write(&mut self, bytes: &[u8]) {
        if let Some(client) = &mut self.client {
            // A full buffer loses the rest; a broken connection is noticed by the next read.
            let _ = client.write(bytes);
        }
    }

    pub fn hang_up(&mut self) {
        self.client = None;
        self.away = true;
    }

    pub fn come_back(&mut self) {
        self.away = false;
    }
}
