//! Keys that count as soon as they are pressed: a terminal that does not wait for Enter, and is as it was before on every way
//! out of it.

use rustix::process::{Signal, getpgrp, getpid, kill_process};
use rustix::stdio::stdin;
use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, Termios, isatty, tcgetattr, tcgetpgrp, tcsetattr,
};
use std::io::Read;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::signal::unix::{SignalKind, signal};

/// Who is used to Enter after a key that needs none presses it within this time.
const COMPANION: Duration = Duration::from_millis(700);

/// True unless the terminal belongs to another job: reading it would stop this one.
pub fn may_be_read() -> bool {
    !isatty(stdin()) || is_ours()
}

/// A terminal that is not this process's own stops nobody.
fn is_ours() -> bool {
    tcgetpgrp(stdin()).map_or(true, |foreground| foreground == getpgrp())
}

/// A terminal that hands on each key, until this is dropped: at the end, after Ctrl-C and other signals that are listened for, and
/// when the program breaks. While the program is stopped (Ctrl-Z) the terminal is as it was.
pub struct Keys(());

/// How the terminal was, and how it is set, while keys are held.
struct HeldTerminal {
    before: Termios,
    set: Termios,
}

static HELD: Mutex<Option<HeldTerminal>> = Mutex::new(None);

fn held() -> MutexGuard<'static, Option<HeldTerminal>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

fn put(termios: &Termios) {
    // A terminal that is gone needs nothing.
    let _ = tcsetattr(stdin(), OptionalActions::Now, termios);
}

impl Keys {
    /// Of standard input, if that is a terminal of this job and not held already; `echoes`: the terminal shows what is typed.
    pub fn hold(echoes: bool) -> Option<Self> {
        let mut held = held();
        if held.is_some() || !isatty(stdin()) || !is_ours() {
            return None;
        }
        let before = tcgetattr(stdin()).ok()?;
        let mut set = before.clone();
        set.local_modes.remove(LocalModes::ICANON);
        set.local_modes.set(LocalModes::ECHO, echoes);
        set.special_codes[SpecialCodeIndex::VMIN] = 1;
        set.special_codes[SpecialCodeIndex::VTIME] = 0;
        // Ctrl-\ would leave the terminal like this.
        set.special_codes[SpecialCodeIndex::VQUIT] = 0;
        give_back_while_stopped().ok()?;
        put(&set);
        *held = Some(HeldTerminal { before, set });
        Some(Self(()))
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        if let Some(of) = held().take() {
            put(&of.before);
        }
    }
}

/// Listens for Ctrl-Z from now on, on one thread for the life of the process, which stops it as the system would.
fn give_back_while_stopped() -> std::io::Result<()> {
    static LISTENS: AtomicBool = AtomicBool::new(false);
    if LISTENS.swap(true, Ordering::AcqRel) {
        return Ok(());
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    let guard = runtime.enter();
    let mut stops = signal(SignalKind::from_raw(Signal::TSTP.as_raw()))?;
    drop(guard);
    std::thread::Builder::new().name("stops".to_owned()).spawn(move || {
        while runtime.block_on(stops.recv()).is_some() {
            if let Some(of) = &*held() {
                put(&of.before);
            }
            // Other threads may be stopped before this one: what comes after has to wait until it goes on.
            let goes_on = {
                let _guard = runtime.enter();
                signal(SignalKind::from_raw(Signal::CONT.as_raw()))
            };
            let _ = kill_process(getpid(), Signal::STOP);
            if let Ok(mut goes_on) = goes_on {
                let _ = runtime.block_on(goes_on.recv());
            }
            // Perhaps in the background.
            if let Some(of) = held().as_ref().filter(|_| is_ours()) {
                put(&of.set);
            }
        }
    })?;
    Ok(())
}

/// Hands on what is typed at standard input until nobody takes it any more: line by line, or, while that is wanted, what a typist
/// makes of the keys as they are pressed. A note that is not ended yet stands in `note`.
pub fn hand_on_typed(
    mut typist: Typist,
    by_keys: &AtomicBool,
    note: &Mutex<String>,
    mut is_taken: impl FnMut(String) -> bool,
) {
    let mut line = Vec::new();
    let mut bytes = [0_u8; 256];
    while let Ok(count @ 1..) = std::io::stdin().lock().read(&mut bytes) {
        let now = Instant::now();
        let is_pressed = by_keys.load(Ordering::Acquire);
        if !is_pressed {
            typist.forget();
        }
        for byte in &bytes[..count] {
            let whole = match (is_pressed, byte) {
                (true, key) => typist.press(*key, now).map(|(_, line)| line),
                // By habit, after the last key that needed none.
                (false, b'\n') if line.is_empty() && typist.takes_companion(now) => None,
                (false, b'\n') => {
                    Some(String::from_utf8_lossy(&std::mem::take(&mut line)).into_owned())
                }
                (false, byte) => {
                    // Enter after other keys is theirs.
                    typist.companion = None;
                    line.push(*byte);
                    None
                }
            };
            if whole.is_some_and(|whole| !is_taken(whole)) {
                return;
            }
        }
        *note.lock().unwrap_or_else(PoisonError::into_inner) = typist.typed();
    }
    // As a line that its end ends.
    if !line.is_empty() {
        is_taken(String::from_utf8_lossy(&line).into_owned());
    }
}

/// What keys make, one after the other: lines. Enter or space alone is an empty one.
#[derive(Debug, Default)]
pub struct Typist {
    /// Keys that are a line each, unless something was typed before them.
    at_once: &'static [u8],
    /// Keys that make no line are forgotten: no words are typed.
    knows_no_words: bool,
    typed: Vec<u8>,
    since: Option<Instant>,
    /// Until when Enter belongs to a key that was a line.
    companion: Option<Instant>,
    /// The key that was pressed last, and when.
    before: Option<(u8, Instant)>,
    /// In what a key sends that stands for no letter: an arrow.
    escape: Escape,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Escape {
    #[default]
    No,
    /// Since then: of a key that stands for no letter, or the key Esc.
    Begun(Instant),
    Inside,
}

/// A key that is held down is pressed again and again, nearer together than anybody presses it twice.
const REPEATS: Duration = Duration::from_millis(120);

/// What a key sends comes at once; what is pressed after Esc does not.
const AT_ONCE: Duration = Duration::from_millis(50);

impl Typist {
    /// With keys that are a line each.
    pub fn new(at_once: &'static [u8]) -> Self {
        Self { at_once, ..Self::default() }
    }

    /// With keys that are a line each, whatever was pressed before them.
    pub fn of_keys(at_once: &'static [u8]) -> Self {
        Self { at_once, knows_no_words: true, ..Self::default() }
    }

    /// What is typed from here on has nothing to do with what was, but for Enter after a key that needed none.
    fn forget(&mut self) {
        self.typed.clear();
        (self.since, self.escape, self.before) = (None, Escape::No, None);
    }

    /// True if Enter, pressed now, belongs to a key that was a line; of each such key once.
    fn takes_companion(&mut self, now: Instant) -> bool {
        self.companion.take().is_some_and(|by| now <= by)
    }

    /// What was typed and neither ended nor dropped yet.
    pub fn typed(&self) -> String {
        match self.escape {
            Escape::Begun(_) => String::new(),
            _ => String::from_utf8_lossy(&self.typed).into_owned(),
        }
    }

    /// Takes a key; the line that it ends, and when that was begun.
    pub fn press(&mut self, key: u8, now: Instant) -> Option<(Instant, String)> {
        match (self.escape, key) {
            (Escape::Begun(since), b'[' | b'O') if now <= since + AT_ONCE => {
                self.escape = Escape::Inside;
                return None;
            }
            (Escape::Begun(_), _) => {
                self.escape = Escape::No;
                self.typed.clear();
                self.since = None;
            }
            (Escape::Inside, _) => {
                if (0x40..=0x7e).contains(&key) {
                    self.escape = Escape::No;
                }
                return None;
            }
            (Escape::No, _) => {}
        }
        let companion = self.companion.take();
        let before = self.before.replace((key, now));
        // What one look finds was pressed while nobody looked: nobody knows how far apart.
        let is_near = |at: Instant| at < now && now < at + REPEATS;
        let is_held = before.is_some_and(|(before, at)| before == key && is_near(at));
        let is_alone = self.typed.is_empty()
            && (self.at_once.contains(&key) || matches!(key, b'\n' | b'\r' | b' '));
        if is_held && is_alone {
            self.companion = companion;
            return None;
        }
        match key {
            b'\n' | b'\r' if self.typed.is_empty() && companion.is_some_and(|by| now <= by) => None,
            b' ' if self.typed.is_empty() => Some((now, String::new())),
            b'\n' | b'\r' => {
                let line = self.typed().trim().to_owned();
                self.typed.clear();
                Some((self.since.take().unwrap_or(now), line))
            }
            0x08 | 0x7f => {
                while self.typed.pop().is_some_and(|byte| byte & 0xc0 == 0x80) {}
                None
            }
            0x1b => {
                self.escape = Escape::Begun(now);
                None
            }
            key if self.typed.is_empty() && self.at_once.contains(&key) => {
                self.companion = Some(now + COMPANION);
                Some((now, char::from(key).to_string()))
            }
            key if key >= b' ' && !self.knows_no_words => {
                if self.typed.is_empty() {
                    self.since = Some(now);
                }
                self.typed.push(key);
                None
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What keys make, each pressed so many milliseconds after the one before.
    fn lines(at_once: &'static [u8], keys: &[(u64, &str)]) -> Vec<String> {
        let mut typist = Typist::new(at_once);
        let mut now = Instant::now();
        let mut made = Vec::new();
        for (after_ms, keys) in keys {
            now += Duration::from_millis(*after_ms);
            made.extend(
                keys.bytes().filter_map(|key| typist.press(key, now)).map(|(_, line)| line),
            );
        }
        made
    }

    #[test]
    fn enter_and_space_count_at_once_and_words_when_they_are_ended() {
        assert_eq!(lines(b"", &[(0, "\n"), (0, " "), (0, "the phone\n")]), ["", "", "the phone"]);
        assert_eq!(lines(b"", &[(0, "ab\u{e4}"), (0, "\u{7f}\u{7f}c\n")]), ["ac"]);
        assert_eq!(lines(b"", &[(0, "ab\u{1b}"), (0, "c\n")]), ["c"]);
        // An arrow and a key with a number are no words.
        assert_eq!(lines(b"", &[(0, "\u{1b}[A\u{1b}OP\u{1b}[15~\n")]), [""]);
        assert_eq!(lines(b"", &[(0, "a typo\u{1b}[D"), (300, "\n")]), ["a typo"]);
        // After Esc such letters are letters.
        assert_eq!(lines(b"", &[(0, "ab\u{1b}"), (300, "One fell\n")]), ["One fell"]);
        assert_eq!(lines(b"", &[(0, "ab\u{1b}"), (300, "\n")]), [""]);
        assert_eq!(lines(b"", &[(0, "\u{4}\u{1}"), (0, "no end")]), [""; 0]);
    }

    #[test]
    fn keys_that_are_a_line_each_need_no_enter_and_one_that_follows_by_habit_is_none() {
        assert_eq!(lines(b"x.", &[(0, "x"), (300, "\n"), (0, "\n")]), ["x", ""]);
        assert_eq!(lines(b"x.", &[(0, "x"), (900, "\n")]), ["x", ""]);
        assert_eq!(lines(b"x.", &[(0, "xx."), (0, "a fox.\n")]), ["x", "x", ".", "a fox."]);
    }

    #[test]
    fn keys_count_whatever_else_was_pressed_where_no_words_are_typed() {
        let mut typist = Typist::of_keys(b"qQ");
        let now = Instant::now();
        let mut made = |keys: &str| -> Vec<String> {
            keys.bytes().filter_map(|key| typist.press(key, now)).map(|(_, line)| line).collect()
        };
        // The key F2 sends a Q that nobody pressed.
        assert_eq!(made("what\u{1b}OQ is"), [""], "a space");
        assert_eq!(made("this q"), ["", "q"]);
        assert_eq!(made("\nQ"), ["Q"]);
    }

    #[test]
    fn a_key_that_is_held_down_counts_as_it_goes_down_and_letters_of_a_word_all_count() {
        let held = |keys: &'static str| {
            let mut all = vec![(0, keys), (500, keys)];
            all.extend([(33, keys)].repeat(60));
            all
        };
        // The first repetition comes late, and is one too many.
        assert_eq!(lines(b"x.", &held("x")), ["x", "x"]);
        assert_eq!(lines(b"", &held("\n")), ["", ""]);
        assert_eq!(lines(b"x.", &[(0, "a"), (20, "xx"), (20, "xx\n")]), ["axxxx"]);
    }

    #[test]
    fn a_note_has_the_moment_at_which_it_was_begun() {
        let mut typist = Typist::default();
        let began = Instant::now();
        let at = |ms: u64| began + Duration::from_millis(ms);
        assert_eq!(typist.press(b'h', at(0)), None);
        assert_eq!(typist.press(b'i', at(500)), None);
        assert_eq!(typist.typed(), "hi");
        assert_eq!(typist.press(b'\n', at(4000)), Some((at(0), "hi".to_owned())));
        assert_eq!(typist.press(b'\n', at(5000)), Some((at(5000), String::new())));
    }
}
