//! Planned motion as text: `hexad goto --dry-run`.

use core::fmt;

use hexad_core::control::constants::Constants;
use hexad_core::control::signals::limits::Limit;
use hexad_core::control::supervision::in_position::InPositionWindow;
use hexad_core::model::LEGS;
use hexad_daemon::motion_requests::plan::GotoPlan;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::coordinate_rows::CoordinateFormat;
use hexad_machine::text::numbers::{MotionDigits, fixed, percent, readable, significant};
use hexad_machine::text::units::{ANGLES, LENGTHS, MotionUnits};

/// Plan as text.
pub struct PlanText<'a> {
    pub plan: &'a GotoPlan,
    pub window: &'a InPositionWindow,
    pub constants: &'a Constants,
    pub coordinates: &'a Coordinates,
    pub units: MotionUnits,
    pub resolution: [f64; 2],
    pub origin: &'static str,
    pub speed: f64,
}

impl fmt::Display for PlanText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { plan, constants, coordinates, units, resolution, window, origin, speed } = self;
        let GotoPlan { from, to, motion, stream } = plan;
        let Constants { parameters, .. } = constants;
        let actuator = &constants.machine().actuator;
        let rows = [("from", from), ("to", to)].map(|(name, x)| (name, Some(coordinates.tool_x(x)), 0));
        let rows = CoordinateFormat::new(*units, *resolution).table(&coordinates.label, &rows);
        let digits = MotionDigits::new(*resolution).mm;
        writeln!(f, "{rows}from is {origin}")?;
        writeln!(
            f,
            "duration  {:.3} s, then {:.3} s in position within {} and {}",
            motion.duration_s,
            window.settling_ns as f64 * 1e-9,
            readable(window.tolerance_m, LENGTHS),
            readable(window.tolerance_rad, ANGLES)
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
            fixed(1e3 * actuator.min_length_m, digits - 2),
            fixed(1e3 * actuator.max_length_m, digits - 2),
            fixed(1e3 * actuator.max_rate_m_s, digits - 2)
        )?;
        for (leg, ([shortest, longest], rate)) in
            (1..=LEGS).zip(motion.lengths_m.iter().zip(motion.leg_rates_m_s))
        {
            let [shortest, longest, rate] = [*shortest, *longest, rate].map(|x| fixed(1e3 * x, digits));
            writeln!(f, "{leg:>3}  {shortest:>9} to {longest:>9}  {rate:>19}")?;
        }
        let scale = percent(speed * parameters.limits_scale * parameters.limits.autonomous_scale);
        let scale = format!("with {scale} of [limits] (limits.scale, limits.autonomous_scale and --speed)");
        if stream.is_some() {
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
