use super::*;

/// 10 Hz at 1 kHz, the force 0.6 periods after the measurement.
fn at_10_hz(estimator_hz: f64, told_ms: f64) -> SampledLoop {
    SampledLoop {
        wn_t: core::f64::consts::TAU * 10.0 * 1e-3,
        estimator_ratio: estimator_hz / 10.0,
        known_delay_periods: 0.6 + told_ms,
        delay_periods: 0.6 + told_ms,
        ..SampledLoop::default()
    }
}

/// Figures of an independent computation: masses, and further delay \[ms\].
#[test]
fn margins_are_those_of_an_independent_computation() {
    for (estimator_hz, told_ms, [lightest, heaviest, further]) in [
        (10.0, 0.0, [0.39, 2.7, 6.2]),
        (20.0, 0.0, [0.44, 3.4, 4.0]),
        (30.0, 0.0, [0.45, 4.2, 3.4]),
        (30.0, 5.0, [0.69, 3.3, 3.2]),
        (30.0, 10.0, [0.78, 2.9, 3.1]),
    ] {
        let each = at_10_hz(estimator_hz, told_ms);
        let masses = [1.0 / each.gain_margin(), 1.0 / each.least_gain()];
        let delay = each.longest_delay() - each.delay_periods;
        println!("{estimator_hz} Hz, {told_ms} ms: {masses:.3?}, {delay:.3}");
        assert!((masses[0] - lightest).abs() < 0.006 && (masses[1] - heaviest).abs() < 0.06, "{masses:?}");
        assert!((delay - further).abs() < 0.06, "{delay}");
    }
}

#[test]
fn noise_is_that_of_an_independent_simulation() {
    // Of 10 um on the lengths, in um; the simulation has six axes, so a share of it is geometry.
    let noise = |estimator_hz| at_10_hz(estimator_hz, 0.0).noise([10.0, 0.0]);
    let found = [10.0, 20.0, 30.0, 40.0].map(noise);
    println!("{found:.3?}");
    let shares = found.map(|noise| noise / found[2]);
    for (share, expected) in shares.iter().zip([4.5 / 6.3, 5.7 / 6.3, 1.0, 6.7 / 6.3]) {
        assert!((share - expected).abs() < 0.04, "{shares:?}");
    }
}

#[test]
fn a_loop_beyond_its_margins_grows_and_within_them_fades() {
    for (each, is_stable) in [0.97, 1.03].into_iter().flat_map(|share: f64| {
        let with = at_10_hz(30.0, 2.0);
        let gain = share * with.gain_margin();
        let light = SampledLoop { mass_ratio: 1.0 / gain, ..with };
        let late = SampledLoop {
            delay_periods: with.delay_periods + share * (with.longest_delay() - with.delay_periods),
            ..with
        };
        [(light, share < 1.0), (late, share < 1.0)]
    }) {
        let response = each.response(0.0, 1e-3, 4000);
        let peak = |part: &[f64]| part.iter().fold(0.0, |peak: f64, e| peak.max(e.abs()));
        let (early, late) = (peak(&response[..1000]), peak(&response[3000..]));
        assert_eq!(late < early, is_stable, "{each:?}: {early} {late}");
        assert_eq!(each.is_stable(), is_stable);
    }
}

#[test]
fn what_is_stable_is_one_interval_of_bandwidths_and_of_delays() {
    for compensates_disturbance in [true, false] {
        for delay_periods in [0.6, 2.1, 5.3] {
            let each = SampledLoop {
                compensates_disturbance,
                known_delay_periods: delay_periods - 0.5,
                delay_periods,
                ..at_10_hz(10.0, 0.0)
            };
            let limit = each.largest_wn_t();
            for percent in (5..300).step_by(5).filter(|percent| *percent != 100) {
                let share = 0.01 * f64::from(percent);
                let at = SampledLoop { wn_t: share * limit, ..each };
                assert_eq!(at.is_stable(), share < 1.0, "{at:?}, limit {limit}");
            }
            let longest = each.longest_delay();
            for tenth in (0..600).filter(|tenth| (0.1 * f64::from(*tenth) - longest).abs() > 0.05) {
                let at = SampledLoop { delay_periods: delay_periods.max(0.1 * f64::from(tenth)), ..each };
                assert_eq!(at.is_stable(), at.delay_periods < longest, "{at:?}, {longest}");
            }
        }
    }
}
