//! Pictures of a run, like figures 3 to 9 of the paper: commanded (dashed) and measured.

use std::path::Path;

use super::recording::{Recording, desired_motion, true_pose};
use crate::commands::report::signals::{degrees, difference, rate_of_change};
use crate::output::axis::{need_own_axes, range_of};
use crate::output::charts::{LineStyle, Panel, Series, write_svg};
use crate::output::svg::ChartError;
use hexad_core::control::signals::time::seconds_between;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Exact;
use hexad_core::model::inverse_geometry::leg_motion;
use hexad_machine::config::Config;

/// Values of six coordinates over time.
type Lines = [Vec<(f64, f64)>; LEGS];

/// Writes every picture into a folder. Returns the names of the files.
pub fn write_all(
    folder: &Path,
    name: &str,
    config: &Config,
    recording: &Recording,
) -> Result<Vec<&'static str>, ChartError> {
    let signals = Signals::new(config, recording);
    let mut written = vec![];
    let mut write = |file: &'static str, title: &str, panels: &[Panel]| {
        written.push(file);
        write_svg(&folder.join(file), &format!("{name}: {title}"), "time [s]", panels)
    };
    let Signals { commanded, measured, .. } = &signals;
    for (file, title, angular, linear, pair) in [
        (
            "trajectory.svg",
            "pose of the platform",
            "angle [deg]",
            "position [m]",
            [&commanded.x, &measured.x],
        ),
        (
            "velocity.svg",
            "velocity of the platform",
            "angular velocity [deg/s]",
            "velocity [m/s]",
            [&commanded.twist, &measured.twist],
        ),
        (
            "acceleration.svg",
            "acceleration of the platform",
            "angular acceleration [deg/s²]",
            "acceleration [m/s²]",
            [&commanded.acceleration, &measured.acceleration],
        ),
    ] {
        let axes = if file == "trajectory.svg" { POSE_AXES } else { MOTION_AXES };
        let angular = components(angular, &axes, pair, 0..3);
        write(file, title, &[angular, components(linear, &axes, pair, 3..6)].concat())?;
    }
    for (file, title, label, pair) in [
        ("leg_lengths.svg", "lengths of the legs", "length [m]", [&commanded.length, &measured.length]),
        ("leg_rates.svg", "velocities of the legs", "velocity [m/s]", [&commanded.rate, &measured.rate]),
        (
            "leg_accelerations.svg",
            "accelerations of the legs",
            "acceleration [m/s²]",
            [&commanded.accel, &measured.accel],
        ),
    ] {
        write(file, title, &components(label, &LEG_NAMES, pair, 0..6))?;
    }
    write_forces_and_errors(&signals, &mut write)?;
    Ok(written)
}

/// Writes the forces with the difference between applied and commanded forces, and the tracking error.
fn write_forces_and_errors(
    Signals { commanded, measured, force_difference, tracking }: &Signals,
    write: &mut impl FnMut(&'static str, &str, &[Panel]) -> Result<(), ChartError>,
) -> Result<(), ChartError> {
    let difference = LEG_NAMES.iter().zip(force_difference).enumerate();
    let difference = difference.map(|(k, (name, points))| vec![line(name, points, LineStyle::Solid, k)]);
    let forces = components("force [N]", &LEG_NAMES, [&commanded.force, &measured.force], 0..6);
    write(
        "forces.svg",
        "actuator forces, applied and (dashed) by inverse dynamics of the setpoint",
        &[forces, readable("applied - commanded [N]", difference.collect())].concat(),
    )?;
    let error = |label, lines, color| Panel {
        y_label: label,
        series: vec![line("", lines, LineStyle::Solid, color)],
    };
    let [position, orientation] = tracking;
    write(
        "tracking_error.svg",
        "desired minus true pose",
        &[error("position [m]", position, 0), error("orientation [rad]", orientation, 1)],
    )
}

const POSE_AXES: [&str; 6] = ["alpha", "beta", "gamma", "x", "y", "z"];
const MOTION_AXES: [&str; 6] = ["x", "y", "z", "x", "y", "z"];
const LEG_NAMES: [&str; 6] = ["leg 1", "leg 2", "leg 3", "leg 4", "leg 5", "leg 6"];

/// Panels of components, measured and (dashed) commanded.
fn components<'a>(
    y_label: &'a str,
    names: &[&'a str; 6],
    [commanded, measured]: [&'a Lines; 2],
    which: core::ops::Range<usize>,
) -> Vec<Panel<'a>> {
    let (count, first) = (which.len(), which.start);
    let curves = names.iter().zip(measured.iter().zip(commanded)).skip(first).take(count);
    // Colours count from the first component, so an axis has the same colour in all pictures.
    let lines = curves.enumerate().map(|(k, (name, (measured, commanded)))| {
        vec![line(name, measured, LineStyle::Solid, k), line("commanded", commanded, LineStyle::Dashed, k)]
    });
    readable(y_label, lines.collect())
}

/// One panel of all components, or one of each if a common axis would hide one of them.
fn readable<'a>(y_label: &'a str, components: Vec<Vec<Series<'a>>>) -> Vec<Panel<'a>> {
    let values = |lines: &Vec<Series>| range_of(lines.iter().flat_map(Series::finite).map(|(_, y)| y));
    if need_own_axes(&components.iter().map(values).collect::<Vec<_>>()) {
        return components.into_iter().map(|series| Panel { y_label, series }).collect();
    }
    let mut series = components.concat();
    // One entry of the legend for all dashed lines.
    let mut dashed = series.iter_mut().rev().filter(|series| series.style == LineStyle::Dashed);
    dashed.next();
    dashed.for_each(|series| series.label = "");
    // In the order of the legend.
    series.sort_by_key(|series| series.style == LineStyle::Dashed);
    vec![Panel { y_label, series }]
}

fn line<'a>(label: &'a str, points: &'a [(f64, f64)], style: LineStyle, color: usize) -> Series<'a> {
    Series { label, points, style, color }
}

/// Every curve of every picture.
#[derive(Default)]
struct Signals {
    commanded: Curves,
    measured: Curves,
    /// Applied minus commanded force, at the instants of the applied force \[N\].
    force_difference: Lines,
    /// Norms: position \[m\], orientation \[rad\].
    tracking: [Vec<(f64, f64)>; 2],
}

/// Curves of the commanded or the measured values. Angles in degrees.
#[derive(Default)]
struct Curves {
    x: Lines,
    twist: Lines,
    acceleration: Lines,
    length: Lines,
    rate: Lines,
    accel: Lines,
    force: Lines,
}

impl Signals {
    fn new(config: &Config, recording: &Recording) -> Self {
        let machine = &config.machine;
        let period_ns = (1e9 * config.deployment.realtime.period_s()) as u64;
        let start_ns = recording.start_ns();
        let seconds = |time_ns: u64| seconds_between(start_ns, time_ns);
        let mut signals = Self::default();
        let Self { commanded, measured, force_difference, tracking } = &mut signals;
        let model = InverseDynamics::new(machine);
        for setpoint in &recording.setpoints {
            let t = seconds(setpoint.header.time_ns);
            let motion = desired_motion(setpoint);
            let legs = leg_motion(machine, &motion);
            push(&mut commanded.x, t, degrees(setpoint.x));
            push(&mut commanded.twist, t, degrees(motion.twist.vector().into()));
            push(&mut commanded.acceleration, t, degrees(motion.acceleration.vector().into()));
            push(&mut commanded.length, t, legs.length_m);
            push(&mut commanded.rate, t, legs.rate_m_s);
            push(&mut commanded.accel, t, legs.accel_m_s2);
            push(&mut commanded.force, t, model.forces::<Exact>(&motion).unwrap_or([f64::NAN; LEGS]));
        }
        // Before the first setpoint there are no commanded values.
        let in_range = recording.measured.iter().filter(|message| message.header.time_ns >= start_ns);
        for message in in_range.clone() {
            let t = seconds(message.header.time_ns);
            push(&mut measured.x, t, degrees(message.x));
            push(&mut measured.twist, t, degrees(message.twist));
            push(&mut measured.length, t, message.length_m);
            push(&mut measured.rate, t, message.length_rate_m_s);
        }
        // Accelerations are not measured. They are differences of the rates, over two samples.
        for (before, after) in in_range.clone().zip(in_range.skip(2)) {
            let (t0, t1) = (seconds(before.header.time_ns), seconds(after.header.time_ns));
            let (t, dt) = (0.5 * (t0 + t1), t1 - t0);
            push(&mut measured.acceleration, t, degrees(rate_of_change(before.twist, after.twist, dt)));
            push(&mut measured.accel, t, rate_of_change(before.length_rate_m_s, after.length_rate_m_s, dt));
        }
        for force in recording.forces.iter().filter(|force| force.valid == 1) {
            push(&mut measured.force, seconds(force.header.time_ns), force.force_n);
        }
        for (message, desired) in recording.force_pairs(period_ns) {
            let commanded = model.forces::<Exact>(&desired.motion()).unwrap_or([f64::NAN; LEGS]);
            let difference = difference(message.force_n, commanded);
            push(force_difference, seconds(message.header.time_ns), difference);
        }
        for (message, desired) in recording.pairs() {
            let t = seconds(message.header.time_ns);
            let error = true_pose(message).displacement_to(&desired.motion().pose);
            let [position, orientation] = tracking;
            position.push((t, error.linear.norm()));
            orientation.push((t, error.angular.norm()));
        }
        signals
    }
}

fn push(lines: &mut Lines, t: f64, values: [f64; 6]) {
    for (line, value) in lines.iter_mut().zip(values) {
        line.push((t, value));
    }
}
