//! Fidelity of the dynamic model that the loop uses, `control.fidelity`; decided once at start-up.

use tracing::info;

use super::Config;
use super::deployment::FidelityChoice;
use crate::analysis::envelope::Envelope;
use crate::analysis::fidelity_choice::Judgement;
use crate::analysis::reachable_envelope;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Fidelity;
use crate::output::numbers::{percent, plain_percent};

/// Envelope of a configuration: as given, or as large as the machine can carry.
pub fn envelope(config: &Config, model: &InverseDynamics) -> Envelope {
    match config.deployment.envelope {
        Some(limits) => Envelope::new(&config.machine.home, limits),
        None => reachable_envelope::envelope(model),
    }
}

/// The configured fidelity, or the cheapest that the envelope allows; logs the reason.
pub fn fidelity(config: &Config) -> Fidelity {
    let tolerance = config.deployment.control.fidelity_tolerance;
    match config.deployment.control.fidelity {
        FidelityChoice::Fixed(Fidelity::Exact) => Fidelity::Exact,
        FidelityChoice::Fixed(fidelity) => {
            info!(
                fidelity = fidelity.name(),
                "fidelity: as configured, leaves out {}",
                fidelity.leaves_out()
            );
            fidelity
        }
        FidelityChoice::Auto => {
            let model = InverseDynamics::new(&config.machine);
            let judgement = Judgement::of_envelope(&model, &envelope(config, &model));
            let fidelity = judgement.choice(tolerance);
            info!(fidelity = fidelity.name(), "fidelity: {}", reason(&judgement, tolerance));
            fidelity
        }
    }
}

/// Reason for the choice of a fidelity, with the errors of those that were rejected.
pub fn reason(judgement: &Judgement, tolerance: f64) -> String {
    use core::fmt::Write as _;
    let chosen = judgement.choice(tolerance);
    let tolerance = plain_percent(tolerance);
    let mut text = String::new();
    // A String takes all.
    for price in judgement.prices.iter().rev() {
        let (what, share) = (price.fidelity.leaves_out(), percent(price.share));
        let _ = match price.fidelity {
            fidelity if fidelity == chosen && fidelity == Fidelity::Exact => {
                write!(text, "nothing may be left out at a tolerance of {tolerance}")
            }
            fidelity if fidelity == chosen => {
                write!(
                    text,
                    "leaving out {what} costs at most {share} of the peak force, tolerance {tolerance}"
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
