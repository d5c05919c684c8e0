//! Model fidelity: which terms of the dynamics are evaluated, known at compile time.
//!
//! All fidelities share one code path; a term that a fidelity leaves out costs nothing. Every fidelity above gravity
//! keeps the drives (reflected mass, friction), which belong to the actuator and not to a link.
//! `tests/ladder.rs` computes the terms that each leaves out independently and compares them with the difference.
//!
//! | fidelity | leaves out | allowed when |
//! | --- | --- | --- |
//! | [`Gravity`] | every acceleration and velocity, drives included | the platform only holds or creeps |
//! | [`MasslessLegs`] | mass and inertia of the legs | the platform outweighs the legs |
//! | [`LumpedLegs`] | inertia of the legs but for points at A and B that have their mass and centre | legs turn little |
//! | [`NoVelocity`] | centrifugal and Coriolis forces; the spin of the legs, its inertia included; friction stays | slow motion, whatever the acceleration |
//! | [`RigidLegs`] | spin of the legs about their own axes: the paper's model | thin legs, or joints across the legs |
//! | [`Exact`] | nothing | always |

/// How the mass of the legs enters the dynamics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LegInertia {
    /// Not at all.
    Massless,
    /// As a point mass at B.
    Lumped,
    /// As two links.
    Links,
}

/// Terms of the dynamics that a fidelity evaluates, as constants for the compiler.
pub trait ModelTerms {
    /// Mass and inertia of the legs.
    const LEGS: LegInertia;
    /// Accelerations, and with them the drives.
    const ACCELERATION: bool;
    /// Centrifugal and Coriolis forces.
    const VELOCITY: bool;
    /// Spin of the legs about their own axes.
    const SPIN: bool;
}

macro_rules! fidelity {
    ($(#[$doc:meta])* $name:ident, $legs:ident, $acceleration:literal, $velocity:literal, $spin:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub struct $name;

        impl ModelTerms for $name {
            const LEGS: LegInertia = LegInertia::$legs;
            const ACCELERATION: bool = $acceleration;
            const VELOCITY: bool = $velocity;
            const SPIN: bool = $spin;
        }
    };
}

fidelity!(
    /// Weight of platform and legs only.
    Gravity, Links, false, false, false
);
fidelity!(
    /// Rigid platform on legs without mass.
    MasslessLegs, Massless, true, true, false
);
fidelity!(
    /// Each leg as a point mass at B and one at A, the first part of the platform. They have the mass and
    /// the centre of mass of a leg of the mean length at home.
    LumpedLegs, Lumped, true, true, false
);
fidelity!(
    /// All masses, no forces that grow with velocity but friction. The legs do not spin, also at rest.
    NoVelocity, Links, true, false, false
);
fidelity!(
    /// The paper's model: rigid legs that do not spin.
    RigidLegs, Links, true, true, false
);
fidelity!(
    /// Every term.
    Exact, Links, true, true, true
);

/// Model fidelity chosen at run time, from gravity only to all terms.
///
/// ```
/// use hexad::model::{active_forces::InverseDynamics, fidelity::Fidelity, task::TaskState};
/// # let machine = hexad::config::Config::load("config/tsai2000.toml".as_ref()).unwrap().machine;
/// // Without acceleration and velocity the exact model is no more than gravity.
/// let (model, rest) = (InverseDynamics::new(&machine), TaskState::at_rest(machine.home).motion());
/// let [gravity, exact] = [Fidelity::Gravity, Fidelity::Exact].map(|fidelity| model.forces_of(fidelity, &rest).unwrap());
/// assert!(gravity.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-9 * b.abs()));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fidelity {
    /// [`struct@Gravity`]
    Gravity,
    /// [`struct@MasslessLegs`]
    MasslessLegs,
    /// [`struct@LumpedLegs`]
    LumpedLegs,
    /// [`struct@NoVelocity`]
    NoVelocity,
    /// [`struct@RigidLegs`]
    RigidLegs,
    /// [`struct@Exact`]
    Exact,
}

impl Fidelity {
    /// From the cheapest to the exact one.
    pub const ALL: [Self; 6] =
        [Self::Gravity, Self::MasslessLegs, Self::LumpedLegs, Self::NoVelocity, Self::RigidLegs, Self::Exact];

    /// Name on the command line and in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gravity => "gravity",
            Self::MasslessLegs => "massless-legs",
            Self::LumpedLegs => "lumped-legs",
            Self::NoVelocity => "no-velocity",
            Self::RigidLegs => "rigid-legs",
            Self::Exact => "exact",
        }
    }

    /// The terms that it leaves out, in a few words.
    pub fn left_out_terms(self) -> &'static str {
        match self {
            Self::Gravity => "motion and drives",
            Self::MasslessLegs => "mass of the legs",
            Self::LumpedLegs => "extent of the legs",
            Self::NoVelocity => "velocity terms and spin",
            Self::RigidLegs => "spin of the legs",
            Self::Exact => "nothing",
        }
    }

    /// Whether accelerations make forces. A control law commands an acceleration, so it needs a fidelity that has.
    pub fn has_inertia(self) -> bool {
        self != Self::Gravity
    }
}
