//! A net for every change of the controller: recorded inputs, and one hash of all bits of the outputs per 100 cycles.
//!
//! Each stream is a recording of 2,000 cycles with its configuration, in closed loop, without the outputs (`streams/NAME.mcap.gz`). The
//! outputs are computed again, with the arithmetic of AVX2 and with that of SSE4.2, and their hashes compared with `hashes.txt`. The
//! streams cover every state, request, control mode and loop fidelity, both policies, slow and fast loops and nearly every diagnostic,
//! which a test checks. Another computes recordings with outputs, and replays them.
//!
//! A changed hash is a changed bit of what the controller says, and needs a commit of its own that says why:
//! `HEXAD_WRITE_HASHES=1 cargo test --test shipped golden` writes them anew. What only renames or moves code changes none: outputs are
//! not stored by the names of Rust ([`output_hash`]). After a change of the layout of `CycleMessage` the files must be written anew from
//! inputs that the version before has read; the hashes show whether each input is the same.

#![allow(clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

use std::env;
use std::sync::LazyLock;

use fearless_simd::Level;
use hexad::daemon::replay::repeating_level;

use hexad_support::not_run::not_run;

mod coverage;
mod hashes;
mod output_hash;
mod recording;
mod replays;
mod stream;

use hashes::{BLOCK, Table};
use stream::{Run, run_all};

/// Fewest streams.
const LEAST_STREAMS: usize = 12;

/// With the arithmetic of AVX2, AVX-512 and NEON, which round a product and its sum once, as SSE2 does by software: for two tests.
static AVX2: LazyLock<Vec<Run>> = LazyLock::new(|| run_all(repeating_level("Avx2", Level::new())));

/// Instruction set that rounds twice.
fn sse4_2() -> Option<Level> {
    #[cfg(target_arch = "x86_64")]
    return Level::new().as_sse4_2().map(Level::Sse4_2);
    #[cfg(not(target_arch = "x86_64"))]
    None
}

/// The difference between the hashes of a stream, in words.
fn difference(
    (name, arithmetic): &(String, String),
    recorded: Option<&Vec<u64>>,
    found: &[u64],
) -> Option<String> {
    let Some(recorded) = recorded else {
        return Some(format!("{name}, {arithmetic}: no hashes are recorded"));
    };
    let different: Vec<_> = (0..found.len()).filter(|block| recorded[*block] != found[*block]).collect();
    let first = BLOCK * different.first()?;
    let (count, cycles) = (different.len(), found.len() * BLOCK);
    Some(format!(
        "{name}, {arithmetic}: outputs differ in cycles {} to {}, and in {} further blocks of {BLOCK} of its {cycles}",
        first + 1,
        first + BLOCK,
        count - 1,
    ))
}

#[test]
fn every_output_has_the_bits_that_were_recorded() {
    assert!(AVX2.len() >= LEAST_STREAMS, "{} streams", AVX2.len());
    let key = |run: &Run, arithmetic: &str| (run.stream.info.name.clone(), arithmetic.to_owned());
    let mut found: Table = AVX2.iter().map(|run| (key(run, "Avx2"), hashes::of(&run.outputs))).collect();
    match sse4_2() {
        Some(level) => {
            found.extend(run_all(level).iter().map(|run| (key(run, "Sse4_2"), hashes::of(&run.outputs))));
        }
        None => not_run("the processor has no instructions that round as those of SSE4.2"),
    }
    let recorded = hashes::read();
    // Those of a processor with other instructions, too.
    let is_known = |name: &String| AVX2.iter().any(|run| run.stream.info.name == *name);
    if env::var_os("HEXAD_WRITE_HASHES").is_some() {
        let kept = recorded.into_iter().filter(|((name, _), _)| is_known(name));
        hashes::write(&kept.chain(found).collect());
        return;
    }
    assert!(recorded.keys().all(|(name, _)| is_known(name)), "hashes of a stream that is not there");
    let different: Vec<_> =
        found.iter().filter_map(|(key, hashes)| difference(key, recorded.get(key), hashes)).collect();
    assert!(
        different.is_empty(),
        "{}\nA changed hash needs a commit of its own that says why; HEXAD_WRITE_HASHES=1 writes them anew.",
        different.join("\n")
    );
}
