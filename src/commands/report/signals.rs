//! The curves of a page: numbers of one cycle, in the units in which they are drawn.

use crate::control::input_validation::seconds_between;
use crate::messages::CycleMessage;
use crate::model::active_forces::InverseDynamics;
use crate::model::fidelity::Exact;
use crate::model::inverse_geometry::leg_motion;
use crate::model::machine::{LEGS, Machine};
use crate::model::rigid::{Pose, Twist};
use crate::model::task::task_coordinates;

/// Names of the signals and their components, in the order of a [`Row`]. `_ref` is the reference of the controller.
pub const SIGNALS: &[(&str, usize)] = &[
    ("angle", 3),
    ("position", 3),
    ("angle_ref", 3),
    ("position_ref", 3),
    ("angular_velocity", 3),
    ("velocity", 3),
    ("angular_velocity_ref", 3),
    ("velocity_ref", 3),
    ("angular_acceleration", 3),
    ("acceleration", 3),
    ("angular_acceleration_ref", 3),
    ("acceleration_ref", 3),
    ("length", LEGS),
    ("length_ref", LEGS),
    ("leg_rate", LEGS),
    ("leg_rate_ref", LEGS),
    ("leg_acceleration", LEGS),
    ("leg_acceleration_ref", LEGS),
    ("force", LEGS),
    ("force_ref", LEGS),
    ("force_difference", LEGS),
    ("position_error", 1),
    ("orientation_error", 1),
    ("condition", 1),
    ("wakeup", 1),
    ("compute", 1),
    ("measured_age", 1),
    ("setpoint_age", 1),
];

/// Components of all signals.
pub const COLUMNS: usize = 97;

/// Numbers of one cycle; NaN where there is none.
pub type Row = [f32; COLUMNS];

/// Computes the rows of consecutive cycles.
pub struct Signals<'a> {
    machine: &'a Machine,
    model: InverseDynamics,
    /// Instant of the measurement \[ns\], twist and rates of the legs of the cycle before.
    before: Option<(u64, [f64; 6], [f64; LEGS])>,
}

impl<'a> Signals<'a> {
    /// Signals of a machine.
    pub fn new(machine: &'a Machine) -> Self {
        Self { machine, model: InverseDynamics::new(machine), before: None }
    }

    /// Row of a cycle. Accelerations are differences to the measurement before.
    pub fn row(&mut self, cycle: &CycleMessage) -> Row {
        let mut row = Numbers::default();
        let output = cycle.output().unwrap_or_default();
        let home = &self.machine.home;
        let none = [f64::NAN; 6];
        let coordinates = |pose: &Pose| degrees(task_coordinates(pose, home));
        let platform = output.platform.as_ref();
        let reference = output.reference.as_ref();
        let twist: Option<[f64; 6]> = platform.map(|it| it.twist.vector().into());
        row.six(platform.map(|it| coordinates(&it.pose)));
        row.six(reference.map(|it| coordinates(&it.pose)));
        row.six(twist.map(degrees));
        row.six(reference.map(|it| degrees(it.twist.vector().into())));

        let has_rates = cycle.has_measurement == 1 && cycle.rates_valid == 1;
        let rates = if has_rates { cycle.measured_length_rate_m_s } else { none };
        let (mut accelerations, mut leg_accelerations) = (none, none);
        if let Some((before_ns, twist_before, rates_before)) = self.before {
            // Without a new measurement there is no change.
            let dt = seconds_between(before_ns, cycle.measured_time_ns);
            let dt = if dt > 0.0 { dt } else { f64::NAN };
            accelerations = rate_of_change(twist_before, twist.unwrap_or(none), dt);
            leg_accelerations = rate_of_change(rates_before, rates, dt);
        }
        self.before = Some((cycle.measured_time_ns, twist.unwrap_or(none), rates));
        row.six(Some(degrees(accelerations)));
        row.six(reference.map(|it| degrees(it.acceleration.vector().into())));

        let legs = reference.map(|it| leg_motion(self.machine, it));
        row.six((cycle.has_measurement == 1).then_some(cycle.measured_length_m));
        row.six(legs.as_ref().map(|it| it.length));
        row.six(Some(rates));
        row.six(legs.as_ref().map(|it| it.rate));
        row.six(Some(leg_accelerations));
        row.six(legs.as_ref().map(|it| it.accel));
        let applied = output.state.has_control().then_some(output.force);
        let computed = reference.and_then(|it| self.model.forces::<Exact>(it));
        row.six(applied);
        row.six(computed);
        row.six(applied.zip(computed).map(|(applied, computed)| difference(applied, computed)));

        let error = output.error.map(|error| norms(&error.pose));
        row.one(error.map(|(position, _)| position * 1e6));
        row.one(error.map(|(_, orientation)| orientation * 1e6));
        row.one(platform.map(|it| it.condition));
        row.one(Some(cycle.wakeup_ns as f64 * 1e-3));
        row.one(Some(cycle.compute_ns as f64 * 1e-3));
        let age_ms = |time_ns: u64| 1e3 * seconds_between(time_ns, cycle.release_ns);
        row.one((cycle.has_measurement == 1).then(|| age_ms(cycle.measured_time_ns)));
        row.one((cycle.has_setpoint == 1).then(|| age_ms(cycle.setpoint_time_ns)));
        row.finish()
    }
}

/// Norms of a displacement: \[m\], \[rad\].
pub fn norms(displacement: &Twist) -> (f64, f64) {
    (displacement.linear.norm(), displacement.angular.norm())
}

/// The angular half in degrees.
fn degrees([a, b, c, x, y, z]: [f64; 6]) -> [f64; 6] {
    [a.to_degrees(), b.to_degrees(), c.to_degrees(), x, y, z]
}

fn difference(mut of: [f64; 6], less: [f64; 6]) -> [f64; 6] {
    of.iter_mut().zip(less).for_each(|(number, less)| *number -= less);
    of
}

fn rate_of_change(before: [f64; 6], after: [f64; 6], dt: f64) -> [f64; 6] {
    difference(after, before).map(|change| change / dt)
}

/// A row in the making.
struct Numbers {
    row: Row,
    next: usize,
}

impl Default for Numbers {
    fn default() -> Self {
        Self { row: [f32::NAN; COLUMNS], next: 0 }
    }
}

impl Numbers {
    fn add(&mut self, number: f64) {
        if let Some(place) = self.row.get_mut(self.next) {
            // JSON and charts have no infinity.
            *place = if number.is_finite() { number as f32 } else { f32::NAN };
        }
        self.next += 1;
    }

    fn six(&mut self, numbers: Option<[f64; 6]>) {
        numbers.unwrap_or([f64::NAN; 6]).into_iter().for_each(|number| self.add(number));
    }

    fn one(&mut self, number: Option<f64>) {
        self.add(number.unwrap_or(f64::NAN));
    }

    fn finish(self) -> Row {
        debug_assert_eq!(self.next, COLUMNS, "a row has the components that are declared");
        self.row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_columns_are_the_components_of_the_signals() {
        assert_eq!(SIGNALS.iter().map(|(_, components)| components).sum::<usize>(), COLUMNS);
        let mut numbers = Numbers::default();
        (0..COLUMNS).for_each(|column| numbers.one(Some(column as f64)));
        assert!(numbers.finish().iter().enumerate().all(|(column, number)| *number == column as f32));
    }
}
