//! Signals of a page: numbers of one cycle, in SI units, angles in degrees.

use super::references::References;
use hexad_client::messages::CycleMessage;
use hexad_core::control::signals::time::seconds_between;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Exact;
use hexad_core::model::inverse_geometry::leg_motion;
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::{Pose, Twist};
use hexad_core::model::task::task_coordinates;
use hexad_daemon::nanoseconds;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;

/// Names of the signals and numbers of their components, in the order of a [`Row`]. `_ref` is the reference
/// of the controller at the instant of the compared quantity: of the measurement; of the middle between two
/// measurements for accelerations; of the middle of the hold for forces.
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

/// Instants after the release of a cycle \[ns\].
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleInstants {
    /// Instant of the reference: the end of the hold of its force.
    pub reference_ns: u64,
    /// Instant of the force: the middle of that hold.
    pub force_ns: u64,
}

impl CycleInstants {
    /// Instants of a controller.
    pub fn of_controller(config: &Config) -> Self {
        let period_ns = nanoseconds(config.deployment.realtime.period_s());
        let begin_ns = nanoseconds(config.deployment.drive.total_delay_s());
        Self { reference_ns: begin_ns + period_ns, force_ns: begin_ns + period_ns / 2 }
    }
}

/// Computes the rows of consecutive cycles.
pub struct Signals<'a> {
    machine: &'a Machine,
    instants: CycleInstants,
    coordinates: Coordinates,
    references: References,
    model: InverseDynamics,
    /// Previous cycle: instant of the measurement \[ns\], twist, rates of the legs.
    before: Option<(u64, [f64; 6], [f64; LEGS])>,
}

impl<'a> Signals<'a> {
    /// Signals of a machine. Angles and positions are coordinates of a tool in a work frame; all other signals are of the
    /// platform in the base frame.
    pub fn new(machine: &'a Machine, instants: CycleInstants, coordinates: Coordinates) -> Self {
        let model = InverseDynamics::new(machine);
        Self { machine, instants, coordinates, references: References::default(), model, before: None }
    }

    /// Row of a cycle. Accelerations are differences from the previous measurement.
    pub fn row(&mut self, cycle: &CycleMessage) -> Row {
        let mut row = Numbers::default();
        let output = cycle.output().unwrap_or_default();
        let home = &self.machine.home;
        let none = [f64::NAN; 6];
        let coordinates = |pose: &Pose| degrees(self.coordinates.tool_x(&task_coordinates(pose, home)));
        let platform = output.platform.as_ref();
        let CycleInstants { reference_ns, force_ns } = self.instants;
        self.references.add(cycle.release_ns + reference_ns, output.reference.as_ref());
        let has_measurement = cycle.has_measurement == 1;
        let instant_ns = if has_measurement { cycle.measured_time_ns } else { cycle.release_ns };
        let reference = self.references.at(instant_ns);
        let twist: Option<[f64; 6]> = platform.map(|it| it.twist.vector().into());
        row.six(platform.map(|it| coordinates(&it.pose)));
        row.six(reference.map(|it| coordinates(&it.pose)));
        row.six(twist.map(degrees));
        row.six(reference.map(|it| degrees(it.twist.vector().into())));

        let has_rates = has_measurement && cycle.rates_valid == 1;
        let rates = if has_rates { cycle.measured_length_rate_m_s } else { none };
        let (mut accelerations, mut leg_accelerations) = (none, none);
        let mut middle_ns = instant_ns;
        if let Some((before_ns, twist_before, rates_before)) = self.before {
            // Without a new measurement there is no difference.
            let dt = seconds_between(before_ns, cycle.measured_time_ns);
            let dt = if dt > 0.0 { dt } else { f64::NAN };
            middle_ns = if dt > 0.0 { before_ns.midpoint(cycle.measured_time_ns) } else { instant_ns };
            accelerations = rate_of_change(twist_before, twist.unwrap_or(none), dt);
            leg_accelerations = rate_of_change(rates_before, rates, dt);
        }
        self.before = Some((cycle.measured_time_ns, twist.unwrap_or(none), rates));
        row.six(Some(degrees(accelerations)));
        let between = self.references.at(middle_ns);
        row.six(between.map(|it| degrees(it.acceleration.vector().into())));

        let legs = reference.map(|it| leg_motion(self.machine, &it));
        row.six(has_measurement.then_some(cycle.measured_length_m));
        row.six(legs.as_ref().map(|it| it.length_m));
        row.six(Some(rates));
        row.six(legs.as_ref().map(|it| it.rate_m_s));
        row.six(Some(leg_accelerations));
        row.six(between.map(|it| leg_motion(self.machine, &it).accel_m_s2));
        let applied = output.state.has_control().then_some(output.command_n);
        let held = self.references.at(cycle.release_ns + force_ns);
        let computed = held.and_then(|it| self.model.forces::<Exact>(&it));
        row.six(applied);
        row.six(computed);
        row.six(applied.zip(computed).map(|(applied, computed)| difference(applied, computed)));

        let error = output.error.map(|error| norms(&error.pose));
        row.one(error.map(|(position, _)| position));
        row.one(error.map(|(_, orientation)| orientation));
        row.one(platform.map(|it| it.condition));
        row.one(Some(cycle.wakeup_ns as f64 * 1e-9));
        row.one(Some(cycle.compute_ns as f64 * 1e-9));
        let age_s = |time_ns: u64| seconds_between(time_ns, cycle.release_ns);
        row.one(has_measurement.then(|| age_s(cycle.measured_time_ns)));
        row.one((cycle.has_setpoint == 1).then(|| age_s(cycle.setpoint_time_ns)));
        row.finish()
    }
}

/// Norms of a displacement: \[m\], \[rad\].
pub fn norms(displacement: &Twist) -> (f64, f64) {
    (displacement.linear.norm(), displacement.angular.norm())
}

/// Converts the angular half to degrees.
pub fn degrees([a, b, c, x, y, z]: [f64; 6]) -> [f64; 6] {
    [a.to_degrees(), b.to_degrees(), c.to_degrees(), x, y, z]
}

/// Difference of six numbers.
pub fn difference(mut of: [f64; 6], less: [f64; 6]) -> [f64; 6] {
    of.iter_mut().zip(less).for_each(|(number, less)| *number -= less);
    of
}

/// Mean rate of change of six numbers in a time \[s\].
pub fn rate_of_change(before: [f64; 6], after: [f64; 6], dt: f64) -> [f64; 6] {
    difference(after, before).map(|change| change / dt)
}

/// A row under construction.
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
    use crate::commands::report::head::tests::framed;
    use hexad_core::control::controller::Output;
    use hexad_core::control::sensing::localization::PlatformState;
    use hexad_core::control::signals::inputs::{Input, Measurement};
    use hexad_core::model::rigid::Motion;
    use hexad_core::model::task::TaskState;

    /// Column of the first component of a signal.
    fn column(name: &str) -> usize {
        SIGNALS.iter().take_while(|(other, _)| *other != name).map(|(_, components)| components).sum()
    }

    /// The platform follows its reference exactly and is measured 1.7 ms before the release.
    #[test]
    fn the_reference_is_that_of_the_instant_of_the_measurement() {
        const AGE_NS: u64 = 1_700_000;
        let text = include_str!("../../../config/fried2008.toml");
        let config = Config::parse(&format!("{text}\n[realtime]\nrate_hz = 1000\n"), "a test").unwrap();
        let instants = CycleInstants::of_controller(&config);
        let mut signals = Signals::new(&config.machine, instants, Coordinates::default());
        let motion = |time_ns: u64| {
            let mut state = TaskState::at_rest(config.machine.home);
            let (w, t) = (5.0, time_ns as f64 * 1e-9);
            for (axis, size) in [(0, 0.1), (2, -0.1), (3, 0.05), (5, 0.03)] {
                state.x[axis] += size * (w * t).sin();
                state.xd[axis] = size * w * (w * t).cos();
                state.xdd[axis] = -size * w * w * (w * t).sin();
            }
            state.motion()
        };
        for number in 10..60 {
            let release_ns = number * 1_000_000;
            let time_ns = release_ns - AGE_NS;
            let Motion { pose, twist, .. } = motion(time_ns);
            let legs = leg_motion(&config.machine, &motion(time_ns));
            let (length_m, rate_m_s) = (legs.length_m, Some(legs.rate_m_s));
            let measurement = Some(Measurement { time_ns, length_m, rate_m_s, ..Measurement::default() });
            let platform =
                Some(PlatformState { pose, twist, condition: 1.0, time_to_singularity_s: f64::INFINITY });
            let reference = Some(motion(release_ns + instants.reference_ns));
            let output = Output { platform, reference, ..Output::default() };
            let input = Input { release_ns, measurement, ..Input::default() };
            let row = signals.row(&CycleMessage::new(&input, &output));
            if number < 15 {
                continue;
            }
            // The tolerance is the resolution of the numbers of a page. Without alignment the lengths would
            // differ by 0.4 mm.
            for (signal, components, tolerance) in [
                ("position", 3, 1e-6),
                ("angle", 3, 1e-5),
                ("velocity", 3, 1e-6),
                ("angular_velocity", 3, 1e-4),
                ("acceleration", 3, 1e-3),
                ("length", 6, 1e-6),
                ("leg_rate", 6, 1e-6),
                ("leg_acceleration", 6, 1e-3),
            ] {
                let [actual, reference] =
                    [signal.into(), format!("{signal}_ref")].map(|name: String| column(&name));
                for k in 0..components {
                    let [actual, reference] = [row[actual + k], row[reference + k]];
                    assert!((actual - reference).abs() < tolerance, "{signal}: {actual} {reference}");
                }
            }
        }
    }

    #[test]
    fn angles_and_positions_are_those_of_the_tool_in_the_work_frame() {
        let (config, coordinates) = framed();
        let platform = Some(PlatformState {
            pose: config.machine.home_pose(),
            twist: Twist::default(),
            condition: 1.0,
            time_to_singularity_s: f64::INFINITY,
        });
        let reference = Some(TaskState::at_rest(config.machine.home).motion());
        let output = Output { platform, reference, ..Output::default() };
        let mut signals = Signals::new(&config.machine, CycleInstants::default(), coordinates);
        let row = signals.row(&CycleMessage::new(&Input::default(), &output));
        for (angle, position) in [("angle", "position"), ("angle_ref", "position_ref")] {
            let [angles, positions] = [angle, position].map(|name| &row[column(name)..column(name) + 3]);
            assert!((angles[2] + 90.0).abs() < 1e-5 && (positions[1] + 0.45).abs() < 1e-6, "{angles:?}");
        }
    }

    #[test]
    fn the_columns_are_the_components_of_the_signals() {
        assert_eq!(SIGNALS.iter().map(|(_, components)| components).sum::<usize>(), COLUMNS);
        let mut numbers = Numbers::default();
        (0..COLUMNS).for_each(|column| numbers.one(Some(column as f64)));
        assert!(numbers.finish().iter().enumerate().all(|(column, number)| *number == column as f32));
    }
}
