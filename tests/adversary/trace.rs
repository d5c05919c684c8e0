//! A run in words and numbers, for a person who looks into a violation.

use hexad::control::controller::Output;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::errors::PoseError;
use hexad::control::signals::inputs::Input;
use hexad::model::inverse_geometry::universal_sine;
use hexad::model::kinematic_state::KinematicState;
use hexad::plant::simulator::Brakes;

use hexad_support::extremes::{Extremes, Quantity};
use hexad_support::rig::Rig;

/// Largest values below this are not printed.
const WORTH_PRINTING: f64 = 0.9;

/// Prints a cycle in which the state changed or a quantity was never as large.
pub fn print(observed: &Rig, input: &Input, output: &Output, before: &mut Extremes) {
    let now = observed.meter().extremes;
    let grown: Vec<_> = Quantity::all()
        .filter(|quantity| now.of(*quantity) > before.of(*quantity).max(WORTH_PRINTING * quantity.allowed()))
        .map(|quantity| format!("{} {:.4}", quantity.name(), now.of(quantity)))
        .collect();
    *before = now;
    let state = observed.simulator().state();
    let (v, omega) = (state.twist.linear.norm(), state.twist.angular.norm());
    let planned = output.reference.map(|motion| {
        let [v, a] = [motion.twist.linear.norm(), motion.acceleration.linear.norm()];
        let [omega, alpha] = [motion.twist.angular.norm(), motion.acceleration.angular.norm()];
        format!("v {v:.4} a {a:.3} omega {omega:.4} alpha {alpha:.3}")
    });
    let condition = KinematicState::new(&observed.machine, state.pose).sensitivity().condition;
    let sine = universal_sine(&observed.machine, &state.pose);
    let force = output.command_n.iter().fold(0.0_f64, |largest, force| largest.max(force.abs()));
    let (away, away_rate) = output.error.map_or((f64::NAN, f64::NAN), |PoseError { pose, twist }| {
        (pose.vector().norm(), twist.vector().norm())
    });
    let age_ms =
        |time_ns: Option<u64>| time_ns.map(|ns| (input.release_ns - ns.min(input.release_ns)) as f64 * 1e-6);
    let code = match output.diagnostic.code {
        DiagnosticCode::None => String::new(),
        code => format!("{code:?} {:.3}", output.diagnostic.value),
    };
    println!(
        "{:.5} {} {code} | true v {v:.4} omega {omega:.4} condition {condition:.1} sine {sine:.3} {} \
         | force {force:.0} error {away:.1e} {away_rate:.1e} | reference {} \
         | setpoint age {:.2?} ms, measured {:.2?} ms | limits {:?} {:?} | {}",
        observed.time_s(),
        output.state.name(),
        if observed.simulator().brakes() == Brakes::Open { "" } else { "brakes" },
        planned.unwrap_or_default(),
        age_ms(input.setpoint.map(|setpoint| setpoint.time_ns)),
        age_ms(input.measurement.map(|measurement| measurement.time_ns)),
        output.active_limits,
        output.request_diagnostic.code,
        grown.join(", ")
    );
}
