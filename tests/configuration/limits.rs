//! Limits of the reference and of feedback, and what becomes of setpoints beyond them.

use hexad::config::Config;
use hexad::config::deployment::{Deployment, DeploymentLimits};
use hexad::control::parameters::ViolationPolicy;
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::kinematic_state::KinematicState;

use super::{FRIED, refused_each, violations};

fn deployment(text: &str) -> Deployment {
    Config::parse(&format!("{FRIED}{text}"), "test.toml").unwrap().deployment
}

/// Least distance of home's leg lengths from the ends of the stroke.
fn margin_of_home(text: &str) -> f64 {
    let machine = Config::parse(text, "test.toml").unwrap().machine;
    let lengths = leg_lengths(&machine, &machine.home_pose());
    let (min, max) = (machine.actuator.min_length_m, machine.actuator.max_length_m);
    lengths.iter().map(|length| (length - min).min(max - length)).fold(f64::INFINITY, f64::min)
}

#[test]
fn setpoints_beyond_the_limits_end_in_a_stop_unless_the_policy_is_limit() {
    assert_eq!(deployment("").setpoint.on_violation, ViolationPolicy::Stop);
    assert_eq!(deployment("[setpoint]\n").setpoint.on_violation, ViolationPolicy::Stop);
    let policy = |name: &str| deployment(&format!("[setpoint]\non_violation = \"{name}\"\n"));
    assert_eq!(policy("stop").setpoint.on_violation, ViolationPolicy::Stop);
    assert_eq!(policy("limit").setpoint.on_violation, ViolationPolicy::Limit);
    let message = |value| format!("setpoint.on_violation = {value}: must be one of \"stop\", \"limit\"");
    refused_each(FRIED, ["\"clip\"", "\"Limit\"", "\"\"", "true", "1"].map(message));
    let unknown =
        "setpoint.policy = 1: unknown key, must be one of: on_violation, approach, on_return, clock";
    refused_each(FRIED, [unknown]);
}

#[test]
fn velocity_errors_are_bounded_by_a_share_of_the_limits_unless_given() {
    let bounds = |text: &str| {
        let known = FRIED.replace("max_force_n = 500.0", "max_force_n = 500.0\nfriction_uncertainty_n = 0.0");
        let control = Config::parse(&format!("{known}{text}"), "test.toml").unwrap().deployment.control;
        (control.following_velocity_m_s, control.following_velocity_rad_s)
    };
    assert_eq!(bounds(""), (0.3 * 1.0, 0.3 * 2.0));
    assert_eq!(bounds("[limits]\nvelocity_m_s = 0.2\nvelocity_rad_s = 0.5\n"), (0.3 * 0.2, 0.3 * 0.5));
    let given = "[control]\nfollowing_velocity_m_s = 0.01\nfollowing_velocity_rad_s = 7\n";
    assert_eq!(bounds(given), (0.01, 7.0));
    for key in ["following_velocity_m_s", "following_velocity_rad_s"] {
        let rows = [
            "0: must be greater than 0",
            "-0.3: must be greater than 0",
            "inf: must be a finite number, at most 1e12 in magnitude",
            "\"0.3\": must be a number, greater than 0",
        ];
        refused_each(FRIED, rows.map(|row| format!("control.{key} = {row}")));
    }
    // What follows from a refused limit is not reported again.
    let found = violations(&format!("{FRIED}[limits]\nvelocity_m_s = -1\n"));
    assert_eq!(found.iter().map(|it| it.key.as_str()).collect::<Vec<_>>(), ["limits.velocity_m_s"]);
}

#[test]
fn feedback_may_add_half_of_the_limits_unless_given() {
    assert_eq!(deployment("").limits.feedback_scale, 0.5);
    assert_eq!(deployment("[limits]\nfeedback_scale = 3\n").limits.feedback_scale, 3.0);
    let rows = "limits.feedback_scale = 0: must be greater than 0
        limits.feedback_scale = -0.5: must be greater than 0
        limits.feedback_scale = nan: must be a finite number, at most 1e12 in magnitude";
    refused_each(FRIED, rows.lines());
}

#[test]
fn the_scale_slows_motions_and_changes_no_other_bound() {
    let full = deployment("");
    assert_eq!((full.limits.scale, full.limits.in_force()), (1.0, full.limits.reference));
    let slow = deployment("[limits]\nscale = 0.05\n");
    let (position, all) = (slow.limits.in_force().position, full.limits.reference.position);
    assert_eq!(position.velocity, 0.05 * all.velocity);
    assert_eq!((position.acceleration, position.jerk), (0.05 * all.acceleration, 0.05 * all.jerk));
    assert_eq!(slow.limits.in_force().orientation, full.limits.reference.orientation.scaled(0.05));
    assert_eq!((slow.control, slow.timeouts), (full.control, full.timeouts));
    assert_eq!(slow.limits, DeploymentLimits { scale: 0.05, ..full.limits });
    let beyond = ["0.049", "1.01", "0", "-1"];
    refused_each(FRIED, beyond.map(|value| format!("limits.scale = {value}: must be in [0.05, 1]")));
    refused_each(FRIED, ["limits.scale = \"10 %\": must be a number, in [0.05, 1]"]);
}

#[test]
fn disturbances_are_allowed_as_given_or_all() {
    let allowed = |text: &str| {
        let limits = deployment(text).limits;
        (limits.payload_change_kg, limits.disturbance_step_m_s2)
    };
    assert_eq!(allowed(""), (None, None));
    let given = "[limits]\npayload_change_kg = 0.001\ndisturbance_step_m_s2 = 1e12\n";
    assert_eq!(allowed(given), (Some(0.001), Some(1e12)));
    let all = "[limits]\npayload_change_kg = inf\ndisturbance_step_m_s2 = +inf\n";
    assert_eq!(allowed(all), (Some(f64::INFINITY), Some(f64::INFINITY)));
    for key in ["payload_change_kg", "disturbance_step_m_s2"] {
        let bound = "greater than 0 and at most 1e12, or inf";
        let beyond = ["0", "-1", "-inf", "nan", "1e13"];
        refused_each(FRIED, beyond.map(|value| format!("limits.{key} = {value}: must be {bound}")));
        refused_each(FRIED, [format!("limits.{key} = \"inf\": must be a number, {bound}")]);
        refused_each(FRIED, [format!("limits.{key} = 1e-13: must be at least 1e-12")]);
    }
}

#[test]
fn the_margin_of_the_stroke_is_at_most_that_of_home() {
    let margin = |text: &str| deployment(text).limits.stroke_margin_m;
    // Half a percent of 0.85 m to 1.6 m.
    assert!((margin("") - 0.005 * 0.75).abs() < 1e-15);
    assert_eq!(margin("[limits]\nstroke_margin_m = 0\n"), 0.0);
    refused_each(FRIED, ["limits.stroke_margin_m = -0.001: must be at least 0"]);
    let found = violations(&format!("{FRIED}[limits]\nstroke_margin_m = 0.7\n"));
    let [violation] = found.as_slice() else { panic!("{found:#?}") };
    assert_eq!((violation.key.as_str(), violation.value.as_deref()), ("limits.stroke_margin_m", Some("0.7")));
    assert_eq!(violation.line, FRIED.lines().count() + 2);
    // The bound in the message is accepted; a thousandth more is not.
    let bound = violation.bound.strip_prefix("must be at most ").unwrap();
    let (bound, of) = bound.split_once(' ').unwrap();
    assert_eq!(of, "(the margin of home)");
    let bound: f64 = bound.parse().unwrap();
    let at_home = margin_of_home(FRIED);
    assert!(bound <= at_home && bound > 0.9999 * at_home, "{bound} of {at_home}");
    assert_eq!(margin(&format!("[limits]\nstroke_margin_m = {bound}\n")), bound);
    assert_eq!(violations(&format!("{FRIED}[limits]\nstroke_margin_m = {}\n", 1.001 * bound)).len(), 1);
}

#[test]
fn a_home_near_the_end_of_the_stroke_has_a_smaller_default_and_one_beyond_is_reported_alone() {
    let near = FRIED.replace("max_length_m = 1.6", "max_length_m = 1.205");
    let at_home = margin_of_home(&near);
    let config = Config::parse(&near, "test.toml").unwrap();
    assert!(at_home < 0.002, "{at_home}");
    assert_eq!(config.deployment.limits.stroke_margin_m, 0.5 * at_home);
    let beyond = FRIED.replace("max_length_m = 1.6", "max_length_m = 1.0");
    let found = violations(&beyond);
    assert!(found.iter().all(|it| it.key.starts_with("leg[")) && found.len() == 6, "{found:#?}");
    // Nor is a margin that is given.
    assert_eq!(violations(&format!("{beyond}[limits]\nstroke_margin_m = 0.001\n")).len(), 6);
}

/// With the delay of a slow loop an error near a singular pose grows faster than feedback acts.
/// Legs of 0.12 m at 250 Hz: the adversary's platform had 6.6 rad/s^2 where 6 were allowed, and with slower limits 3.1 where 3 were.
#[test]
fn a_limit_of_acceleration_that_held_forces_exceed_is_refused() {
    let text = include_str!("../data/tabletop.toml");
    let with = |acceleration: f64, rate_hz: f64| {
        let velocities = "velocity_m_s = 1.0\nvelocity_rad_s = 2.0\nacceleration_m_s2 = 1.0";
        format!(
            "{text}[realtime]\nrate_hz = {rate_hz}\n[limits]\n{velocities}\nacceleration_rad_s2 = {acceleration}\n"
        )
    };
    let found = violations(&with(4.0, 250.0));
    let [violation] = found.as_slice() else { panic!("{found:#?}") };
    assert_eq!(violation.key, "limits.acceleration_rad_s2");
    let bound = violation.bound.strip_prefix("must be at least ").unwrap();
    let (bound, of) = bound.split_once(": ").unwrap();
    assert!(of.starts_with("forces held for 0.004 s turn with the legs and change it by 5."), "{of}");
    let bound: f64 = bound.parse().unwrap();
    assert!((11.0..11.1).contains(&bound), "{bound}");
    assert_eq!(violations(&with(bound, 250.0)), []);
    assert_eq!(violations(&with(0.999 * bound, 250.0)).len(), 1);
    assert_eq!(violations(&with(4.0, 1000.0)), []);
    let slower = with(2.0, 250.0)
        .replace("velocity_m_s = 1.0\nvelocity_rad_s = 2.0", "velocity_m_s = 0.3\nvelocity_rad_s = 0.6");
    assert_eq!(violations(&slower).len(), 1);
}

#[test]
fn the_default_condition_is_less_at_slow_rates_and_leaves_room_around_home() {
    let condition = |text: &str| deployment(text).limits.condition;
    let at_rate = |rate_hz: f64| condition(&format!("[realtime]\nrate_hz = {rate_hz}\n"));
    for rate_hz in [500.0, 1000.0, 20_000.0] {
        assert_eq!(at_rate(rate_hz), 100.0, "{rate_hz} Hz");
    }
    let machine = Config::parse(FRIED, "test.toml").unwrap().machine;
    let home = KinematicState::new(&machine, machine.home_pose());
    let at_home = home.sensitivity().condition;
    let slowest_hz = [80.0, 100.0, 120.0].map(|rate_hz: f64| {
        let limits = deployment(&format!("[realtime]\nrate_hz = {rate_hz}\n")).limits;
        let largest = limits.condition;
        assert!(largest < 100.0 && largest >= 1.5 * at_home, "{rate_hz} Hz: {largest}, home {at_home}");
        // Growth in two periods, the 100 us of the I/O thread and half of the hold.
        let exponent = limits.held_pole_per_s * (2.5 / rate_hz + 100e-6);
        assert!(exponent <= 0.2 || largest == 1.5 * at_home, "{rate_hz} Hz: {exponent}");
        largest
    });
    assert!(slowest_hz.is_sorted());
    assert_eq!(at_rate(20.0), 1.5 * at_home);
    assert_eq!(condition("[realtime]\nrate_hz = 100\n[limits]\ncondition = 90\n"), 90.0);
}
