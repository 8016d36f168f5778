//! A body on which several sensors sit moves once for all of them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// When a motion began, for all sensors that share it: when the first of them was listened to. Once
/// nobody listens to any, the next to come sees it from the start, unless it is [lasting](Stage::lasting).
#[derive(Clone, Debug, Default)]
pub struct Stage(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    began: Option<Instant>,
    listened_to: usize,
    /// It goes on when nobody listens.
    lasts: bool,
}

impl Stage {
    /// One whose motion begins now and goes on, whoever listens: who comes later, or comes back, finds it where it is.
    #[must_use]
    pub fn lasting() -> Self {
        let began = Some(Instant::now());
        Self(Arc::new(Mutex::new(State { began, listened_to: 0, lasts: true })))
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A sensor is listened to from now on; when the motion began.
    pub(super) fn enter(&self) -> Instant {
        let mut state = self.lock();
        state.listened_to += 1;
        *state.began.get_or_insert_with(Instant::now)
    }

    /// A sensor is listened to no more.
    pub(super) fn leave(&self) {
        let mut state = self.lock();
        state.listened_to = state.listened_to.saturating_sub(1);
        if state.listened_to == 0 && !state.lasts {
            state.began = None;
        }
    }

    /// When the motion began; `None` while nobody listens.
    #[must_use]
    pub fn began(&self) -> Option<Instant> {
        self.lock().began
    }
}
