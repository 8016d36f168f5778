//! CAN against the real thing: the kernel's SocketCAN. Few machines that build have it, so a guest
//! kernel is booted that does (user-mode Linux: an ordinary program, which needs no rights), and
//! this very test program runs in it.
//!
//! The tests of `guest` are ignored elsewhere; on a machine with the interfaces that
//! `guest_kernel.rs` makes they run with `cargo test --test can -- --ignored`.

mod aloud;
mod priority;
mod program;

#[path = "can/guest.rs"]
mod guest;
#[path = "can/guest_kernel.rs"]
mod guest_kernel;

use aloud::aloud;
use guest_kernel::Outcome;

#[test]
fn the_can_suite_passes_on_a_kernel_with_socketcan() {
    priority::run_before_others();
    match guest_kernel::run_suite() {
        Outcome::Passed(said) => {
            let summary = said.lines().find(|line| line.contains("test result:")).unwrap_or("");
            assert!(!summary.contains(" 0 passed"), "the guest ran no test:\n{said}");
        }
        Outcome::Failed(said) => panic!("the CAN suite failed in the guest:\n{said}"),
        Outcome::NotStarted(why) if std::env::var_os("CI").is_some() => {
            panic!("the guest kernel with CAN could not be started: {why}")
        }
        Outcome::NotStarted(why) => {
            aloud!(
                "SKIPPED: nothing was tested against SocketCAN: {why}\n  to do: as root, \
                 apt-get install user-mode-linux busybox-static can-utils"
            );
        }
    }
}
