//! Observer of a reference: the largest ratio of each quantity to its limit, evaluated from the motions alone.

use std::collections::BTreeMap;

use hexad::control::constants::Constants;
use hexad::control::parameters::Envelope;
use hexad::control::reference::ReferenceGenerator;
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::kinematic_state::KinematicState;
use hexad::model::rigid::Motion;
use hexad::model::task::task_coordinates;
use nalgebra::Vector3;

/// Instants examined in each cycle.
const INSTANTS: u64 = 4;

/// Largest value of each quantity, as a ratio of its limit; distances beyond a bound in metres or radians.
#[derive(Clone, Debug, Default)]
pub struct Largest(pub BTreeMap<&'static str, f64>);

impl Largest {
    pub fn add(&mut self, name: &'static str, value: f64) {
        let largest = self.0.entry(name).or_insert(f64::NEG_INFINITY);
        // NaN must not pass.
        *largest = if value.is_nan() { f64::INFINITY } else { largest.max(value) };
    }

    pub fn merge(&mut self, other: &Self) {
        other.0.iter().for_each(|(name, value)| self.add(name, *value));
    }
}

/// Examines the last cycle, from `begin_ns` to the end of the reference.
pub fn examine(
    constants: &Constants,
    reference: &ReferenceGenerator,
    before: &Motion,
    [begin_ns, end_ns]: [u64; 2],
    largest: &mut Largest,
) {
    let limits = &constants.parameters.limits;
    let machine = constants.machine();
    let step_s = (end_ns - begin_ns) as f64 / INSTANTS as f64 * 1e-9;
    let mut last = *before;
    for k in 1..=INSTANTS {
        let instant_ns = begin_ns + (end_ns - begin_ns) * k / INSTANTS;
        let now = if k == INSTANTS { *reference.motion() } else { reference.motion_at(instant_ns) };
        for (names, limits, derivatives) in [
            (
                ["velocity", "acceleration", "jerk"],
                limits.position,
                (|it| [it.twist.linear, it.acceleration.linear]) as fn(&Motion) -> [Vector3<f64>; 2],
            ),
            (["angular velocity", "angular acceleration", "angular jerk"], limits.orientation, |it| {
                [it.twist.angular, it.acceleration.angular]
            }),
        ] {
            let ([v, a], [_, before]) = (derivatives(&now), derivatives(&last));
            largest.add(names[0], v.norm() / limits.velocity);
            largest.add(names[1], a.norm() / limits.acceleration);
            largest.add(names[2], (a - before).norm() / (limits.jerk * step_s));
        }
        let moved = last.pose.displacement_to(&now.pose).vector() / step_s;
        let mean = (last.twist.vector() + now.twist.vector()) * 0.5;
        // A stop may change its jerk within a cycle, up to jerk T^2 / 4 of velocity.
        let jerk = limits.orientation.jerk.max(limits.position.jerk);
        let period_s = step_s * INSTANTS as f64;
        largest.add("derivative", (moved - mean).norm() / (jerk * period_s * period_s));
        let legs = leg_motion(machine, &now);
        for (length, rate) in legs.length_m.iter().zip(legs.rate_m_s) {
            largest.add("stroke", constants.parameters.stroke_margin_m - machine.actuator.margin(*length));
            largest.add("leg rate", rate.abs() / machine.actuator.max_rate_m_s);
        }
        if let Some(Envelope { lowest, highest }) = &constants.parameters.envelope {
            let x = task_coordinates(&now.pose, &machine.home);
            for (axis, (x, (low, high))) in x.iter().zip(lowest.iter().zip(highest)).enumerate() {
                let name = if axis < 3 { "envelope angle" } else { "envelope position" };
                largest.add(name, (low - x).max(x - high));
            }
        }
        let kinematic_state = KinematicState::new(machine, now.pose);
        let sensitivity = kinematic_state.sensitivity();
        largest.add("condition", sensitivity.condition / constants.parameters.max_condition);
        let home = constants.home.sensitivity().determinant;
        largest.add("determinant", if sensitivity.determinant * home > 0.0 { 0.0 } else { 1.0 });
        last = now;
    }
}
