//! `off` in motion and `park` at once, again and again until it is accepted, while measurements arrive late and some do not
//! arrive: control begins with the motion that the platform has then, not with the one that was measured.

use hexad::config::Config;
use hexad::control::signals::inputs::Input;
use hexad::control::signals::state::{Request, State};

use super::heave::{Heave, duration_s};
use super::report::{Report, Runs};
use hexad_support::edited::{config, deployed_table, set};
use hexad_support::extremes::Quantity;
use hexad_support::rig::{Rig, parameters};

const MACHINES: [&str; 4] = ["reference", "motion_base", "fried2008", "tsai2000"];
const RATES_HZ: [f64; 2] = [100.0, 1000.0];
/// Longest heave \[m\].
const LONGEST_HEAVE_M: f64 = 0.4;
/// Parts of the heave's time at which the operator requests `off`.
const PHASES: [f64; 3] = [0.3, 0.5, 0.7];
/// Age of the measurements, and from one to the next that arrives, in periods.
const AGES: [usize; 2] = [0, 1];
const INTERVALS: [usize; 2] = [1, 2];
/// Largest distance from the reference over the following limit: with the measured motion it is the limit itself.
const FARTHEST_RATIO: f64 = 0.05;
/// What it may take until control begins, and how long it is watched from then on \[s\].
const LONGEST_PAUSE_S: f64 = 1.0;
const WATCHED_S: f64 = 0.3;

fn configured(name: &str, rate_hz: f64) -> Config {
    let mut table = deployed_table(name);
    for section in ["realtime", "control", "limits", "timeouts"] {
        table.remove(section);
    }
    set(&mut table, "realtime", "rate_hz", rate_hz);
    config(&table)
}

/// One run; whether control began while the platform moved.
fn release_and_park(
    begun: &Rig,
    heave: impl Fn(f64) -> Input,
    off_s: f64,
    late: [usize; 2],
    runs: &mut Runs,
) -> bool {
    let mut observed = begun.clone();
    let (mut measured, mut cycle, mut has_begun_s, mut was_moving) = (Vec::new(), 0, None, false);
    let mut state = State::Active;
    while observed.time_s() < has_begun_s.map_or(off_s + LONGEST_PAUSE_S, |begun_s| begun_s + WATCHED_S) {
        if observed.time_s() >= off_s && has_begun_s.is_none() {
            observed.ask(if state == State::Active { Request::Off } else { Request::Park });
        }
        let [age, interval] = late;
        measured.push(observed.measurement());
        cycle += 1;
        let newest = measured.len().saturating_sub(1 + age);
        let measurement = measured[newest - newest % interval];
        let before = observed.simulator().state().twist.linear.norm();
        let input = Input {
            release_ns: observed.release_ns(),
            measurement: Some(measurement),
            request: observed.asked,
            ..heave(observed.time_s())
        };
        let output = observed.cycle(&input);
        if observed.time_s() > off_s && output.state.has_control() && has_begun_s.is_none() && cycle > 1 {
            if state == State::Active {
                continue;
            }
            (has_begun_s, was_moving) = (Some(observed.time_s()), before > 0.0);
        }
        state = output.state;
    }
    runs.accepted += u32::from(has_begun_s.is_some());
    runs.add(&observed);
    was_moving
}

#[test]
fn control_begins_with_the_motion_that_the_platform_has() {
    let mut report = Report::new("old measurements");
    for (name, rate_hz) in MACHINES.into_iter().flat_map(|name| RATES_HZ.map(|rate_hz| (name, rate_hz))) {
        let config = configured(name, rate_hz);
        let parameters = parameters(&config);
        let heave = Heave::new(&config.machine, &parameters);
        let distance = LONGEST_HEAVE_M.min(heave.range[1] - heave.range[0]);
        let ends = [heave.middle() - 0.5 * distance, heave.middle() + 0.5 * distance];
        let duration_s = duration_s(&parameters, &config.machine, distance);
        let mut begun = Rig::standing(&config, parameters, &heave.moving(ends, duration_s, 0.0));
        begun.engage(&heave.moving(ends, duration_s, 0.0));
        let start_s = begun.time_s();
        let (mut runs, mut moving) = (Runs::default(), 0);
        for (age, interval) in AGES.into_iter().flat_map(|age| INTERVALS.map(|interval| (age, interval))) {
            for phase in PHASES {
                let input = |t: f64| begun.input(&heave.moving(ends, duration_s, t - start_s));
                let input = |t: f64| {
                    let mut input = input(t);
                    if let Some(setpoint) = &mut input.setpoint {
                        setpoint.time_ns = begun.now_ns + ((t - start_s) * 1e9).round() as u64;
                    }
                    input
                };
                let off_s = start_s + phase * duration_s;
                moving += u32::from(release_and_park(&begun, input, off_s, [age, interval], &mut runs));
            }
        }
        println!(
            "{name} at {rate_hz} Hz: {} of {} began in motion, {:.4} of the following limit",
            moving,
            runs.count,
            runs.extremes.of(Quantity::Following)
        );
        report.add(name, &runs);
        report.bound(name, "distance", runs.extremes.of(Quantity::Following), FARTHEST_RATIO);
        report.bound(name, "runs refused", f64::from(runs.count - runs.accepted), 0.0);
        report.bound(name, "none in motion", f64::from(u32::from(moving == 0 && rate_hz > 100.0)), 0.0);
    }
    report.assert();
}
