//! `gaitway::wire` from its own source files and nothing else, to run its tests under Miri where a
//! nightly compiler with the components `miri` and `rust-src` is at hand. In this folder:
//!
//! ```sh
//! MIRIFLAGS=-Zmiri-disable-isolation cargo +nightly miri test --lib -- --skip properties
//! ```

#[path = "../../../src"]
mod source {
    pub mod wire;
}

pub use source::wire;
