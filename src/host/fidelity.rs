//! `control.fidelity`: which rung of the ladder the loop runs on, decided once at start-up.

extern crate std;

use std::prelude::rust_2024::*;

use tracing::info;

use super::config::Config;
use super::config::deployment::Fidelity;
use super::numbers::{percent, plain_percent};
use crate::model::active_forces::InverseDynamics;
use crate::model::ladder::Rung;
use crate::scene::envelope::Envelope;
use crate::scene::fidelity::Judgement;
use crate::scene::reach;

/// The envelope of a configuration: as given, or as large as the machine can carry.
pub fn envelope(config: &Config, model: &InverseDynamics) -> Envelope {
    match config.deployment.envelope {
        Some(limits) => Envelope::new(&config.machine.home, limits),
        None => reach::envelope(model),
    }
}

/// The rung that the configuration names, or the cheapest that its envelope allows; says why.
pub fn rung(config: &Config) -> Rung {
    let tolerance = config.deployment.control.fidelity_tolerance;
    match config.deployment.control.fidelity {
        Fidelity::Fixed(Rung::Exact) => Rung::Exact,
        Fidelity::Fixed(rung) => {
            info!(rung = rung.name(), "fidelity: as configured, leaves out {}", rung.leaves_out());
            rung
        }
        Fidelity::Auto => {
            let model = InverseDynamics::new(&config.machine);
            let judgement = Judgement::of_envelope(&model, &envelope(config, &model));
            let rung = judgement.choice(tolerance);
            info!(rung = rung.name(), "fidelity: {}", reason(&judgement, tolerance));
            rung
        }
    }
}

/// Why a judgement leads to its choice.
pub fn reason(judgement: &Judgement, tolerance: f64) -> String {
    use core::fmt::Write as _;
    let chosen = judgement.choice(tolerance);
    let tolerance = plain_percent(tolerance);
    let mut text = String::new();
    // A String takes all.
    for price in judgement.prices.iter().rev() {
        let (what, share) = (price.rung.leaves_out(), percent(price.share));
        let _ = match price.rung {
            rung if rung == chosen && rung == Rung::Exact => {
                write!(text, "nothing may be left out at a tolerance of {tolerance}")
            }
            rung if rung == chosen => {
                write!(
                    text,
                    "leaving out {what} costs at most {share} of the peak force, tolerance {tolerance}"
                )
            }
            // Above the choice there is nothing to decide.
            _ if text.is_empty() => Ok(()),
            rung if !rung.has_inertia() => Ok(()),
            _ => write!(text, "; {what} would cost {share}"),
        };
    }
    text
}
