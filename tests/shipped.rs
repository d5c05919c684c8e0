//! What must hold of the code that ships: one codegen unit, without debug assertions.
//!
//! `cargo test` builds and runs this with `--release` (`as_shipped`). A part of it: `cargo test --release --test shipped vectors`.

mod common;

mod golden;
mod no_panic;
mod vectors;
