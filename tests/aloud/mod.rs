//! Saying something aloud: the test runner swallows what passing tests print with `println!`, and a
//! skip that nobody reads is a test that nobody knows is missing.

/// Prints a line to standard error, past the runner's capture.
macro_rules! aloud {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

pub(crate) use aloud;
