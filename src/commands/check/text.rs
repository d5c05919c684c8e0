//! Text of the result of `hexad check`.

use core::f64::consts::LN_2;
use core::fmt;

use super::report::{CheckReport, LegAtHome};
use hexad_core::model::sensitivity::CONDITION_MEANING;
use hexad_machine::text::numbers::{MotionDigits, fixed, significant};
use hexad_machine::text::text_table::{Right, text_table};

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match self.errors.len() {
            0 => "valid".to_string(),
            count => format!("NOT VALID, errors: {count}"),
        };
        writeln!(f, "{}: {verdict}. At home, at rest:\n", self.machine)?;
        let header = ["leg", "length", "to shortest", "to longest", "force", "of the limit", "to joint axis"];
        let rows = self.legs.iter().enumerate().map(|(index, leg)| cells(index, leg, self.digits));
        write!(f, "{}", text_table(2, &header.map(|name| (name, Right)), rows))?;
        writeln!(
            f,
            "\ncondition    {} ({CONDITION_MEANING}; limits.condition {})",
            significant(self.condition),
            significant(self.condition_limit)
        )?;
        if self.available_force_n != self.max_force_n {
            writeln!(
                f,
                "drives       of the largest command, {} N, every leg gets at least {} N (force_scale, load_friction)",
                significant(self.max_force_n),
                significant(self.available_force_n)
            )?;
        }
        if let Some(cone) = &self.gravity_cone {
            writeln!(f, "{cone}")?;
        }
        self.fmt_modes(f)?;
        writeln!(f, "other permitted poses             {}", self.other_pose_search)?;
        self.fmt_loops(f)?;
        writeln!(f, "{}", self.motion_limits)?;
        self.derived_limits.iter().try_for_each(|limit| writeln!(f, "{limit}"))?;
        self.exceedable_ranges.iter().try_for_each(|range| writeln!(f, "{range}"))?;
        writeln!(f, "{}", self.tolerances)?;
        self.warnings.iter().try_for_each(|warning| writeln!(f, "WARNING: {warning}"))
    }
}

fn cells(index: usize, leg: &LegAtHome, digits: MotionDigits) -> [String; 7] {
    let digits = digits.mm + 1;
    let metres = |length_m: f64| format!("{length_m:.digits$} m");
    [
        format!("{}", index + 1),
        metres(leg.length_m),
        metres(leg.to_shortest_m),
        metres(leg.to_longest_m),
        format!("{} N", fixed(leg.force_n.unwrap_or(f64::NAN), 2)),
        format!("{:.1} %", 100.0 * leg.force_ratio.unwrap_or(f64::NAN)),
        format!("{:.1} deg", leg.joint_axis_deg),
    ]
}

impl CheckReport {
    /// Writes the stability margins of the control loops.
    fn fmt_loops(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let compensated = if self.compensates_disturbances { "" } else { ", disturbances not compensated" };
        writeln!(
            f,
            "control mode {}, estimator {:.2} Hz{compensated}",
            self.control_mode, self.estimator_hz
        )?;
        writeln!(
            f,
            "disturbances that are no fault: up to {:.2} kg of changed payload, a sudden push of up to {:.2} m/s^2, \
             {:.2} N of friction in legs that turn around",
            self.payload_change_kg, self.disturbance_step_m_s2, self.friction_uncertainty_n
        )?;
        if let Some([softest, stiffest]) = self.leg_modes_hz {
            writeln!(f, "legs         coupled, they move with {softest:.2} to {stiffest:.2} Hz")?;
        }
        self.loops.iter().try_for_each(|margins| writeln!(f, "{}", margins.text))?;
        writeln!(
            f,
            "held forces  at a pose within limits.condition a displacement doubles in {:.1} ms; measurements stable to an age of {:.1} ms",
            1e3 * LN_2 / self.held_pole_per_s,
            1e3 * self.stable_age_s
        )
    }

    /// Writes the bounds within which the pose is unique, from cycle to cycle and at start-up.
    fn fmt_modes(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "pose certain from cycle to cycle  up to {:.1} mm or {:.2} deg, {:.1} m/s at {:.0} Hz",
            1e3 * self.certain_step_m,
            self.certain_step_rad.to_degrees(),
            self.certain_step_m * self.rate_hz,
            self.rate_hz,
        )?;
        let Some(nearest) = &self.nearest_pose else {
            return writeln!(f, "other poses with these lengths    none found within 90 deg of home");
        };
        let count = self.other_poses;
        writeln!(f, "other poses with these lengths    {count} found, the nearest {}", nearest.text)?;
        if nearest.is_confusable {
            writeln!(
                f,
                "WARNING: at start-up the lengths alone may not distinguish it from home; choose a home further away from it, or \
                 see at each start that the platform is where it is taken to be"
            )?;
        }
        if self.permitted_other_poses > 0 {
            let count = self.permitted_other_poses;
            writeln!(
                f,
                "WARNING: home.max_rotation_deg permits {count} of them: control begins at home only after hexad engage --pose N"
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_machine::config::Config;
    use hexad_machine::config::examination::Examination;

    const TELESCOPE: &str = include_str!("../../../tests/data/telescope_m2.toml");

    fn checked(text: &str) -> String {
        CheckReport::new(&Config::parse(text, "a test").unwrap(), &Examination::default()).to_string()
    }

    #[test]
    fn lengths_have_digits_that_fit_the_stroke() {
        let text = checked(include_str!("../../../tests/data/piezo.toml"));
        assert!(!text.contains("0.0000 m") && !text.contains("0.0001 m"), "{text}");
        let row: Vec<&str> = text.lines().nth(3).unwrap().split_whitespace().collect();
        let [length, shortest, longest] =
            [row[1], row[3], row[5]].map(|number| number.parse::<f64>().unwrap());
        assert!((shortest + longest - 1e-4).abs() < 2e-7 && (length - 0.08335).abs() < 1e-4, "{text}");
    }

    /// Another pose with the lengths of home is no reason for another home if no stroke leads there.
    #[test]
    fn another_home_is_advised_only_if_the_stroke_leads_to_another_pose() {
        let advice = "choose a home further away from it";
        assert!(!checked(TELESCOPE).contains(advice));
        let longer = TELESCOPE
            .replace("min_length_m = 0.4789", "min_length_m = 0.2")
            .replace("max_length_m = 0.5071", "max_length_m = 1.0");
        assert!(checked(&longer).contains(advice));
    }
}
