//! One client's run through everything it offers, or one proof of a defect of it: carried out once,
//! whoever asks first, so that the tests and the conformance table speak of the same run.

use crate::aloud::aloud;
use crate::bench::Lost;
use crate::python::{self, Python};
use std::sync::{Mutex, OnceLock, PoisonError};

/// What a run has shown so far.
#[derive(Default)]
pub struct Record {
    works: Vec<&'static str>,
}

impl Record {
    /// Notes that the client did this right, as the world and the client both say.
    pub fn works(&mut self, instruction: &'static str) {
        if !self.works.contains(&instruction) {
            self.works.push(instruction);
        }
    }
}

/// Carries out a scenario.
pub enum Run {
    /// With a client of Python.
    Python(fn(&Python, &mut Record) -> Result<(), Lost>),
    /// With a client in this process.
    Here(fn(&mut Record) -> Result<(), Lost>),
}

/// What a scenario is about.
pub enum About {
    /// What the client offers for these servos.
    Everything(&'static [&'static str]),
    /// What the client does wrong with an instruction, in words for its users.
    Defect(&'static str, &'static str),
}

/// A run and what came of it.
pub struct Scenario {
    /// The client by its package's name.
    pub client: &'static str,
    pub protocol: &'static str,
    pub about: About,
    run: Run,
    outcome: OnceLock<Outcome>,
}

/// How a scenario ended; one that failed has ended the test.
#[derive(Clone)]
pub enum Outcome {
    /// What works.
    Ran(Vec<&'static str>),
    /// Why nothing was tried.
    Skipped(String),
}

/// Clients keep time; two at once on a small machine would be late.
static ALONE: Mutex<()> = Mutex::new(());

impl Scenario {
    pub const fn new(
        client: &'static str,
        protocol: &'static str,
        about: About,
        run: Run,
    ) -> Scenario {
        Scenario { client, protocol, about, run, outcome: OnceLock::new() }
    }

    /// What came of it; runs it if nobody has.
    pub fn outcome(&self) -> Outcome {
        self.outcome.get_or_init(|| self.carry_out()).clone()
    }

    fn carry_out(&self) -> Outcome {
        let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let python = match &self.run {
            Run::Python(_) => match python::python() {
                Ok(python) => Some(python),
                Err(cause) => {
                    aloud!("SKIPPED: {} did not run: {cause}", self.client);
                    return Outcome::Skipped(cause);
                }
            },
            Run::Here(_) => None,
        };
        let once = || {
            let mut record = Record::default();
            match (&self.run, &python) {
                (Run::Python(run), Some(python)) => run(python, &mut record),
                (Run::Here(run), _) => run(&mut record),
                (Run::Python(_), None) => Ok(()),
            }
            .map(|()| record.works)
        };
        let works = once().unwrap_or_else(|Lost(why)| {
            aloud!("TIMED OUT, {} once more from the start: {why}", self.client);
            once().unwrap_or_else(|Lost(why)| panic!("{} timed out twice: {why}", self.client))
        });
        Outcome::Ran(works)
    }
}
