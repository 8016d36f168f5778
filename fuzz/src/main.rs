//! Random bytes against every decoder and reader: one program, whose target is named by the environment variable
//! `GAITWAY_FUZZ`. As one it is built once; see run.sh.

#![no_main]

mod shared;
mod targets;

use std::sync::LazyLock;

/// The target that was asked for.
static TARGET: LazyLock<fn(&[u8])> = LazyLock::new(|| {
    let name = std::env::var("GAITWAY_FUZZ").expect("GAITWAY_FUZZ names a target");
    targets::named(&name).unwrap_or_else(|| panic!("no target is called {name:?}"))
});

libfuzzer_sys::fuzz_target!(init: LazyLock::force(&TARGET), |input: &[u8]| TARGET(input));
