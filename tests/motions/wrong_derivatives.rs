//! Setpoints whose derivatives are not those of their poses, at low and high rates.

use super::heave::Heave;
use super::report::{Report, Runs};
use hexad::model::task::TaskState;
use hexad_support::certificate::cases;
use hexad_support::edited::{config, deployed_table, set};
use hexad_support::rig::parameters;

const MACHINES: [&str; 2] = ["reference", "motion_base"];
const RATES_HZ: [f64; 4] = [250.0, 1000.0, 10_000.0, 20_000.0];
/// True peaks of velocity and acceleration \[m/s\], \[m/s^2\]; those of acceleration are beyond the default of 5, as is
/// the last velocity beyond 1.
const PEAKS: [[f64; 2]; 5] = [[0.4, 6.0], [0.4, 11.4], [0.4, 22.8], [1.5, 15.0], [2.4, 40.0]];
const DURATION_S: f64 = 3.0;

/// Which derivatives are sent.
const SENT: [[f64; 2]; 4] = [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0, -1.0]];

#[test]
fn certificate_wrong_derivatives_lead_to_no_motion_beyond_the_limits() {
    let mut report = Report::new("wrong derivatives");
    for (name, rate_hz) in MACHINES.iter().flat_map(|name| RATES_HZ.map(|rate| (name, rate))) {
        let mut table = deployed_table(name);
        set(&mut table, "realtime", "rate_hz", rate_hz);
        for key in ["max_lead_us", "late_wakeup_us", "io_lead_us"] {
            table["realtime"].as_table_mut().unwrap().remove(key);
        }
        let config = config(&table);
        let parameters = parameters(&config);
        let heave = Heave::new(&config.machine, &parameters);
        let mut runs = Runs::default();
        let all = PEAKS.iter().flat_map(|peaks| SENT.map(|sent| (*peaks, sent)));
        for ([v, a], [sent_rate, sent_accel]) in cases(all, 6) {
            let (omega, amplitude) = (a / v, (v * v / a).min(0.4 * (heave.range[1] - heave.range[0])));
            let sine = |t| {
                let task = heave.sine(heave.middle(), amplitude, omega, t);
                TaskState { x: task.x, xd: task.xd * sent_rate, xdd: task.xdd * sent_accel }
            };
            runs.play((&config, parameters), &sine, DURATION_S, |rig, t| rig.input(&sine(t)));
        }
        report.add(&format!("{name} at {rate_hz} Hz"), &runs);
    }
    report.assert();
}
