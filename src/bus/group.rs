//! Reading from many devices with one question.

use super::codec::{self, GroupItem, GroupRead, Heard, Protocol};
use super::{AskError, Bus, Miss, Reply, SLACK};
use crate::time::{Duration, Instant};
use crate::units::line_time_s;

/// A question to many devices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GroupQuestion {
    /// What the devices speak.
    pub protocol: Protocol,
    /// The instruction.
    pub kind: GroupRead,
    /// Who is asked for what, in the order of the answers. For [`GroupRead::Sync`] and
    /// [`GroupRead::Fast`] all share address and length.
    pub items: Vec<GroupItem>,
}

impl GroupQuestion {
    fn lengths(&self) -> impl Iterator<Item = usize> {
        self.items.iter().map(|item| usize::from(item.length))
    }

    /// Bytes of all answers.
    fn answer_bytes(&self) -> usize {
        if self.kind.merged() {
            codec::merged_bytes(self.items.len(), self.lengths().sum())
        } else {
            self.lengths().map(|length| self.protocol.status_bytes(length)).sum()
        }
    }

    /// Devices that wait their return delay one after another.
    fn delays(&self) -> usize {
        if self.kind.merged() { 1 } else { self.items.len() }
    }
}

/// The question under way.
pub(super) struct Pending {
    question: GroupQuestion,
    heard_at: Instant,
}

type Answers = Vec<Result<Reply, Miss>>;

impl Bus {
    /// Line time of `question` and its answers, s.
    #[must_use]
    pub fn read_time_s(&self, question: &GroupQuestion) -> f64 {
        let asked = question.protocol.group_read_bytes(question.kind, question.items.len());
        let bytes = asked + question.answer_bytes();
        let delay_s = self.return_delay(question.protocol).as_secs_f64();
        line_time_s(bytes, self.timing.baud_bps) + delay_s * question.delays() as f64
    }

    /// Asks many devices; [`Bus::finish_group_read`] waits.
    ///
    /// # Errors
    /// [`AskError::Port`], [`AskError::Unsayable`].
    pub fn begin_group_read(
        &mut self,
        question: &GroupQuestion,
        budget: Instant,
    ) -> Result<(), AskError> {
        self.pending = None;
        self.encode(|out| question.protocol.group_read(out, question.kind, &question.items))?;
        let heard_at = self.say(budget)?;
        self.pending = Some(Pending { question: question.clone(), heard_at });
        Ok(())
    }

    /// The answers to the group read under way, in the order of its items, those lost asked for
    /// once more if `budget` allows. None at all if no group read is under way.
    ///
    /// If one device alone is missing and one alone answered that nobody asked, that is who
    /// answered in its place ([`Miss::WrongId`]).
    ///
    /// # Errors
    /// [`AskError::Port`]; a device that does not answer is a [`Miss`] of its own.
    pub fn finish_group_read(&mut self, budget: Instant) -> Result<Answers, AskError> {
        let Some(pending) = self.pending.take() else { return Ok(Vec::new()) };
        self.strangers.clear();
        let items = pending.question.items.clone();
        let mut answers = self.answers_asked_twice(pending, budget)?;
        let is_lost =
            |answer: &Result<Reply, Miss>| matches!(answer, Err(Miss::Silent | Miss::Garbled));
        let mut lost = (0..answers.len()).filter(|&i| is_lost(&answers[i]));
        let mut others =
            self.strangers.iter().filter(|&&id| items.iter().all(|asked| asked.id != id));
        if let (Some(slot), None, Some(&got), None) =
            (lost.next(), lost.next(), others.next(), others.next())
            && answers[slot] == Err(Miss::Silent)
        {
            answers[slot] = Err(Miss::WrongId { asked: items[slot].id, got });
        }
        Ok(answers)
    }

    /// A silent device silences those listed after it, so the second question leaves out the
    /// first one missing unless it is the only one.
    fn answers_asked_twice(
        &mut self,
        pending: Pending,
        budget: Instant,
    ) -> Result<Answers, AskError> {
        let mut answers = self.group_answers(&pending, budget)?;
        let mut lost: Vec<usize> = (0..answers.len())
            .filter(|&i| matches!(answers[i], Err(Miss::Silent | Miss::Garbled)))
            .collect();
        if lost.len() > 1 && answers[lost[0]] == Err(Miss::Silent) {
            lost.remove(0);
        }
        if lost.is_empty() {
            return Ok(answers);
        }
        let mut again = pending.question;
        again.items = lost.iter().map(|&i| again.items[i]).collect();
        let ends = self.clock.now().max(self.quiet_until)
            + Duration::from_secs_f64(self.read_time_s(&again))
            + self.timing.latency
            + SLACK;
        if ends > budget {
            return Ok(answers);
        }
        self.stats.retried += again.items.len() as u64;
        self.begin_group_read(&again, budget)?;
        if let Some(pending) = self.pending.take() {
            for (&slot, answer) in lost.iter().zip(self.group_answers(&pending, budget)?) {
                answers[slot] = answer;
            }
        }
        Ok(answers)
    }

    fn group_answers(&mut self, pending: &Pending, budget: Instant) -> Result<Answers, AskError> {
        if pending.question.kind.merged() {
            self.merged_answer(pending, budget)
        } else {
            self.separate_answers(pending, budget)
        }
    }

    fn separate_answers(
        &mut self,
        pending: &Pending,
        budget: Instant,
    ) -> Result<Answers, AskError> {
        let Pending { question, heard_at } = pending;
        let (protocol, items) = (question.protocol, &question.items);
        let longest = question.lengths().max().unwrap_or(0);
        let (bytes, devices) = (question.answer_bytes(), question.delays());
        let window_end = *heard_at + self.answer_time(protocol, bytes, devices);
        // Bytes that come late move the end, so that a slow host loses no answer.
        let patience = self.answer_time(protocol, protocol.status_bytes(longest), 1);
        let mut answers = vec![None; items.len()];
        let mut left = items.len();
        let mut deadline = window_end.min(budget);
        while left > 0 {
            match self.front(protocol, longest) {
                Heard::Need => {
                    if self.listen(deadline)? {
                        deadline = deadline.max((self.clock.now() + patience).min(budget));
                    } else if !self.drop_cut_packet(protocol, &mut Miss::Silent) {
                        self.gave_up(window_end);
                        break;
                    }
                }
                Heard::Echo(n) | Heard::Noise(n) => drop(self.received.drain(..n)),
                Heard::Damaged(n) => {
                    self.received.drain(..n);
                    self.stats.garbled += 1;
                }
                Heard::Status(said, n) => {
                    let id = said.id;
                    let place = items.iter().position(|asked| asked.id == id);
                    // An answer of another length is a late one, to an earlier question.
                    let fits = |i: &usize| said.answers(usize::from(items[*i].length));
                    let slot = place.filter(|&i| answers[i].is_none()).filter(fits);
                    if let Some(slot) = slot {
                        answers[slot] = Some(said.reply(usize::from(items[slot].length)));
                        left -= 1;
                        self.stats.answered += 1;
                    } else {
                        self.stats.unasked += 1;
                        if place.is_none() && !self.strangers.contains(&id) {
                            self.strangers.push(id);
                        }
                    }
                    self.received.drain(..n);
                }
            }
        }
        if left == 0 {
            self.satisfied(protocol, *heard_at, bytes, devices);
        }
        Ok(answers.into_iter().map(|answer| answer.unwrap_or(Err(Miss::Silent))).collect())
    }

    fn merged_answer(&mut self, pending: &Pending, budget: Instant) -> Result<Answers, AskError> {
        let Pending { question, heard_at } = pending;
        let protocol = question.protocol;
        let total = question.answer_bytes();
        let longest = question.lengths().max().unwrap_or(0);
        let window_end = *heard_at + self.answer_time(protocol, total, 1);
        let patience = self.answer_time(protocol, protocol.status_bytes(longest), 1);
        let mut deadline = window_end.min(budget);
        loop {
            if self.received.len() < total && self.listen(deadline)? {
                deadline = deadline.max((self.clock.now() + patience).min(budget));
                continue;
            }
            let answers = codec::merged(&self.received, &question.items);
            let complete = answers.iter().all(|a| matches!(a, Ok(_) | Err(Miss::Refused(_))));
            // Bounded even if a babbling line never lets the answer be complete.
            let room = self.received.len() < 2 * total + self.sent.len();
            if !complete && room && self.listen(deadline)? {
                deadline = deadline.max((self.clock.now() + patience).min(budget));
                continue;
            }
            if complete {
                self.satisfied(protocol, *heard_at, total, 1);
            } else {
                self.gave_up(window_end);
            }
            self.stats.answered += answers.iter().filter(|a| a.is_ok()).count() as u64;
            self.stats.garbled += u64::from(answers.contains(&Err(Miss::Garbled)));
            return Ok(answers);
        }
    }
}
