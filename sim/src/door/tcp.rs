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
        let flags = if hungry { PollFlags::IN } else { PollFlags::empty() };
        let client = self.client.iter().map(|client| client.as_fd());
        std::iter::once(self.listener.as_fd()).chain(client).map(|end| (end, flags)).collect()
    }

    pub fn read(&mut self, hungry: bool, bytes: &mut [u8]) -> usize {
        if let Some(client) = &mut self.client {
            // A program that left is noticed even if nothing is wanted of it.
            let got = if hungry { client.read(bytes) } else { client.peek(&mut [0]) };
            match got {
                Ok(0) => self.client = None,
                // Whoever waits outside is looked at once all that this one has said is taken: it
                // may have left.
                Ok(read) => return if hungry { read } else { 0 },
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                Err(_) => self.client = None,
            }
        }
        while let Ok((client, _)) = self.listener.accept() {
            // A second program is sent away: a line has one host.
            let usable = client.set_nonblocking(true).and_then(|()| client.set_nodelay(true));
            if self.client.is_none() && !self.away && usable.is_ok() {
                self.client = Some(client);
                break;
            }
        }
        0
    }

    /// What the program that is there has written besides. That it left is noticed once it has
    /// been served.
    pub fn read_more(&mut self, bytes: &mut [u8]) -> usize {
        self.client.as_mut().and_then(|client| client.read(bytes).ok()).unwrap_or(0)
    }

    pub fn write(&mut self, bytes: &[u8]) -> usize {
        // A full buffer loses the rest; a broken connection is noticed by the next read.
        self.client.as_mut().and_then(|client| client.write(bytes).ok()).unwrap_or(0)
    }

    pub fn hang_up(&mut self) {
        self.client = None;
        self.away = true;
    }

    pub fn come_back(&mut self) {
        self.away = false;
    }
}
