//! Fidelity of the dynamic model that the loop uses, `control.fidelity`; decided once at start-up.

use tracing::info;

use super::Config;
use super::deployment::FidelityChoice;
use crate::analysis::envelope::MotionEnvelope;
use crate::analysis::fidelity_choice::FidelityComparison;
use crate::analysis::reachable_envelope;
use crate::text::numbers::{percent, plain_percent};
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Fidelity;

/// Envelope of a configuration: as given, or as large as the machine can carry.
pub fn envelope(config: &Config, model: &InverseDynamics) -> MotionEnvelope {
    match config.deployment.envelope {
        Some(limits) => MotionEnvelope::new(&config.machine.home, limits),
        None => reachable_envelope::reachable_envelope(model),
    }
}

/// The configured fidelity, or the cheapest that the envelope allows; logs the reason.
pub fn fidelity(config: &Config) -> Fidelity {
    let tolerance = config.deployment.control.fidelity_tolerance_share;
    match config.deployment.control.fidelity {
        FidelityChoice::Fixed(Fidelity::Exact) => Fidelity::Exact,
        FidelityChoice::Fixed(fidelity) => {
            info!(
                fidelity = fidelity.name(),
                "fidelity: as configured, leaves out {}",
                fidelity.left_out_terms()
            );
            fidelity
        }
        FidelityChoice::Auto => {
            let model = InverseDynamics::new(&config.machine);
            let comparison = FidelityComparison::of_envelope(&model, &envelope(config, &model));
            let fidelity = comparison.choice(tolerance);
            info!(fidelity = fidelity.name(), "fidelity: {}", reason(&comparison, tolerance));
            fidelity
        }
    }
}

/// Reason for the choice of a fidelity, with the errors of those that were rejected.
pub fn reason(comparison: &FidelityComparison, tolerance: f64) -> String {
    use core::fmt::Write as _;
    let chosen = comparison.choice(tolerance);
    let tolerance = plain_percent(tolerance);
    let mut text = String::new();
    // A String takes all.
    for error in comparison.errors.iter().rev() {
        let (what, share) = (error.fidelity.left_out_terms(), percent(error.share));
        let _ = match error.fidelity {
            fidelity if fidelity == chosen && fidelity == Fidelity::Exact => {
                write!(text, "nothing may be left out at a tolerance of {tolerance}")
            }
            fidelity if fidelity == chosen => {
                write!(
                    text,
                    "leaving out {what} costs {share} of the peak force, the largest found; tolerance {tolerance}"
                )
            }
            // Fidelities with more terms than the chosen one need no reason.
            _ if text.is_empty() => Ok(()),
            fidelity if !fidelity.has_inertia() => Ok(()),
            _ => write!(text, "; {what} would cost {share}"),
        };
    }
    text
}
