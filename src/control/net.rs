//! A net for panics: what one said, and where, for whoever spread the net to tell.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};

thread_local! {
    /// Nets that are spread under this thread.
    static NETS: Cell<u32> = const { Cell::new(0) };
    /// Where the last panic over one was.
    static PLACE: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// From now on a panic over a net prints nothing: a backtrace takes longer than goals may stand
/// still, and standard error may be a pipe that nobody empties. All others are said as usual.
pub fn print_no_caught_panics() {
    let usual = take_hook();
    set_hook(Box::new(move |panic| {
        if NETS.get() == 0 {
            usual(panic);
        } else {
            PLACE.set(panic.location().map(ToString::to_string));
        }
    }));
}

/// Does `job`; if it panics, what the panic said.
///
/// # Errors
/// The words of the panic, and where it was as far as that is known.
pub fn catch<T>(job: impl FnOnce() -> T) -> Result<T, String> {
    NETS.set(NETS.get() + 1);
    let done = catch_unwind(AssertUnwindSafe(job));
    NETS.set(NETS.get() - 1);
    done.map_err(|panic| {
        let place = PLACE.take().map_or_else(String::new, |place| format!(" ({place})"));
        format!("{}{place}", words(&*panic))
    })
}

/// What a panic said.
pub(super) fn words(panic: &(dyn Any + Send)) -> &str {
    let words = panic.downcast_ref::<String>().map(String::as_str);
    words.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no words left")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_done_comes_back_and_what_broke_is_told() {
        assert_eq!(catch(|| 5), Ok(5));
        let told = catch(|| std::panic::panic_any("five"));
        assert!(told.is_err_and(|words: String| words.starts_with("five")));
    }

    #[test]
    fn a_net_under_a_net_leaves_the_outer_one_whole() {
        let told = catch(|| {
            let inner = catch(|| std::panic::panic_any("inner".to_owned()));
            assert!(inner.is_err_and(|words: String| words.starts_with("inner")));
            std::panic::panic_any("outer")
        });
        assert!(told.is_err_and(|words: String| words.starts_with("outer")));
        assert_eq!(NETS.get(), 0);
    }
}
