//! The methods of hexad: the fidelities, and the instruction sets of this CPU.

use fearless_simd::Level;
use hexad::model::LEGS;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::{
    Exact, Fidelity, Gravity, LumpedLegs, MasslessLegs, ModelTerms, NoVelocity, RigidLegs,
};
use hexad::model::rigid::Motion;

use super::timing::sample;

/// Forces of the six legs, `None` at a singular pose.
pub type Forces = Option<[f64; LEGS]>;

/// One fidelity.
#[derive(Clone, Copy)]
pub struct Method {
    pub fidelity: Fidelity,
    pub forces: fn(&InverseDynamics, &Motion) -> Forces,
    /// Time per evaluation \[ns\] of some passes over the motions, fenced or not. A function of its own for
    /// each method: what is called in the loop is known when it is compiled, as in a controller.
    pub sample: fn(&InverseDynamics, &[Motion], usize, bool) -> f64,
}

impl Method {
    pub fn new(fidelity: Fidelity) -> Self {
        match fidelity {
            Fidelity::Gravity => Self::of::<Gravity>(fidelity),
            Fidelity::MasslessLegs => Self::of::<MasslessLegs>(fidelity),
            Fidelity::LumpedLegs => Self::of::<LumpedLegs>(fidelity),
            Fidelity::NoVelocity => Self::of::<NoVelocity>(fidelity),
            Fidelity::RigidLegs => Self::of::<RigidLegs>(fidelity),
            Fidelity::Exact => Self::of::<Exact>(fidelity),
        }
    }

    fn of<M: ModelTerms>(fidelity: Fidelity) -> Self {
        Self {
            fidelity,
            forces: |dynamics, motion| dynamics.forces::<M>(motion),
            sample: |dynamics, motions, passes, fenced| {
                sample(motions, passes, fenced, |motion| dynamics.forces::<M>(motion))
            },
        }
    }
}

/// Instruction sets of this CPU, the best first.
pub fn instruction_sets() -> Vec<(&'static str, Level)> {
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let sets = [
        ("avx512", best.as_avx512().map(Level::Avx512)),
        ("avx2", best.as_avx2().map(Level::Avx2)),
        // With SSE2 the lanes repeat what others have recorded, and are slow.
        ("sse4_2", best.as_sse4_2().map(Level::Sse4_2)),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let sets = [(BASELINE, Some(best))];
    sets.into_iter().filter_map(|(name, level)| Some((name, level?))).collect()
}

/// What code is compiled for that chooses nothing at run time.
#[cfg(target_arch = "x86_64")]
pub const BASELINE: &str = "sse2";
#[cfg(target_arch = "aarch64")]
pub const BASELINE: &str = "neon";
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub const BASELINE: &str = "baseline";
