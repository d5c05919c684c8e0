//! Balls of poses that are proved regular: no pose is singular, no condition exceeds the limit, and no leg
//! comes near the first axis of its universal joint. In line with this axis the joint loses a degree of
//! freedom, and the leg's spin is unbounded.
//!
//! At the centre of a ball, N holds the wrenches of the legs, with torques about the mean of the joints and
//! divided by the radius r. `F = |N|` and `B = |N^-1|` are Frobenius norms, L is the length of the shortest
//! leg. The joints have the arms `a` from C and `a'` from their mean. A pose of the ball is displaced by at
//! most d and turned by at most t:
//!
//! ```text
//! s = d + a t                           displacement of a joint
//! q = s / sqrt(L (L - s))               change of a leg's direction
//! |N - N0| <= D = sqrt(6 q^2 + 6 (t + q)^2)                      as the mean of (a'/r)^2 is 1
//! condition <= min(F + D, sqrt 12) B / (1 - B D)                 where B D < 1
//! sine of the angle between a leg and that axis >= sine at the centre - q
//! ```
//!
//! The search for the workspace bounds its cells in the same way.

use crate::control::constants::Constants;
use crate::control::reference::proof::drive_forces::BallLoads;
use crate::control::reference::proof::refusal::Refusal;
use crate::control::signals::pair::Pair;
use crate::model::conditioning::Conditioning;
use crate::model::rigid::Pose;
use crate::model::sensitivity::Sensitivity;

/// Effort for the regularity of a pose, in knots of an [examination](super::examination), and the additional
/// effort if its factorization has pivots.
pub(in crate::control::reference) const REGULARITY_EFFORT: u32 = 1;
const PIVOTING_EFFORT: u32 = 2;

/// Least sine between knots as a ratio of the reference's least sine, whatever the limits of the condition.
const LEAST_SINE_SHARE: f64 = 0.5;

/// Regularity of a pose, or bounds on it.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct Regularity {
    /// Condition; as a bound, the largest.
    pub condition: f64,
    /// Sine of the angle between a leg and the first axis of its universal joint; as a bound, the least.
    pub universal_sine: f64,
}

impl Regularity {
    /// Regularity of a pose. It is refused if the effort does not suffice.
    pub fn at(constants: &Constants, pose: &Pose, effort: &mut u32) -> Result<Self, Refusal> {
        CenterConditioning::new(constants, pose, effort).map(|ball| ball.regularity)
    }

    /// Bounds that the reference must keep.
    pub fn reference_bounds(constants: &Constants) -> Self {
        Self { condition: constants.max_reference_condition, universal_sine: constants.least_universal_sine }
    }

    /// Bounds that poses between knots must keep: the platform's limit of the condition, and a sine that is
    /// smaller in the same ratio.
    pub fn between_knots_bounds(constants: &Constants) -> Self {
        let condition = constants.parameters.max_condition;
        let share = (constants.max_reference_condition / condition).clamp(LEAST_SINE_SHARE, 1.0);
        Self { condition, universal_sine: constants.least_universal_sine * share }
    }

    /// The looser of both bounds, for each quantity.
    pub fn looser_of(&self, other: &Self) -> Self {
        Self {
            condition: self.condition.max(other.condition),
            universal_sine: self.universal_sine.min(other.universal_sine),
        }
    }

    /// Whether another regularity keeps both bounds.
    pub fn is_kept_by(&self, other: &Self) -> bool {
        other.condition <= self.condition && other.universal_sine >= self.universal_sine
    }
}
/// Ball without its centre.
pub(super) struct CenterConditioning {
    pub norm: f64,
    pub inverse_norm: f64,
    pub shortest_m: f64,
    /// Regularity of the centre.
    pub regularity: Regularity,
    pub loads: BallLoads,
}

impl CenterConditioning {
    /// Ball around a pose, refused if the effort does not suffice. Only the factorization shows whether
    /// pivots are needed: their effort is subtracted afterwards.
    pub fn new(constants: &Constants, center: &Pose, effort: &mut u32) -> Result<Self, Refusal> {
        *effort = effort.checked_sub(REGULARITY_EFFORT).ok_or(Refusal::Effort)?;
        let Conditioning { sensitivity, largest_row_norm, shortest_leg_m, universal_sine, is_pivoted } =
            Conditioning::new(constants.machine(), center);
        if is_pivoted {
            *effort = effort.saturating_sub(PIVOTING_EFFORT);
        }
        let Sensitivity { condition, norm, .. } = sensitivity;
        let regularity = Regularity { condition, universal_sine };
        let inverse_norm = condition / norm;
        let loads = BallLoads::new(center, inverse_norm, largest_row_norm);
        Ok(Self { norm, inverse_norm, shortest_m: shortest_leg_m, regularity, loads })
    }
}
/// Distances around a pose: shift \[m\] and turn \[rad\].
pub(in crate::control::reference) type Reach = Pair<f64>;

/// Poses around one pose, and the regularity that is required of them.
#[derive(Clone, Copy, Debug)]
pub(in crate::control::reference) struct RegularityQuery<'a> {
    pub pose: &'a Pose,
    pub reach: Reach,
    pub required: Regularity,
}
