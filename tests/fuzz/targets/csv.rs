//! See `tests/fuzz/main.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| {
    hexad_fuzz::csv::hold(input);
});
