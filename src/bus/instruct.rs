//! Instructions that are neither reads nor plain writes.
//!
//! None of those that change a device is repeated when its answer is lost: a second action finds
//! nothing registered, a second reset a device that restarts. A device whose status return level
//! says that it answers reads only is [`Miss::Silent`](super::Miss::Silent) though it obeys; a ping
//! is always answered, so ask by that.

use super::codec::{Heard, Protocol};
use super::{AskError, Bus, Miss, Reply, SLACK};
use crate::time::{Duration, Instant};
pub use crate::wire::dynamixel2::FactoryReset;
use crate::wire::dynamixel2::{
    clear_multi_turn, control_table_backup, control_table_restore, reboot,
};

/// Pause between the places of two IDs in the answer to a ping of all. No manual names it; it is
/// what the SDKs of both makers allow for each ID (DynamixelSDK 2ded684d, `broadcastPing`;
/// huggingface/lerobot 7427f318, `motors/feetech`).
const SLOT_PAUSE: Duration = Duration::from_millis(3);

/// Who answered a ping of all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RollCall {
    /// ID and answer of each device, as they came. An ID that stands here twice is two devices.
    pub present: Vec<(u8, Reply)>,
    /// Bytes that belong to no whole answer: devices that spoke at the same time, or noise.
    pub garbled_bytes: usize,
}

/// Everything that was said within a window.
#[derive(Debug, Default)]
pub(super) struct Chorus {
    pub said: Vec<(u8, Result<Reply, Miss>)>,
    pub garbled_bytes: usize,
}

impl Bus {
    /// Registers a write, carried out at the next [`Bus::action`].
    ///
    /// # Errors
    /// [`AskError`].
    pub fn register(
        &mut self,
        protocol: Protocol,
        id: u8,
        address: u16,
        bytes: &[u8],
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.ask(protocol, id, 0, budget, |out| protocol.reg_write(out, id, address, bytes))
    }

    /// All devices carry out at once what was registered; nobody answers. The three protocols that
    /// share a packet share this one.
    ///
    /// # Errors
    /// [`AskError::Port`].
    pub fn action(&mut self, protocol: Protocol, budget: Instant) -> Result<(), AskError> {
        self.encode(|out| {
            protocol.action_all(out);
            Ok(())
        })?;
        self.say(budget)?;
        Ok(())
    }

    /// Restarts a device: torque off, RAM as at power-up, deaf for a while. Dynamixel 2.0 only.
    ///
    /// # Errors
    /// [`AskError`].
    pub fn reboot(
        &mut self,
        protocol: Protocol,
        id: u8,
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.tell(protocol, id, Wait::Window, budget, |out| {
            protocol.only2(out, id, "reboot", reboot)
        })
    }

    /// Puts a device back to factory values; a Dynamixel then restarts, and may have another ID
    /// and line speed. Only Dynamixel 2.0 can be told to keep those; what a Feetech servo keeps is
    /// not documented.
    ///
    /// # Errors
    /// [`AskError`].
    pub fn factory_reset(
        &mut self,
        protocol: Protocol,
        id: u8,
        keep: FactoryReset,
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.tell(protocol, id, Wait::Window, budget, |out| protocol.factory_reset(out, id, keep))
    }

    /// Brings the present position of a standing device back into one turn. Dynamixel 2.0 only.
    /// The device may take long to answer (DynamixelSDK waits ten seconds): this waits until
    /// `budget`.
    ///
    /// # Errors
    /// [`AskError`]; a turning device refuses.
    pub fn clear_turns(
        &mut self,
        protocol: Protocol,
        id: u8,
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.tell(protocol, id, Wait::Budget, budget, |out| {
            protocol.only2(out, id, "clear", clear_multi_turn)
        })
    }

    /// Stores the control table of a limp device as its back-up. Dynamixel 2.0 only; waits until
    /// `budget`, as the time it takes is not documented.
    ///
    /// # Errors
    /// [`AskError`]; a device with torque on refuses.
    pub fn backup_store(
        &mut self,
        protocol: Protocol,
        id: u8,
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.tell(protocol, id, Wait::Budget, budget, |out| {
            protocol.only2(out, id, "back-up", control_table_backup)
        })
    }

    /// Restores the back-up of a limp device, which then restarts. Dynamixel 2.0 only; waits until
    /// `budget`.
    ///
    /// # Errors
    /// [`AskError`]; a device with torque on refuses.
    pub fn backup_restore(
        &mut self,
        protocol: Protocol,
        id: u8,
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.tell(protocol, id, Wait::Budget, budget, |out| {
            protocol.only2(out, id, "back-up", control_table_restore)
        })
    }

    /// Tells one device something, once.
    fn tell(
        &mut self,
        protocol: Protocol,
        id: u8,
        wait: Wait,
        budget: Instant,
        instruction: impl FnOnce(&mut Vec<u8>) -> Result<(), String>,
    ) -> Result<Reply, AskError> {
        self.encode(instruction)?;
        let heard_at = self.say(budget)?;
        let window_end = match wait {
            Wait::Window => heard_at + self.answer_time(protocol, protocol.status_bytes(0), 1),
            Wait::Budget => budget,
        };
        self.one_answer(protocol, id, 0, heard_at, window_end, budget)
    }

    /// Longest time a ping of all and its answers take.
    #[must_use]
    pub fn ping_all_time(&self, protocol: Protocol) -> Duration {
        let status = protocol.status_bytes(protocol.ping_bytes());
        let slot = self.line_time(status) + SLOT_PAUSE;
        let answers = slot * u32::from(protocol.ids()) + self.return_delay(protocol);
        self.line_time(protocol.status_bytes(0)) + answers + self.timing.latency + SLACK
    }

    /// Asks who is there, all at once, and listens as long as the last could take to answer
    /// ([`Bus::ping_all_time`]). Dynamixel 2.0 and Feetech STS only.
    ///
    /// # Errors
    /// [`AskError::Port`], [`AskError::Unsayable`].
    pub fn ping_all(&mut self, protocol: Protocol, budget: Instant) -> Result<RollCall, AskError> {
        let longest = self.ping_all_time(protocol);
        self.encode(|out| protocol.ping_all(out))?;
        let heard_at = self.say(budget)?;
        let window_end = heard_at + longest;
        let chorus = self.hear_all(protocol, protocol.ping_bytes(), window_end.min(budget))?;
        let there = |(id, reply): (u8, Result<Reply, Miss>)| Some((id, reply.ok()?));
        let present = chorus.said.into_iter().filter_map(there).collect();
        if window_end > budget {
            self.gave_up(window_end);
        }
        Ok(RollCall { present, garbled_bytes: chorus.garbled_bytes })
    }

    /// Hears all that is said until `until`, where answers have `length` bytes.
    pub(super) fn hear_all(
        &mut self,
        protocol: Protocol,
        length: usize,
        until: Instant,
    ) -> Result<Chorus, AskError> {
        let mut chorus = Chorus::default();
        loop {
            match self.front(protocol, length) {
                Heard::Need => {
                    if self.listen(until)? {
                        continue;
                    }
                    let left = self.received.len();
                    if !self.drop_cut_packet(protocol, &mut Miss::Silent) {
                        return Ok(chorus);
                    }
                    chorus.garbled_bytes += left - self.received.len();
                }
                Heard::Echo(n) => drop(self.received.drain(..n)),
                Heard::Noise(n) => {
                    self.received.drain(..n);
                    chorus.garbled_bytes += n;
                }
                Heard::Damaged(n) => {
                    self.received.drain(..n);
                    self.stats.garbled += 1;
                    chorus.garbled_bytes += n;
                }
                Heard::Status(said, n) => {
                    match (said.id, said.reply(length)) {
                        (_, Err(Miss::Garbled)) => chorus.garbled_bytes += n,
                        answer => chorus.said.push(answer),
                    }
                    self.received.drain(..n);
                    self.stats.answered += 1;
                }
            }
        }
    }
}

/// How long an answer is waited for.
#[derive(Clone, Copy)]
enum Wait {
    /// As long as an answer takes.
    Window,
    /// As long as there is time.
    Budget,
}
