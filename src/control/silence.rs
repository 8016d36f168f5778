//! Who was silent must say that it is as it was armed before it is told anything again.
//!
//! Servos that lose their power come back limp, and a goal may wake some of them. So after a silence
//! of all joints of a line, or of one joint for two readings in a row, the first answer is followed
//! by a question for torque. Until it is answered no goal goes to that line.

use crate::bus::Miss;
use crate::robot::link::States;

/// Readings in a row that one joint may miss without being doubted.
const MISSES: u32 = 1;

/// What is known of every joint's silence.
#[derive(Debug)]
pub struct Silence {
    line_of: Vec<usize>,
    missed: Vec<u32>,
    doubted: Vec<bool>,
    /// Joints that are doubted because all of their line were silent.
    with_line: Vec<bool>,
    /// Lines of which nobody answered who was asked in the last cycle.
    quiet_lines: Vec<bool>,
    /// Somebody answered in the last cycle who had missed the one before.
    recovered: bool,
    /// Cycles in a row in which nobody answered who was asked.
    quiet_cycles: u32,
}

impl Silence {
    /// Joints on these lines, all of which answered just now.
    #[must_use]
    pub fn new(line_of: Vec<usize>) -> Self {
        let joints = line_of.len();
        let lines = line_of.iter().max().map_or(0, |&last| last + 1);
        Self {
            quiet_lines: vec![false; lines],
            recovered: false,
            line_of,
            missed: vec![0; joints],
            doubted: vec![false; joints],
            with_line: vec![false; joints],
            quiet_cycles: 0,
        }
    }

    /// Takes the states of one cycle: the joints that answered and are doubted.
    pub fn take(&mut self, states: &States) -> Vec<usize> {
        let asked = |state: &Result<_, Miss>| !matches!(state, Err(Miss::NotAsked));
        let (mut anybody_asked, mut anybody) = (false, false);
        self.recovered = false;
        for (joint, state) in states.iter().enumerate().filter(|(_, state)| asked(state)) {
            anybody_asked = true;
            anybody |= state.is_ok();
            self.recovered |= state.is_ok() && self.missed[joint] > 0;
            self.missed[joint] = if state.is_ok() { 0 } else { self.missed[joint] + 1 };
            self.doubted[joint] |= self.missed[joint] > MISSES;
        }
        match (anybody_asked, anybody) {
            (_, true) => self.quiet_cycles = 0,
            (true, false) => self.quiet_cycles += 1,
            (false, false) => {}
        }
        for line in 0..self.quiet_lines.len() {
            let on_line = |joint: &usize| self.line_of[*joint] == line;
            let mut of_line = (0..states.len()).filter(on_line).filter(|&j| asked(&states[j]));
            let first = of_line.next();
            let Some(first) = first else { continue };
            self.quiet_lines[line] = states[first].is_err() && of_line.all(|j| states[j].is_err());
            if self.quiet_lines[line] {
                for joint in (0..states.len()).filter(|&joint| self.line_of[joint] == line) {
                    (self.doubted[joint], self.with_line[joint]) = (true, true);
                }
            }
        }
        let answered = |joint: &usize| states[*joint].is_ok() && self.doubted[*joint];
        (0..states.len()).filter(answered).collect()
    }

    /// True if the joint was silent for so long that it may have restarted, and has not said yet that
    /// it is as it was armed.
    #[must_use]
    pub fn is_doubted(&self, joint: usize) -> bool {
        self.doubted.get(joint).copied().unwrap_or(false)
    }

    /// The joint said that it is as it was armed.
    pub fn trust(&mut self, joint: usize) {
        if joint < self.doubted.len() {
            (self.doubted[joint], self.with_line[joint]) = (false, false);
        }
    }

    /// True if the joint is doubted because all of its line were silent: what happened to it
    /// happened to all.
    #[must_use]
    pub fn is_shared(&self, joint: usize) -> bool {
        self.with_line.get(joint).copied().unwrap_or(false)
    }

    /// True if nobody on this line answered who was asked last.
    #[must_use]
    pub fn is_line_quiet(&self, line: usize) -> bool {
        self.quiet_lines.get(line).copied().unwrap_or(false)
    }

    /// True if somebody answered in the last cycle who had missed the one before: it may not have
    /// heard the last goals either.
    #[must_use]
    pub const fn has_recovered(&self) -> bool {
        self.recovered
    }

    /// True if the joint missed its last reading.
    #[must_use]
    pub fn is_silent(&self, joint: usize) -> bool {
        self.missed.get(joint).is_some_and(|&missed| missed > 0)
    }

    /// Cycles in a row in which nobody answered who was asked.
    #[must_use]
    pub const fn quiet_cycles(&self) -> u32 {
        self.quiet_cycles
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::JointState;

    fn states(answers: &str) -> States {
        let one = |letter| match letter {
            '.' => Ok((JointState::default(), false)),
            'x' => Err(Miss::Silent),
            _ => Err(Miss::NotAsked),
        };
        answers.chars().map(one).collect()
    }

    /// Two joints on one line, three on another, after these cycles: who is doubted and answered in
    /// the last.
    fn doubted(cycles: &[&str]) -> Vec<usize> {
        let mut silence = Silence::new(vec![0, 0, 1, 1, 1]);
        cycles.iter().map(|answers| silence.take(&states(answers))).last().unwrap_or_default()
    }

    #[test]
    fn one_lost_reading_of_one_joint_is_no_doubt() {
        assert_eq!(doubted(&["x....", "....."]), [0_usize; 0]);
    }

    #[test]
    fn two_lost_readings_of_one_joint_are() {
        assert_eq!(doubted(&["x....", "x....", "....."]), [0]);
        assert_eq!(doubted(&["x....", ".....", "x....", "....."]), [0_usize; 0]);
    }

    #[test]
    fn joints_that_were_not_asked_neither_answer_nor_miss() {
        assert_eq!(doubted(&["x-...", "--...", "x-...", ".-..."]), [0]);
        assert_eq!(doubted(&["x-...", ".-..."]), [0], "all of the line that were asked");
    }

    #[test]
    fn a_silence_of_all_of_a_line_makes_all_of_it_doubted_and_nobody_else() {
        assert_eq!(doubted(&["xx...", "....."]), [0, 1]);
        assert_eq!(doubted(&["..xxx", ".xx.."]), [3, 4]);
        assert_eq!(doubted(&["xxxxx", "....."]), [0, 1, 2, 3, 4]);
    }

    #[test]
    fn who_is_trusted_again_is_doubted_no_more() {
        let mut silence = Silence::new(vec![0, 0]);
        silence.take(&states("xx"));
        silence.trust(0);
        assert_eq!(silence.take(&states("..")), [1]);
    }

    #[test]
    fn who_was_silent_alone_is_told_apart_from_who_was_silent_with_all_of_a_line() {
        let mut silence = Silence::new(vec![0, 0, 1, 1]);
        silence.take(&states(".xxx"));
        silence.take(&states(".x.."));
        let shared = |silence: &Silence| [0, 1, 2, 3, 4].map(|joint| silence.is_shared(joint));
        assert_eq!(shared(&silence), [false, false, true, true, false]);
        silence.trust(2);
        silence.trust(4);
        assert_eq!(shared(&silence), [false, false, false, true, false]);
        assert_eq!(silence.take(&states("....")), [1, 3]);
    }

    #[test]
    fn cycles_without_any_answer_are_counted_in_a_row() {
        let mut silence = Silence::new(vec![0, 1]);
        let mut counts = Vec::new();
        for answers in ["x-", "xx", "--", "-x", "x.", "xx"] {
            silence.take(&states(answers));
            counts.push(silence.quiet_cycles());
        }
        assert_eq!(counts, [1, 2, 2, 3, 0, 1]);
    }
}
