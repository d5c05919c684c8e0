//! A recording of each stream is repeated to the bit: in every control mode, with every fidelity, under both policies.

use std::thread;

use fearless_simd::Level;
use hexad::config::Config;
use hexad::daemon::replay::{Replay, recorded_controller, replay};
use hexad::messages::GapMessage;
use hexad::realtime::setup::denormals;
use hexad::recording::memory_bytes;
use hexad::recording::reader::Recording;
use tempfile::NamedTempFile;

use super::AVX2;
use super::stream::{CYCLES, Run, Stream};

/// A cycle that is missing in the recordings. A replay continues after it with the recorded memory.
const MISSING: u64 = 1000;

/// A recording of a stream with the outputs of the arithmetic of AVX2.
fn record(Run { stream, config, .. }: &Run) -> NamedTempFile {
    denormals::flush();
    let file = NamedTempFile::new().unwrap();
    let mut controller = recorded_controller(&stream.info, config);
    stream.record(file.path(), |file, cycle, input| {
        if cycle == MISSING + 1 {
            file.write_gap(input.release_ns, &GapMessage { first_cycle: MISSING, cycles: 1 }).unwrap();
            file.write_memory(cycle, input.release_ns, &memory_bytes(controller.memory())).unwrap();
        }
        let output = controller.step(input);
        (cycle != MISSING).then_some(output)
    });
    file
}

/// The replay of a recording; every cycle of the file is compared.
fn replayed(file: &NamedTempFile, stream: &Stream, config: &Config) -> Replay {
    let recording = Recording::open(file.path()).unwrap();
    let (_, replay) = replay(&recording, recorded_controller(&stream.info, config)).unwrap();
    assert_eq!((replay.compared, replay.unknown_count()), (CYCLES as u64 - 1, 0), "{}", stream.info.name);
    replay
}

/// Instruction sets that round as AVX2 does.
fn levels() -> Vec<Level> {
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let others = [best.as_avx2().map(Level::Avx2), best.as_avx512().map(Level::Avx512)];
    #[cfg(not(target_arch = "x86_64"))]
    let others = [Some(best)];
    [Level::baseline()].into_iter().chain(others.into_iter().flatten()).collect()
}

fn is_repeated(run: &Run) {
    let file = record(run);
    for level in levels() {
        let replay = replayed(&file, &run.stream, &run.stream.config(level));
        assert_eq!(replay.different, 0, "{}, {level:?}: {:?}", run.stream.info.name, replay.largest());
    }
}

#[test]
fn each_stream_is_repeated_from_a_recording_with_every_instruction_set_also_after_a_gap() {
    thread::scope(|scope| AVX2.iter().for_each(|run| drop(scope.spawn(|| is_repeated(run)))));
}

/// The lanes of SSE4.2 differ by rounding, and only a recording of SSE4.2 is repeated with them.
#[cfg(target_arch = "x86_64")]
#[test]
fn another_rounding_is_recognized_and_each_recording_has_the_instruction_set_that_repeats_it() {
    use hexad::daemon::replay::{recorded_config, repeating_level};
    use hexad::recording::RunInfo;
    use hexad_support::not_run::not_run;

    let best = Level::new();
    let (Some(sse4_2), Some(_)) = (super::sse4_2(), best.as_avx2()) else {
        return not_run("the processor has no AVX2");
    };
    assert!(matches!(repeating_level("Avx2", Level::baseline()), Level::Sse2(_)));
    assert!(matches!(repeating_level("Avx2", best), Level::Avx2(_)));
    assert!(matches!(repeating_level("Neon", best), Level::Avx2(_)));
    let run = AVX2.iter().find(|run| run.stream.info.name == "requests_in_motion").unwrap();
    let flushed = || {
        let (file, stream) = (record(run), &run.stream);
        let replay = replayed(&file, stream, &stream.config(sse4_2));
        assert!(replay.different > 0 && replay.is_rounding(1e-3), "{:?}", replay.largest());
        let of_sse4_2 = RunInfo { instruction_set: "Sse4_2".into(), ..stream.info.clone() };
        let again = replayed(&file, stream, &recorded_config(&of_sse4_2, best).unwrap());
        assert_eq!((again.different, again.largest), (replay.different, replay.largest));
    };
    thread::scope(|scope| scope.spawn(flushed).join().unwrap());
}
