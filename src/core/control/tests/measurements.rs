//! Tests of the validation of measurements: each check alone, next to its bound.

use crate::control::sensing::measurement::MeasurementValidator;
use crate::control::tests::*;

/// Release of the first cycle.
const START_NS: u64 = 1000 * MS;

fn constants() -> Constants {
    let machine = machine(&mut RandomVectors::new(71));
    Constants::new(&machine, Parameters { max_age_at_arrival_ns: 5 * MS, ..parameters(&machine) })
}

/// Validator in a state, and the leg lengths at home.
struct Bench {
    constants: Constants,
    state: State,
    validator: MeasurementValidator,
    home: [f64; LEGS],
}

impl Bench {
    fn new(state: State) -> Self {
        let constants = constants();
        let home = leg_lengths(constants.machine(), constants.home.pose());
        Self { constants, state, validator: MeasurementValidator::default(), home }
    }

    /// Bench after a first cycle at home, with the same rate for every leg.
    fn begun(state: State, rate: Option<f64>) -> Self {
        let mut bench = Self::new(state);
        let first = Measurement { rate_m_s: rate.map(|rate| [rate; LEGS]), ..bench.at(0, 0.0) };
        assert_eq!(bench.validate(0, Some(&first)), Ok(first.time_ns));
        bench
    }

    /// Measurement in which every leg is longer than at home.
    fn at(&self, after_ns: u64, longer: f64) -> Measurement {
        let length_m = self.home.map(|length| length + longer);
        Measurement { time_ns: START_NS + after_ns, length_m, ..Measurement::default() }
    }

    /// Time stamp of the valid measurement in a cycle.
    fn validate(&mut self, after_ns: u64, newest: Option<&Measurement>) -> Result<u64, Diagnostic> {
        let cycle = Cycle { constants: &self.constants, release_ns: START_NS + after_ns, state: self.state };
        self.validator.validate(&cycle, newest).map(|valid| valid.time_ns)
    }

    fn accepts(&mut self, after_ns: u64, new: &Measurement) -> bool {
        self.validate(after_ns, Some(new)) == Ok(new.time_ns)
    }

    /// Code with which the very first message is rejected.
    fn first(new: impl FnOnce(&Self) -> Measurement) -> Option<DiagnosticCode> {
        let mut bench = Self::new(State::Standby);
        let new = new(&bench);
        bench.validate(0, Some(&new)).err().map(|found| found.code)
    }
}

#[test]
fn the_first_measurement_is_finite_within_the_stroke_and_recent() {
    let machine = machine(&mut RandomVectors::new(71));
    let Actuator { min_length_m, max_length_m, .. } = machine.actuator;
    let tolerance = 0.02 * machine.actuator.stroke();
    for leg in 0..LEGS {
        for (end, sign) in [(min_length_m, -1.0), (max_length_m, 1.0)] {
            let refused = |share: f64| {
                Bench::first(|bench| {
                    let mut new = bench.at(0, 0.0);
                    new.length_m[leg] = end + sign * share * tolerance;
                    new
                })
            };
            assert_eq!((refused(0.99), refused(1.01)), (None, Some(DiagnosticCode::LengthOutOfStroke)));
        }
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for is_rate in [false, true] {
                let mut bench = Bench::new(State::Standby);
                let mut new = Measurement { rate_m_s: Some([0.0; LEGS]), ..bench.at(0, 0.0) };
                let numbers = if is_rate { new.rate_m_s.as_mut().unwrap() } else { &mut new.length_m };
                numbers[leg] = value;
                let expected = Diagnostic::from(DiagnosticCode::MeasurementNotFinite).at(leg);
                assert_eq!(bench.validate(0, Some(&new)).err(), Some(expected), "{value} {is_rate}");
            }
        }
    }
    // Accepted up to a tenth of the period ahead and up to 5 ms old. Beyond the timeout the stamp is not from
    // this clock.
    let stamped = |offset_ns: i64| {
        Bench::first(|bench| Measurement {
            time_ns: START_NS.saturating_add_signed(offset_ns),
            ..bench.at(0, 0.0)
        })
    };
    assert_eq!((stamped(100_000), stamped(-5_000_000)), (None, None));
    assert_eq!(stamped(100_001), Some(DiagnosticCode::MeasurementStampInvalid));
    assert_eq!(stamped(-5_000_001), Some(DiagnosticCode::MeasurementTooOld));
    let mut bench = Bench::new(State::Standby);
    let old = Measurement { time_ns: START_NS - 6 * MS, ..bench.at(0, 0.0) };
    let found = bench.validate(0, Some(&old)).unwrap_err();
    assert!((found.value - 6e-3).abs() < 1e-12 && (found.bound - 5e-3).abs() < 1e-12, "{found:?}");
    for offset_ns in [-10_000_001, 10_000_001, i64::MAX] {
        assert_eq!(stamped(offset_ns), Some(DiagnosticCode::MeasurementStampInvalid), "{offset_ns}");
    }
}

#[test]
fn lengths_change_no_faster_than_a_drive_under_an_external_force() {
    let bound = 1.5 * 1.0 * 1e-3 + 1e-3 * (2.6 - 0.9);
    for state in [State::Standby, State::Active] {
        for sign in [-1.0, 1.0] {
            for (share, is_accepted) in [(0.99, true), (1.01, false)] {
                let mut bench = Bench::begun(state, None);
                let new = bench.at(MS, sign * share * bound);
                assert_eq!(bench.accepts(MS, &new), is_accepted, "{state:?} {sign} {share}");
                // A rejected measurement counts as missing.
                let missed = u64::from(state == State::Active && !is_accepted);
                assert_eq!(bench.validator.cycles_without_valid, missed);
                // The same message is not validated twice.
                let _ = bench.validate(2 * MS, Some(&new));
                assert_eq!(bench.validator.cycles_without_valid, missed + u64::from(state == State::Active));
            }
        }
    }
    // A measurement earlier than the previous one is rejected.
    let mut bench = Bench::begun(State::Active, None);
    let before = Measurement { time_ns: START_NS - 1, ..bench.at(0, 0.0) };
    assert!(!bench.accepts(MS, &before));
}

/// While measurements are rejected, the plausible change grows for two cycles only.
#[test]
fn rejected_measurements_do_not_widen_the_plausible_change() {
    for is_rate in [false, true] {
        for is_disturbed in [false, true] {
            let mut bench = Bench::begun(State::Active, is_rate.then_some(0.0));
            for k in 1..5 {
                let mut far = bench.at(k * MS, 0.5);
                far.rate_m_s = is_rate.then_some([0.0; LEGS]);
                assert!(!is_disturbed || !bench.accepts(k * MS, &far));
            }
            // A change that five cycles allow, and one that two cycles allow.
            let change = |s: f64| if is_rate { 60.0 * s } else { 1.5 * s };
            for (seconds, is_accepted) in [(4.5e-3, !is_disturbed), (1.9e-3, true)] {
                let mut new =
                    bench.at(5 * MS, if is_rate { 2.5e-3 * change(seconds) } else { change(seconds) });
                new.rate_m_s = is_rate.then_some([change(seconds); LEGS]);
                let mut bench = Bench { validator: bench.validator, constants: constants(), ..bench };
                assert_eq!(bench.accepts(5 * MS, &new), is_accepted, "{is_rate} {is_disturbed} {seconds}");
            }
        }
    }
}

/// After a pause within the timeout, the measurement that waited is too old. The next measurement shows how
/// far the legs moved meanwhile.
#[test]
fn a_measurement_that_waited_while_the_loop_paused_does_not_refuse_those_after_it() {
    for (rate, is_accepted) in [(1.0, true), (2.0, false)] {
        let mut bench = Bench::begun(State::Active, None);
        let waited = bench.at(MS, rate * 1e-3);
        assert!(!bench.accepts(8 * MS, &waited));
        let fresh = bench.at(9 * MS, rate * 9e-3);
        assert_eq!(bench.accepts(9 * MS, &fresh), is_accepted, "{rate}");
    }
}

#[test]
fn rates_change_no_faster_than_a_drive_accelerates_and_are_those_of_the_lengths() {
    let bound = 60.0 * 1e-3 + 0.02 * 1.0;
    for sign in [-1.0, 1.0] {
        for (share, is_accepted) in [(0.99, true), (1.01, false)] {
            let mut bench = Bench::begun(State::Active, Some(0.0));
            let rate = sign * share * bound;
            let new = Measurement { rate_m_s: Some([rate; LEGS]), ..bench.at(MS, 0.5 * rate * 1e-3) };
            assert_eq!(bench.accepts(MS, &new), is_accepted, "{sign} {share}");
        }
        // Lengths that do not move despite their rates, then lengths that move at their rates.
        for is_consistent in [false, true] {
            let rate = sign * 0.05;
            let mut bench = Bench::begun(State::Active, Some(rate));
            let refused = (1..60).find(|k| {
                let way = if is_consistent { rate * (*k as f64) * 1e-3 } else { 0.0 };
                let new = Measurement { rate_m_s: Some([rate; LEGS]), ..bench.at(k * MS, way) };
                !bench.accepts(k * MS, &new)
            });
            assert_eq!(refused.is_none(), is_consistent, "{sign}: {refused:?}");
        }
    }
}

/// Without control a measurement after the timeout need not continue the previous one. Under control it is
/// rejected.
#[test]
fn a_gap_ends_control_and_without_control_the_pose_may_be_another() {
    let mut bench = Bench::begun(State::Standby, None);
    let elsewhere = bench.at(9 * MS, 0.3);
    assert!(!bench.accepts(9 * MS, &elsewhere));
    let mut bench = Bench::begun(State::Standby, None);
    let elsewhere = bench.at(11 * MS, 0.3);
    assert!(bench.accepts(11 * MS, &elsewhere));
    // After a gap, a fresh measurement does not continue control.
    let mut bench = Bench::begun(State::Active, None);
    let fresh = bench.at(11 * MS, 0.0);
    assert!(!bench.accepts(11 * MS, &fresh));
    let mut bench = Bench::begun(State::Active, None);
    let fresh = bench.at(10 * MS, 0.0);
    assert!(bench.accepts(10 * MS, &fresh));
    for state in [State::Standby, State::Active] {
        let mut bench = Bench::begun(state, None);
        assert_eq!((1..=10).find(|k| bench.validate(k * MS, None).is_err()), None);
        assert_eq!(bench.validate(11 * MS, None).unwrap_err().code, DiagnosticCode::MeasurementLost);
    }
}
