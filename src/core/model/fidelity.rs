//! Model fidelity: terms of the dynamics that are evaluated, chosen at compile time.
//!
//! All fidelities share one code path; an omitted term costs nothing. Every fidelity above gravity includes
//! the drives (reflected mass, friction), which belong to the actuator and not to a link. `tests/ladder.rs`
//! computes the omitted terms of each fidelity independently and compares them with the difference.
//!
//! | fidelity | leaves out | allowed when |
//! | --- | --- | --- |
//! | [`Gravity`] | every acceleration and velocity, drives included | the platform only holds or creeps |
//! | [`MasslessLegs`] | mass and inertia of the legs | the platform outweighs the legs |
//! | [`LumpedLegs`] | inertia of the legs, except points at A and B with their mass and centre of mass | legs turn little |
//! | [`NoVelocity`] | centrifugal and Coriolis forces; spin of the legs and its inertia; friction stays | slow motion at any acceleration |
//! | [`RigidLegs`] | spin of the legs about their own axes, as in the paper | thin legs, or joints across the legs |
//! | [`Exact`] | nothing | always |

/// Representation of the leg mass in the dynamics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LegInertia {
    /// Legs without mass.
    Massless,
    /// Point masses at B and A; A does not move.
    Lumped,
    /// Two rigid links per leg.
    Links,
}

/// Terms of the dynamics that a fidelity evaluates, as constants for the compiler.
pub trait ModelTerms {
    /// Representation of mass and inertia of the legs.
    const LEGS: LegInertia;
    /// Whether accelerations are included, and with them the drives.
    const ACCELERATION: bool;
    /// Whether centrifugal and Coriolis forces are included.
    const VELOCITY: bool;
    /// Whether the spin of the legs about their own axes is included.
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
    /// Each leg as a point mass at B and one at A, the first part of the platform. Together they have the
    /// mass and the centre of mass of a leg of the mean length at home.
    LumpedLegs, Lumped, true, true, false
);
fidelity!(
    /// All masses, but no forces that grow with velocity except friction. Legs do not spin, not even at rest.
    NoVelocity, Links, true, false, false
);
fidelity!(
    /// The paper's model: rigid legs without spin.
    RigidLegs, Links, true, true, false
);
fidelity!(
    /// All terms.
    Exact, Links, true, true, true
);

/// Evaluates an expression with the terms of a fidelity that is chosen at run time.
macro_rules! with_terms {
    ($fidelity:expr, $terms:ident => $value:expr) => {
        $crate::model::fidelity::with_terms!(
            $fidelity, $terms => $value, Gravity MasslessLegs LumpedLegs NoVelocity RigidLegs Exact
        )
    };
    ($fidelity:expr, $terms:ident => $value:expr, $($name:ident)*) => {
        match $fidelity {
            $($crate::model::fidelity::Fidelity::$name => {
                type $terms = $crate::model::fidelity::$name;
                $value
            })*
        }
    };
}
pub(super) use with_terms;

crate::named! {
    /// Model fidelity chosen at run time, from gravity only to all terms.
    ///
    /// ```
    /// use hexad_core::model::{active_forces::InverseDynamics, fidelity::Fidelity, task::TaskState};
    /// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
    /// // Without acceleration and velocity the exact model is no more than gravity.
    /// let (model, rest) = (InverseDynamics::new(&machine), TaskState::at_rest(machine.home).motion());
    /// let [gravity, exact] = [Fidelity::Gravity, Fidelity::Exact].map(|fidelity| model.forces_of(fidelity, &rest).unwrap());
    /// assert!(gravity.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-9 * b.abs()));
    /// ```
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Fidelity {
        /// [`struct@Gravity`]
        Gravity => "gravity",
        /// [`struct@MasslessLegs`]
        MasslessLegs => "massless-legs",
        /// [`struct@LumpedLegs`]
        LumpedLegs => "lumped-legs",
        /// [`struct@NoVelocity`]
        NoVelocity => "no-velocity",
        /// [`struct@RigidLegs`]
        RigidLegs => "rigid-legs",
        /// [`struct@Exact`]
        Exact => "exact",
    }
}

impl Fidelity {
    /// Short description of the omitted terms.
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

    /// Whether accelerations cause forces. A control law commands an acceleration, so its fidelity must have
    /// inertia.
    pub fn has_inertia(self) -> bool {
        self != Self::Gravity
    }
}
