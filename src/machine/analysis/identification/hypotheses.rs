//! What the model may lack, as changes of the forces of the legs, by differences at the middle of each group of samples.
//!
//! A machine with other joints, or with other sensors of the lengths, stands elsewhere when it has the measured lengths. So an error of
//! a joint or of a length displaces the measured motion by `dX = N^-T dL`, with its derivatives; forces follow by the inverse dynamics of
//! the other machine in the displaced motion.

use nalgebra::{Matrix6, Rotation3, Vector3, Vector6};

use super::equations::BODY_PARAMETER_COUNT;
use super::samples::MotionSample;
use hexad_core::model::LEGS;
use hexad_core::model::inverse_geometry::{leg_directions, leg_motion};
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::{Joints, Machine};
use hexad_core::model::regressor::{DynamicParameters, Regressor, regressor};
use hexad_core::model::rigid::{Acceleration, Motion, Twist};
use serde::Serialize;

/// What a model may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Gravity has another direction, in base axes.
    Gravity,
    /// Joints are elsewhere.
    Joints,
    /// A sensor of a length has another zero or scale.
    LengthSensor,
    /// Base or legs yield under the forces.
    Elasticity,
    /// Legs have more friction near standstill.
    Stiction,
    /// The measured length depends on the direction of motion.
    Play,
    /// A body moves on the platform.
    LoosePayload,
    /// Friction changes with time.
    Drift,
    /// Delays of the drives differ from each other.
    Delays,
    /// Forces of this leg, from 1, depend on its length, direction, speed or on time.
    Leg(usize),
    /// Residuals that follow each other are alike.
    Correlation,
}

/// Size of each change: of lengths over the radius of the platform, the angle of gravity \[rad\], of forces over the largest, of a delay.
const LENGTH_RATIO: f64 = 1e-3;
const GRAVITY_RAD: f64 = 1e-2;
const FORCE_RATIO: f64 = 1e-2;
const DELAY_S: f64 = 1e-4;
/// Samples from the middle of a group to those by which displacements are differentiated.
const REACH: usize = 4;
/// Speed at which most of the stiction is gone \[m/s\], and slopes from which a loose body slides to its other stop.
const STRIBECK_M_S: f64 = 0.01;
const SLIDING_SLOPES: [f64; 2] = [0.02, 0.1];

/// One machine with other joints: the error of a leg's length that they mean is along `axis`, in axes of the base or the platform.
struct OtherJoint {
    machine: Machine,
    leg: usize,
    axis: Vector3<f64>,
    is_base: bool,
}

/// A column: cause and change of the forces \[N\].
pub(super) type Column = (Cause, Vector6<f64>);

/// For each sample the stops at which a loose body is, along x and y of the platform, for each of [`SLIDING_SLOPES`]: -1 or 1, 0 before
/// it slides.
pub(super) fn stops(machine: &Machine, samples: &[MotionSample]) -> Vec<[[f64; 2]; 2]> {
    let mut stops = [[0.0; 2]; 2];
    let after = |sample: &MotionSample| {
        for (stops, least) in stops.iter_mut().zip(SLIDING_SLOPES) {
            for (stop, slope) in stops.iter_mut().zip(slopes(machine, &sample.motion)) {
                *stop = if slope.abs() > least { slope.signum() } else { *stop };
            }
        }
        stops
    };
    samples.iter().map(after).collect()
}

/// Slopes of the platform against what a body on it feels as gravity, along its x and y.
fn slopes(machine: &Machine, motion: &Motion) -> [f64; 2] {
    let proper = motion.pose.rotation.transpose() * (motion.acceleration.linear - machine.gravity_m_s2);
    [proper.x, proper.y].map(|along| along / proper.z.abs())
}

/// Machines that differ from an identified one.
pub(super) struct Hypotheses<'a> {
    machine: &'a Machine,
    tilted: [Machine; 2],
    joints: Vec<OtherJoint>,
}

/// An instant of the measured motion.
struct Instant {
    motion: Motion,
    per_length: Matrix6<f64>,
    directions: [Vector3<f64>; LEGS],
    length: Vector6<f64>,
    rate: Vector6<f64>,
    command: Vector6<f64>,
}

impl Instant {
    fn new(machine: &Machine, sample: &MotionSample) -> Option<Self> {
        let state = KinematicState::new(machine, sample.motion.pose);
        let mut per_length = Matrix6::zeros();
        for (leg, mut column) in per_length.column_iter_mut().enumerate() {
            column.copy_from(&state.twist(machine, &unit(leg).into())?.vector());
        }
        let legs = leg_motion(machine, &sample.motion);
        Some(Self {
            motion: sample.motion,
            per_length,
            directions: leg_directions(machine, &sample.motion.pose),
            length: legs.length_m.into(),
            rate: legs.rate_m_s.into(),
            command: sample.command_n.into(),
        })
    }
}

fn unit(leg: usize) -> Vector6<f64> {
    Vector6::from_fn(|row, _| if row == leg { 1.0 } else { 0.0 })
}

/// The motion with these errors of the lengths.
fn displaced(instants: &[Instant; 3], step_s: f64, errors: &dyn Fn(&Instant) -> Vector6<f64>) -> Motion {
    let [before, now, after] = instants.each_ref().map(|instant| instant.per_length * errors(instant));
    let [_, Instant { motion, .. }, _] = instants;
    let (rate, accel) = ((after - before) / (2.0 * step_s), (after - now * 2.0 + before) / (step_s * step_s));
    let (turn, turn_rate) = (Twist::from_vector(&now).angular, Twist::from_vector(&rate).angular);
    let (mut twist, mut acceleration) = (motion.twist.vector() + rate, motion.acceleration.vector() + accel);
    let mut angular = twist.fixed_rows_mut::<3>(0);
    angular += turn.cross(&motion.twist.angular);
    let mut angular = acceleration.fixed_rows_mut::<3>(0);
    angular += turn_rate.cross(&motion.twist.angular) + turn.cross(&motion.acceleration.angular);
    Motion {
        pose: motion.pose.displaced(&Twist::from_vector(&now)),
        twist: Twist::from_vector(&twist),
        acceleration: Acceleration::from_vector(&acceleration),
    }
}

impl<'a> Hypotheses<'a> {
    pub fn new(machine: &'a Machine) -> Self {
        let tilted = [Vector3::x(), Vector3::y()].map(|axis| Machine {
            gravity_m_s2: Rotation3::new(axis * GRAVITY_RAD) * machine.gravity_m_s2,
            ..machine.clone()
        });
        let old = &machine.joints;
        let [base, platform, axes] =
            [&old.base, &old.platform, &old.universal_axis].map(|lanes| old.triples.unpack_vectors(lanes));
        let step = LENGTH_RATIO * old.radius_m;
        let places = (0..LEGS)
            .flat_map(|leg| (0..3).flat_map(move |axis| [true, false].map(|is_base| (leg, axis, is_base))));
        let joint = |(leg, axis, is_base): (usize, usize, bool)| {
            let axis = Vector3::from_fn(|row, _| if row == axis { step } else { 0.0 });
            let (mut base, mut platform) = (base, platform);
            if let Some(place) = if is_base { &mut base } else { &mut platform }.get_mut(leg) {
                *place += axis;
            }
            let joints = Joints::new(&base, &platform, &axes, &machine.home_pose());
            OtherJoint { machine: Machine { joints, ..machine.clone() }, leg, axis, is_base }
        };
        Self { machine, tilted, joints: places.map(joint).collect() }
    }

    /// Columns at the middle of a group of samples. `parameters` contain the load; `time` is from -1 to 1; `stops`: see
    /// [`stops`].
    pub fn columns(
        &self,
        group: &[MotionSample],
        parameters: &DynamicParameters,
        (time, stops): (f64, &[[f64; 2]; 2]),
    ) -> Option<Vec<Column>> {
        let machine = self.machine;
        let middle = group.len() / 2;
        let samples = [group.get(middle - REACH)?, group.get(middle)?, group.get(middle + REACH)?];
        let [Some(before), Some(now), Some(after)] = samples.map(|sample| Instant::new(machine, sample))
        else {
            return None;
        };
        let instants = [before, now, after];
        let step_s = 0.5 * (samples[2].time_s - samples[0].time_s);
        let [_, now, _] = &instants;
        let y = regressor(machine, &now.motion)?;
        let forces = y * parameters;
        let change =
            |machine: &Machine, motion: &Motion| Some(regressor(machine, motion)? * parameters - forces);
        let length = LENGTH_RATIO * machine.joints.radius_m;
        let by_length = |errors: &dyn Fn(&Instant) -> Vector6<f64>| {
            change(machine, &displaced(&instants, step_s, errors))
        };
        let sign = now.rate.map(f64::signum);
        let mut columns = vec![];

        let [Some(x), Some(y_tilt)] = self.tilted.each_ref().map(|machine| change(machine, &now.motion))
        else {
            return None;
        };
        columns.extend([(Cause::Gravity, x), (Cause::Gravity, y_tilt)]);
        for OtherJoint { machine, leg, axis, is_base } in &self.joints {
            let errors = |instant: &Instant| {
                let direction = instant.directions.get(*leg).copied().unwrap_or_default();
                let along = if *is_base {
                    direction.dot(axis)
                } else {
                    -direction.dot(&(instant.motion.pose.rotation * axis))
                };
                unit(*leg) * along
            };
            columns.push((Cause::Joints, change(machine, &displaced(&instants, step_s, &errors))?));
        }
        for leg in 0..LEGS {
            let unit = unit(leg);
            let scaled = |instant: &Instant| unit * (LENGTH_RATIO * instant.length.dot(&unit));
            columns.push((Cause::LengthSensor, by_length(&|_| unit * length)?));
            columns.push((Cause::LengthSensor, by_length(&scaled)?));
            columns.push((Cause::Play, by_length(&|_| unit * (length * sign.dot(&unit)))?));
        }
        // The base tilts with the moment of the legs' forces about its origin.
        let base = machine.joints.triples.unpack_vectors(&machine.joints.base);
        let legs = base.iter().zip(&now.directions).zip(&forces);
        let moment: Vector3<f64> =
            legs.map(|((place, direction), force)| place.cross(direction) * *force).sum();
        let moment = moment / (machine.actuator.max_force_n * machine.joints.radius_m);
        let pressed = now.command / machine.actuator.max_force_n;
        columns.extend([(Cause::Elasticity, x * moment.x), (Cause::Elasticity, y_tilt * moment.y)]);
        columns.push((Cause::Elasticity, by_length(&|_| pressed * length)?));
        columns.extend(loose_columns(machine, &now.motion, &y, (time, stops)));
        columns.extend(leg_columns(machine, &instants, step_s, time));
        Some(columns)
    }
}

/// Columns of a body that slides to the lower side and stays there, or moves in proportion, or slowly.
fn loose_columns(
    machine: &Machine,
    motion: &Motion,
    y: &Regressor,
    (time, stops): (f64, &[[f64; 2]; 2]),
) -> impl Iterator<Item = Column> {
    let moment = LENGTH_RATIO * machine.joints.radius_m * machine.platform.mass_kg;
    let [[x_stop, y_stop], [x_far, y_far]] = *stops;
    let [x_slope, y_slope] = slopes(machine, motion).map(|slope| 10.0 * slope);
    let places = [[x_stop, x_far, x_slope, time], [y_stop, y_far, y_slope, time]];
    let [_, x, y, ..]: [Vector6<f64>; BODY_PARAMETER_COUNT] =
        core::array::from_fn(|column| y.column(column).into_owned());
    let of_axis = move |(column, places): (Vector6<f64>, [f64; 4])| {
        places.map(|place| (Cause::LoosePayload, column * (moment * place)))
    };
    [x, y].into_iter().zip(places).flat_map(of_axis)
}

/// Columns of forces that depend on one leg alone.
fn leg_columns(
    machine: &Machine,
    [before, now, after]: &[Instant; 3],
    step_s: f64,
    time: f64,
) -> Vec<Column> {
    let [shortest, longest] = [machine.actuator.min_length_m, machine.actuator.max_length_m];
    let delayed = (after.command - before.command) * (DELAY_S / (2.0 * step_s));
    let of_leg = |leg: usize| {
        let unit = unit(leg);
        let force = unit * (FORCE_RATIO * machine.actuator.max_force_n);
        let place = (2.0 * now.length.dot(&unit) - shortest - longest) / (longest - shortest);
        let (rate, sign) = (now.rate.dot(&unit), now.rate.dot(&unit).signum());
        let speed = rate.abs() / machine.actuator.max_rate_m_s;
        let own = [place, place * place, place * sign, speed, speed * speed * sign, time];
        let near_standstill = sign * (-rate.abs() / STRIBECK_M_S).exp();
        let others = [
            (Cause::Stiction, force * near_standstill),
            (Cause::Drift, force * (sign * time)),
            (Cause::Delays, unit.component_mul(&delayed)),
        ];
        own.map(|value| (Cause::Leg(leg + 1), force * value)).into_iter().chain(others)
    };
    (0..LEGS).flat_map(of_leg).collect()
}

/// Change of the residuals by a delay 1 s longer than the samples were made with \[N\].
pub(super) fn delay_column(group: &[MotionSample]) -> Option<Vector6<f64>> {
    let middle = group.len() / 2;
    let (before, after) = (group.get(middle - REACH)?, group.get(middle + REACH)?);
    let change = Vector6::from(before.command_n) - Vector6::from(after.command_n);
    Some(change / (after.time_s - before.time_s))
}
