//! A recording is repeated with the lanes of every x86 processor.

use std::path::Path;

use fearless_simd::Level;
use hexad::config::Config;
use hexad::daemon::replay::{recorded_config, recorded_controller, repeating_level, replay};
use hexad::recording::RunInfo;
use hexad::recording::reader::Recording;

/// The lanes of a processor without AVX2 repeat what one with it has recorded, those of AVX-512 do, and a recording of SSE4.2 is
/// repeated with SSE4.2.
pub fn all_repeat(file: &Path) {
    let recording = Recording::open(file).unwrap();
    let info = recording.summary().unwrap().info;
    let replayed = |config: &Config| {
        let (_, replayed) = replay(&recording, recorded_controller(&info, config)).unwrap();
        assert!(replayed.compared > 5000 && replayed.unknown_count() == 0, "{}", replayed.compared);
        replayed
    };
    let on = |level: Level| replayed(&Config::parse_on(level, &info.configuration, "the recording").unwrap());

    let best = Level::new();
    assert_eq!(info.instruction_set, "Avx2", "to be recorded on a processor with AVX2");
    let levels =
        [Some(Level::baseline()), best.as_avx2().map(Level::Avx2), best.as_avx512().map(Level::Avx512)];
    for level in levels.into_iter().flatten() {
        let replayed = on(level);
        assert_eq!(replayed.different, 0, "{level:?}: {:?}", replayed.largest());
    }
    assert!(matches!(repeating_level("Avx2", Level::baseline()), Level::Sse2(_)));
    assert!(matches!(repeating_level("Avx2", best), Level::Avx2(_)));
    assert!(matches!(repeating_level("Neon", best), Level::Avx2(_)));

    let sse4_2 = on(best.as_sse4_2().map(Level::Sse4_2).unwrap());
    let beyond = sse4_2.largest.values().filter(|it| it.size() > it.tolerance(1e-3)).collect::<Vec<_>>();
    assert!(sse4_2.different > 0 && sse4_2.is_rounding(1e-3), "{beyond:?}");
    let of_sse4_2 = RunInfo { instruction_set: "Sse4_2".into(), ..info.clone() };
    let repeated = replayed(&recorded_config(&of_sse4_2, best).unwrap());
    assert_eq!((repeated.different, repeated.largest), (sse4_2.different, sse4_2.largest));
}
