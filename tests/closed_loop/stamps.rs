//! Time stamps of measurements: of the future, and too old for the loop.

use hexad::control::controller::Output;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::Input;
use hexad::control::signals::state::{Request, State};
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};

use hexad_support::deployed;
use hexad_support::rig::{Rig, in_motion};

/// An input whose measurement is stamped so much later \[ns\].
fn ahead(input: &Input, lead_ns: u64) -> Input {
    let mut input = *input;
    // Half a period passes from the measurement of the rig to the release.
    input.measurement.as_mut().unwrap().time_ns = input.release_ns + lead_ns;
    input
}

#[test]
fn a_measurement_of_the_future_is_refused() {
    let config = deployed("motion_base");
    let bound_ns = (1e9 / config.deployment.realtime.rate_hz) as u64 / 10;
    let engaged = |lead_ns| {
        let mut rig = Rig::new(&config, &config.machine);
        let home = TaskState::at_rest(config.machine.home);
        let cycles = |rig: &mut Rig| rig.cycle(&ahead(&rig.input(&home), lead_ns));
        for _ in 0..100 {
            cycles(&mut rig);
        }
        rig.ask(Request::Engage);
        cycles(&mut rig)
    };
    let found = |output: Output| (output.state, output.request_diagnostic.code);
    assert_eq!(found(engaged(bound_ns)), (State::Engaging, DiagnosticCode::None));
    for lead_ns in [bound_ns + 1000, 19_000_000] {
        assert_eq!(found(engaged(lead_ns)), (State::Off, DiagnosticCode::MeasurementStampInvalid));
    }
}

/// Taken for measurements of now they put the platform beside its reference, by velocity times the lead.
#[test]
fn stamps_of_the_future_end_control_while_the_platform_is_on_its_reference() {
    let config = deployed("motion_base");
    let (mut rig, _) = in_motion(&config);
    let scene = fit(&config.machine, BuiltInMotion::Sines, 8.0);
    let period_s = rig.parameters.period_ns as f64 * 1e-9;
    let mut farthest = 0.0_f64;
    let end = (1500..2500).find_map(|k| {
        let input = ahead(&rig.input(&scene.at(period_s * f64::from(k))), 19_000_000);
        let output = rig.cycle(&input);
        let reference = output.reference.filter(|_| output.state.has_control());
        let Some(reference) = reference else { return Some((k - 1500, output.diagnostic.code)) };
        // The reference is that of the end of the hold, at which the platform now is.
        let error = reference.pose.position - rig.simulator().state().pose.position;
        farthest = farthest.max(error.norm());
        None
    });
    println!("{end:?}, {farthest:.2e} m");
    let (cycles, code) = end.expect("control ends");
    assert_eq!(code, DiagnosticCode::MeasurementStampInvalid);
    assert!(cycles <= 21 && farthest < 4e-4, "{cycles} cycles, {farthest:.2e} m");
}
