//! The control channel: a program outside reaches past the lines of a running world, with one JSON
//! object on a line for each request and each reply. The README of this crate has all requests.
//!
//! - [`Session`]: what one program says and hears, without any input or output of its own.
//! - [`ControlSocket`]: sessions over a Unix socket that is the user's alone.
//! - [`ControlPipe`]: one session over two streams.
//!
//! Nothing here is without bounds. A program that does not read is not served any more until it does,
//! and loses events, which are counted; what is no request is refused, and counted.

mod entries;
mod pipe;
mod request;
mod session;
mod socket;

pub use pipe::ControlPipe;
pub use session::Session;
pub use socket::{ControlSocket, SocketError};

use std::sync::{Arc, Mutex, PoisonError};

/// The version of requests and replies. It changes when one that was understood is not any more.
pub const VERSION: u32 = 1;

/// What sessions know of the robot that its world does not.
#[derive(Clone, Debug, Default)]
pub struct Surroundings {
    /// The robot's name.
    pub robot: String,
    /// Where each line is reached now, in the order of the world's lines; an adapter that is pulled out
    /// is nowhere.
    pub places: Places,
}

/// Where lines are reached: whoever opened their doors tells, sessions look.
#[derive(Clone, Debug, Default)]
pub struct Places(Arc<Mutex<Vec<Option<String>>>>);

impl Places {
    /// They are there now.
    pub fn set(&self, places: Vec<Option<String>>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = places;
    }

    fn get(&self, line: usize) -> Option<String> {
        let places = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        places.get(line).cloned().flatten()
    }
}
