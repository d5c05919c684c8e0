//! What hexad offers: fidelities of the ladder, two precisions, the instruction sets of this CPU.

use fearless_simd::Level;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::{
    Exact, Fidelity, Gravity, LumpedLegs, MasslessLegs, Model, NoVelocity, RigidLegs,
};
use hexad::model::machine::LEGS;
use hexad::model::rigid::Motion;

use super::timing::sample;

/// Forces of the six legs, `None` at a singular pose.
pub type Forces = Option<[f64; LEGS]>;

/// Precision of the lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    F64,
    F32,
}

impl Precision {
    pub const ALL: [Self; 2] = [Self::F64, Self::F32];

    pub fn name(self) -> &'static str {
        match self {
            Self::F64 => "f64",
            Self::F32 => "f32",
        }
    }
}

/// One fidelity in one precision.
#[derive(Clone, Copy)]
pub struct Method {
    pub fidelity: Fidelity,
    pub precision: Precision,
    pub forces: fn(&InverseDynamics, &Motion) -> Forces,
    /// Time per evaluation \[ns\] of some passes over the motions, fenced or not. A function of its own for
    /// each method: what is called in the loop is known when it is compiled, as in a controller.
    pub sample: fn(&InverseDynamics, &[Motion], usize, bool) -> f64,
}

impl Method {
    pub fn new(fidelity: Fidelity, precision: Precision) -> Self {
        match fidelity {
            Fidelity::Gravity => Self::of::<Gravity>(fidelity, precision),
            Fidelity::MasslessLegs => Self::of::<MasslessLegs>(fidelity, precision),
            Fidelity::LumpedLegs => Self::of::<LumpedLegs>(fidelity, precision),
            Fidelity::NoVelocity => Self::of::<NoVelocity>(fidelity, precision),
            Fidelity::RigidLegs => Self::of::<RigidLegs>(fidelity, precision),
            Fidelity::Exact => Self::of::<Exact>(fidelity, precision),
        }
    }

    fn of<M: Model>(fidelity: Fidelity, precision: Precision) -> Self {
        match precision {
            Precision::F64 => Self {
                fidelity,
                precision,
                forces: |dynamics, motion| dynamics.forces::<M>(motion),
                sample: |dynamics, motions, passes, fenced| {
                    sample(motions, passes, fenced, |motion| dynamics.forces::<M>(motion))
                },
            },
            Precision::F32 => Self {
                fidelity,
                precision,
                forces: |dynamics, motion| dynamics.forces_f32::<M>(motion),
                sample: |dynamics, motions, passes, fenced| {
                    sample(motions, passes, fenced, |motion| dynamics.forces_f32::<M>(motion))
                },
            },
        }
    }
}

/// Instruction sets of this CPU that are used for a precision, the best first. Single precision has no use
/// for AVX-512.
pub fn instruction_sets(precision: Precision) -> Vec<(&'static str, Level)> {
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let sets = [
        ("avx512", best.as_avx512().filter(|_| precision == Precision::F64).map(Level::Avx512)),
        ("avx2", best.as_avx2().map(Level::Avx2)),
        ("sse2", best.as_sse2().map(Level::Sse2)),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let sets = [(BASELINE, Some(best).filter(|_| Precision::ALL.contains(&precision)))];
    sets.into_iter().filter_map(|(name, level)| Some((name, level?))).collect()
}

/// What code is compiled for that chooses nothing at run time.
#[cfg(target_arch = "x86_64")]
pub const BASELINE: &str = "sse2";
#[cfg(target_arch = "aarch64")]
pub const BASELINE: &str = "neon";
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub const BASELINE: &str = "baseline";
