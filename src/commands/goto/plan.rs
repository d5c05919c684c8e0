//! Planned motion as text: `hexad goto --dry-run`.

use core::fmt;

use crate::analysis::target_motion::TargetMotion;
use crate::commands::coordinates::Coordinates;
use crate::control::constants::Constants;
use crate::control::signals::limits::Limit;
use crate::control::supervision::in_position::InPositionWindow;
use crate::model::LEGS;
use crate::output::numbers::{AXES, MotionDigits, axis_unit, fixed, percent, significant};

/// Planned motion of the reference.
pub struct Plan<'a> {
    pub window: &'a InPositionWindow,
    pub constants: &'a Constants,
    pub coordinates: &'a Coordinates,
    pub digits: MotionDigits,
    pub from: &'a [f64; 6],
    pub origin: &'static str,
    pub to: &'a [f64; 6],
    pub speed: f64,
    pub motion: &'a TargetMotion,
    /// Whether a tool moves along a straight path, as setpoints.
    pub is_straight: bool,
}

impl fmt::Display for Plan<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { constants, coordinates, digits, window, from, origin, to, speed, motion, is_straight } =
            self;
        let Constants { parameters, .. } = constants;
        let actuator = &constants.machine().actuator;
        let rows =
            row("from", &coordinates.tool_x(from), *digits) + &row("to", &coordinates.tool_x(to), *digits);
        let digits = digits.mm;
        writeln!(f, "{}{rows}from is {origin}", heading(&coordinates.label))?;
        writeln!(
            f,
            "duration  {:.3} s, then {:.3} s in position within {} mm and {} mrad",
            motion.duration_s,
            window.settling_ns as f64 * 1e-9,
            significant(1e3 * window.tolerance_m),
            significant(1e3 * window.tolerance_rad)
        )?;
        writeln!(
            f,
            "velocity  at most {} mm/s and {} deg/s",
            significant(1e3 * motion.velocity_m_s),
            significant(motion.velocity_rad_s.to_degrees())
        )?;
        writeln!(
            f,
            "leg  length mm (stroke {} to {})  largest rate mm/s (of {})",
            fixed(1e3 * actuator.min_length, digits - 2),
            fixed(1e3 * actuator.max_length, digits - 2),
            fixed(1e3 * actuator.max_rate, digits - 2)
        )?;
        for (leg, ([shortest, longest], rate)) in
            (1..=LEGS).zip(motion.lengths_m.iter().zip(motion.leg_rates_m_s))
        {
            let [shortest, longest, rate] = [*shortest, *longest, rate].map(|x| fixed(1e3 * x, digits));
            writeln!(f, "{leg:>3}  {shortest:>9} to {longest:>9}  {rate:>19}")?;
        }
        let scale = percent(speed * parameters.limits_scale * parameters.limits.autonomous_scale);
        let scale = format!("with {scale} of [limits] (limits.scale, limits.autonomous_scale and --speed)");
        if *is_straight {
            return writeln!(f, "the tool goes straight, in a minimum-jerk motion {scale}");
        }
        let shares = Limit::ALL.into_iter().zip(motion.limited_shares).filter(|(_, share)| *share > 0.0);
        let limits: Vec<_> =
            shares.map(|(limit, share)| format!("{} {}", limit.name(), percent(share))).collect();
        let limits = limits.join(", ");
        if limits.is_empty() {
            return writeln!(f, "limited by the rate of the loop alone, because the way is short");
        }
        writeln!(f, "limited by {limits} of the time, {scale}")
    }
}

/// Line with X in millimetres and degrees.
pub fn row(name: &str, x: &[f64; 6], digits: MotionDigits) -> String {
    let numbers: String = x
        .iter()
        .enumerate()
        .map(|(k, x)| format!("{:>11}", fixed(x * axis_unit(k).0, digits.of_axis(k))))
        .collect();
    format!("{name:10}{numbers}\n")
}

/// Heading with the names of X, above [`row`], and above it what has these coordinates, unless the label is empty.
pub fn heading(label: &str) -> String {
    let names: String = AXES
        .iter()
        .enumerate()
        .map(|(k, axis)| format!("{:>11}", format!("{axis} {}", axis_unit(k).1)))
        .collect();
    let label = if label.is_empty() { String::new() } else { format!("{label}\n") };
    format!("{label}{:10}{names}\n", "")
}

/// X of the platform in the base frame and of the tool in the work frame, below a refusal, whose bounds are of the first.
pub fn both_coordinates(coordinates: &Coordinates, digits: MotionDigits, platform: &[f64; 6]) -> String {
    let tool = heading(&coordinates.label) + &row("target", &coordinates.tool_x(platform), digits);
    let text =
        heading("coordinates of the platform in the base frame") + &row("target", platform, digits) + &tool;
    text.trim_end().into()
}
