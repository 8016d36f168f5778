//! One session over two streams: what a program writes to and reads from the simulator's own process.

use super::{Session, Surroundings};
use crate::World;
use std::io::{ErrorKind, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Blocks of input that wait to be heard.
const WAITING_BLOCKS: usize = 4;
/// How often somebody who waits or follows is looked after.
const LOOK: Duration = Duration::from_millis(2);
/// How often else.
const REST: Duration = Duration::from_millis(500);

/// A session over an input and an output, on threads of its own, until the input ends.
#[derive(Debug)]
pub struct ControlPipe {
    server: JoinHandle<()>,
}

impl ControlPipe {
    /// Begins. `tell` takes whole lines, and says whether anybody takes them still.
    ///
    /// # Errors
    /// No thread.
    pub fn open(
        world: Arc<Mutex<World>>,
        surroundings: Surroundings,
        input: impl Read + Send + 'static,
        tell: impl FnMut(&str) -> bool + Send + 'static,
    ) -> std::io::Result<ControlPipe> {
        let (to_server, blocks) = sync_channel(WAITING_BLOCKS);
        world.lock().unwrap_or_else(PoisonError::into_inner).keep_journal(true);
        let named = |name: &str| std::thread::Builder::new().name(name.to_string());
        // It ends with its input, or with the process: nobody can wake it from a read.
        named("control input").spawn(move || read_all(input, &to_server))?;
        let session = Session::new(surroundings);
        let server = named("control").spawn(move || serve(&world, session, &blocks, tell))?;
        Ok(ControlPipe { server })
    }

    /// True once the input has ended and all it said is done, or nobody takes the output.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.server.is_finished()
    }
}

fn read_all(mut input: impl Read, to_server: &SyncSender<Vec<u8>>) {
    let mut block = vec![0; 4096];
    loop {
        match input.read(&mut block) {
            Ok(0) => return,
            Ok(count) => {
                let bytes = block.get(..count).unwrap_or_default().to_vec();
                if to_server.send(bytes).is_err() {
                    return;
                }
            }
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(_) => return,
        }
    }
}

fn serve(
    world: &Mutex<World>,
    mut session: Session,
    blocks: &Receiver<Vec<u8>>,
    mut tell: impl FnMut(&str) -> bool,
) {
    let began = Instant::now();
    let mut input_is_open = true;
    while input_is_open || !session.is_done() {
        if session.is_hungry() && input_is_open {
            match blocks.recv_timeout(if session.is_expectant() { LOOK } else { REST }) {
                Ok(bytes) => session.hear(&bytes),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => input_is_open = false,
            }
        } else if session.is_expectant() {
            std::thread::sleep(LOOK);
        }
        session.work(&mut world.lock().unwrap_or_else(PoisonError::into_inner), began.elapsed());
        let said = String::from_utf8_lossy(session.output()).into_owned();
        session.was_read(session.output().len());
        if !said.is_empty() && !tell(&said) {
            return;
        }
    }
}
