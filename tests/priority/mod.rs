//! Running before other programs: a real robot has a processor of its own, and a virtual one that
//! answers late because somebody compiles is no subject of most tests.

use crate::aloud::aloud;

/// Who may ask for the processor first does; all threads and processes from here on inherit that.
pub fn run_before_others() {
    if rustix::process::setpriority_process(None, -15).is_err() {
        aloud!("this process may not run before others: a busy machine will be seen");
    }
}
