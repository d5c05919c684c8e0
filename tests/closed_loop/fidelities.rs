//! The loop on every fidelity of the ladder: what a fidelity leaves out is a disturbance, which feedback holds, as
//! long as the fidelity has the inertia to do it.

use hexad::config::deployment::FidelityChoice;
use hexad::control::controller::Controller;
use hexad::control::parameters::Parameters;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::model::fidelity::Fidelity;
use hexad::motion::built_in::{BuiltInMotion, fit};

use hexad_support::deployed;
use hexad_support::rig::{Rig, parameters, track};

#[test]
fn the_loop_tracks_on_every_rung_with_inertia_and_better_on_higher_ones() {
    let mut config = deployed("fried2008");
    let mut before = f64::INFINITY;
    for fidelity in Fidelity::ALL.into_iter().filter(|fidelity| fidelity.has_inertia()) {
        config.deployment.control.fidelity = FidelityChoice::Fixed(fidelity);
        // Without the mass of the legs feedback must carry their weight, more than its bound lets it by default.
        config.deployment.limits.feedback_scale = if fidelity == Fidelity::MasslessLegs { 10.0 } else { 0.5 };
        let tracking = track(&config, &config.machine, BuiltInMotion::Sines, 8.0);
        let rms = tracking.position.rms();
        println!("{fidelity:?}: RMS {:.2} um, max {:.2} um", rms * 1e6, tracking.position.max * 1e6);
        // The spin is worth less than a nanometre here.
        assert!(rms < before + 1e-9, "{fidelity:?}: {rms} m after {before} m");
        // Without the mass of the legs the platform hangs lower by their weight over Kp.
        assert!(tracking.position.max < 8e-3, "{fidelity:?}: {} m", tracking.position.max);
        before = rms;
    }
}

/// Why the configuration does not offer it.
#[test]
fn without_inertia_there_is_no_feedback() {
    let config = deployed("fried2008");
    let mut rig = Rig::new(&config, &config.machine);
    rig.controller =
        Controller::new(&config.machine, Parameters { fidelity: Fidelity::Gravity, ..parameters(&config) });
    let scene = fit(&config.machine, BuiltInMotion::Sines, 8.0);
    rig.engage(&scene.at(0.0));
    let (mut before, mut seen) = (State::Active, Vec::new());
    for k in 0..3000 {
        let input = rig.input(&scene.at(1e-3 * f64::from(k)));
        let output = rig.cycle(&input);
        if output.state != before {
            seen.push((output.state, output.diagnostic.code));
            before = output.state;
        }
        if output.state == State::Fault {
            // Feedback does nothing, so it stays saturated.
            assert_eq!(seen, [(State::Fault, DiagnosticCode::FeedbackSaturated)], "cycle {k}");
            return;
        }
    }
    panic!("the platform follows without feedback");
}
