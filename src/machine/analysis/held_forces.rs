//! Pole of the platform under constant forces: how fast it leaves a pose at which they balance.
//!
//! The drives hold a force for a period, and the measurement behind it is older still. Meanwhile the legs turn, and
//! their forces turn with them. With W the wrench of legs and loads at rest, and f the forces that balance at a pose,
//!
//! ```text
//! W(X, f) = N(X) f - load(X)      W(X0, f) = 0      A = M^-1 dW/dX at X0      pole = max Re sqrt(eigenvalues of A)
//! ```
//!
//! A displacement grows as `exp(pole t)` until a force computed from it acts. A platform on legs is an inverted
//! pendulum, so the pole is rarely 0; near singular poses the forces are large, and so is the pole. The loop is stable
//! while the delay is short against `1 / pole`: see [`sampled_loop`](super::sampled_loop).
//!
//! dW/dX is computed by central differences with steps of `STEP`, to about 1e-8 of the largest element. Valid at
//! regular poses. Forces that accelerate the platform are not included, because they do not last.

use nalgebra::{Matrix6, Schur, Vector6};

use super::envelope::MotionEnvelope;
use hexad_core::control::signals::limits::Limits;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Exact;
use hexad_core::model::inverse_jacobian::leg_wrenches;
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::mass_matrix::MassMatrix;
use hexad_core::model::rigid::{Acceleration, Motion, Pose, Twist};
use hexad_core::model::sensitivity::Sensitivity;

/// Step of the differences \[rad\], and of the radius of the joints.
const STEP: f64 = 1e-5;
/// Directions from home along which poses are surveyed.
const DIRECTIONS: u32 = 128;
/// Steps along a direction, the last and shortest of them, and the longest way \[rad\], \[radius of the joints\].
const SURVEY_STEP: f64 = 0.04;
const SHORTEST_STEP: f64 = 2e-4;
const LONGEST_WAY: f64 = 4.0;
/// Growth of the condition after which the pole is computed again.
const CONDITION_GROWTH: f64 = 1.4;
/// Bound on the iterations for six eigenvalues; twenty are usual.
const MAX_ITERATIONS: usize = 1000;

/// Balance of forces around poses of a machine at rest.
#[derive(Clone, Debug)]
pub struct HeldForces {
    model: InverseDynamics,
    mass: MassMatrix,
}

/// Pole at a pose.
#[derive(Clone, Copy, Debug)]
pub struct SurveyedPose {
    /// The pose.
    pub pose: Pose,
    /// Condition of the pose.
    pub condition: f64,
    /// Pole under held forces \[1/s\].
    pub pole_per_s: f64,
}

impl HeldForces {
    /// Derives the constants.
    pub fn new(machine: &Machine) -> Self {
        Self { model: InverseDynamics::new(machine), mass: MassMatrix::new(machine) }
    }

    /// The pole \[1/s\]; `None` at a singular pose.
    ///
    /// ```
    /// use hexad_machine::analysis::held_forces::HeldForces;
    /// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
    /// let pole = HeldForces::new(&machine).pole(&machine.home_pose()).unwrap();
    /// // Faster than a pendulum as long as the legs are.
    /// assert!(pole > 2.0 && pole < 20.0);
    /// ```
    pub fn pole(&self, pose: &Pose) -> Option<f64> {
        let growth = self.growth(pose)?;
        let eigenvalues = Schur::try_new(growth, f64::EPSILON, MAX_ITERATIONS)?.complex_eigenvalues();
        Some(eigenvalues.iter().map(|eigenvalue| real_root(eigenvalue.re, eigenvalue.im)).fold(0.0, f64::max))
    }

    /// Bounds of the angular \[rad/s^3\] and linear \[m/s^3\] jerk of the platform while forces are held: `|A v|` for velocities v within
    /// the limits and within the largest rates of the legs, the lesser of both bounds; `None` at a singular pose.
    pub fn angular_and_linear_jerk_bounds(&self, pose: &Pose, limits: &Limits) -> Option<[f64; 2]> {
        let (machine, growth) = (self.model.machine(), self.growth(pose)?);
        let by_rates = growth * leg_wrenches(machine, pose).transpose().try_inverse()?;
        Some([0, 3].map(|row| {
            let block = |column| growth.fixed_view::<3, 3>(row, column).into_owned().singular_values().max();
            let by_limits = block(0) * limits.orientation.velocity + block(3) * limits.position.velocity;
            // The largest norm is in a corner of the rates.
            let corners = (0..1_u32 << LEGS).map(|signs| {
                let sign = |leg: usize| if signs >> leg & 1 == 1 { 1.0 } else { -1.0 };
                let jerk = by_rates * Vector6::from_fn(|leg, _| sign(leg) * machine.actuator.max_rate_m_s);
                jerk.fixed_rows::<3>(row).norm()
            });
            by_limits.min(corners.fold(0.0, f64::max))
        }))
    }

    /// A \[1/s^2\]; `None` at a singular pose.
    fn growth(&self, pose: &Pose) -> Option<Matrix6<f64>> {
        let forces = leg_wrenches(self.model.machine(), pose).lu().solve(&self.load(pose))?;
        let unbalanced = |pose: &Pose| leg_wrenches(self.model.machine(), pose) * forces - self.load(pose);
        let radius = self.model.machine().joints.radius_m;
        let mut stiffness = Matrix6::zeros();
        for (axis, mut column) in stiffness.column_iter_mut().enumerate() {
            let step = if axis < 3 { STEP } else { STEP * radius };
            let displaced = |step| pose.displaced(&Twist::from_vector(&Vector6::ith(axis, step)));
            column
                .copy_from(&((unbalanced(&displaced(step)) - unbalanced(&displaced(-step))) / (2.0 * step)));
        }
        let growth = self.mass.at(pose).cholesky()?.solve(&stiffness);
        growth.iter().all(|x| x.is_finite()).then_some(growth)
    }

    /// What holds the platform at rest \[N m\], \[N\].
    fn load(&self, pose: &Pose) -> Vector6<f64> {
        let rest = Motion { pose: *pose, twist: Twist::default(), acceleration: Acceleration::default() };
        self.model.load_of::<Exact>(&rest).total()
    }

    /// Poles at home and on the ways from there, in directions spread evenly, to the ends of the stroke, to a singular pose or to a
    /// condition. The largest of them is no bound: poses between the ways are not surveyed.
    pub fn survey(&self, largest_condition: f64) -> Vec<SurveyedPose> {
        let machine = self.model.machine();
        let home = machine.home_pose();
        let side = KinematicState::new(machine, home).sensitivity().determinant;
        let is_within = |pose: &Pose| {
            let state = KinematicState::new(machine, *pose);
            let Sensitivity { condition, determinant, .. } = *state.sensitivity();
            let in_stroke = state.lengths(machine).iter().all(|length| machine.actuator.contains(*length));
            in_stroke && condition <= largest_condition && determinant * side > 0.0
        };
        let mut found = Vec::new();
        self.record(&home, 0.0, &mut found);
        for direction in (0..DIRECTIONS).map(direction) {
            let at = |way: f64| {
                let mut displacement = direction * way;
                displacement.fixed_rows_mut::<3>(3).scale_mut(machine.joints.radius_m);
                home.displaced(&Twist::from_vector(&displacement))
            };
            let (mut way, mut step, mut recorded) = (0.0, SURVEY_STEP, 0.0);
            while way < LONGEST_WAY && step > SHORTEST_STEP {
                let pose = at(way + step);
                if is_within(&pose) {
                    way += step;
                    recorded =
                        self.record(&pose, CONDITION_GROWTH * recorded, &mut found).unwrap_or(recorded);
                } else {
                    step *= 0.5;
                }
            }
            self.record(&at(way), 0.0, &mut found);
        }
        found
    }

    /// Records the pole of a pose whose condition is beyond a least one; that condition.
    fn record(&self, pose: &Pose, least_condition: f64, found: &mut Vec<SurveyedPose>) -> Option<f64> {
        let condition = KinematicState::new(self.model.machine(), *pose).sensitivity().condition;
        if condition <= least_condition {
            return None;
        }
        found.push(SurveyedPose { pose: *pose, condition, pole_per_s: self.pole(pose)? });
        Some(condition)
    }
}

/// Real part of the root of `re + i im` that is not negative.
fn real_root(re: f64, im: f64) -> f64 {
    let size = libm::hypot(re, im);
    // The sum would cancel where the number is nearly real and negative.
    if re >= 0.0 { (0.5 * (size + re)).sqrt() } else { im.abs() / (2.0 * (size - re)).sqrt() }
}

/// Evenly spread displacement, of which the largest coordinate is 1.
fn direction(k: u32) -> Vector6<f64> {
    let point = MotionEnvelope::spread(k + 1).fixed_rows::<6>(0).map(|share| 2.0 * share - 1.0);
    point / point.amax()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    #[test]
    fn the_real_part_of_a_root_loses_no_digits() {
        for (re, im) in [(4.0, 0.0), (-4.0, 0.0), (0.0, 0.0), (3.0, -4.0), (-3.0, 4.0), (-0.5, 1.5)] {
            let expected = Complex::new(re, im).sqrt().re;
            assert!((real_root(re, im) - expected).abs() <= 1e-15, "{re} {im}");
        }
        // Next to the negative axis: im / 2.
        assert!((real_root(-1.0, 1e-9) / 5e-10 - 1.0).abs() < 1e-15);
    }
}
