//! `off` and `park`, or `estop`, `clear` and `park`, while the platform moves: its brakes have just begun to close when
//! control begins again.

use hexad::control::signals::state::{Request, State};

use super::heave::{Heave, duration_s};
use super::report::{Report, Runs};
use hexad_support::certificate::cases;
use hexad_support::deployed;
use hexad_support::rig::{Rates, Rig, parameters};

const MACHINES: [&str; 4] = ["reference", "motion_base", "fried2008", "tsai2000"];
/// Longest heave \[m\]; a machine whose legs reach less far heaves as far as they reach.
const LONGEST_HEAVE_M: f64 = 0.4;
/// Parts of the heave's time at which the operator requests `off`.
const PHASES: [f64; 7] = [0.2, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85];
/// Times from one request to the next: of a shell, up to a brake that has nearly closed \[s\].
const PAUSES_S: [f64; 5] = [0.002, 0.005, 0.01, 0.02, 0.05];
/// What parking may take \[s\].
const LONGEST_PARKING_S: f64 = 8.0;

fn release_and_park(name: &str, requests: &[Request], runs: &mut Runs) {
    let config = deployed(name);
    let parameters = parameters(&config);
    let heave = Heave::new(&config.machine, &parameters);
    let distance = LONGEST_HEAVE_M.min(heave.range[1] - heave.range[0]);
    let (low, high) = (heave.middle() - 0.5 * distance, heave.middle() + 0.5 * distance);
    let duration_s = duration_s(&parameters, &config.machine, distance);
    let ways = [[low, high], [high, low]].into_iter().flat_map(|way| Rates::ALL.map(|rates| (way, rates)));
    for ([from, to], rates) in ways {
        let mut begun = Rig::standing(&config, parameters, &heave.moving([from, to], duration_s, 0.0));
        begun.rates = rates;
        begun.engage(&heave.moving([from, to], duration_s, 0.0));
        let start_s = begun.time_s();
        let all = PHASES.iter().flat_map(|phase| PAUSES_S.map(|pause| (phase, pause)));
        for (phase, pause_s) in cases(all, 7) {
            let mut observed = begun.clone();
            let asked_at = |number: usize| start_s + phase * duration_s + pause_s * number as f64;
            let (mut asked, mut has_begun, mut has_parked) = (0, false, false);
            while observed.time_s() < start_s + duration_s + LONGEST_PARKING_S && !has_parked {
                if asked < requests.len() && observed.time_s() >= asked_at(asked) {
                    observed.ask(requests[asked]);
                    asked += 1;
                }
                let task = heave.moving([from, to], duration_s, observed.time_s() - start_s);
                let output = observed.cycle(&observed.input(&task));
                let refused = Some(output.answered_message) == observed.asked.map(|asked| asked.message)
                    && !output.state.has_control();
                has_begun |= output.state == State::Parking;
                has_parked = asked == requests.len() && (output.state == State::Off || refused);
            }
            runs.accepted += u32::from(has_begun);
            runs.add(&observed);
        }
    }
}

#[test]
fn certificate_a_platform_that_is_released_in_motion_and_parked_stays_within_the_limits() {
    let mut report = Report::new("released in motion");
    for name in MACHINES {
        let mut runs = Runs::default();
        release_and_park(name, &[Request::Off, Request::Park], &mut runs);
        release_and_park(name, &[Request::Estop, Request::Clear, Request::Park], &mut runs);
        report.add(name, &runs);
        report.bound(name, "all runs refused", f64::from(u32::from(runs.accepted == 0)), 0.0);
    }
    report.assert();
}
