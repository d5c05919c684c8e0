//! Deployment: bounds, and what follows from the rate.

use hexad::analysis::fidelity_choice::FidelityComparison;
use hexad::config::Config;
use hexad::config::control_loops::longest_stable_age_s;
use hexad::config::deployment::{Deployment, FidelityChoice};
use hexad::config::fidelity::{envelope, fidelity, reason};
use hexad::control::law::estimator::SENT_ACCELERATIONS;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;

use super::{FRIED, messages, refused_each, violations};
use hexad_support::certificate::cases;

/// A value of each key beyond its bound, and what is said of it.
const BEYOND: &str = r#"
    realtime.rate_hz = 9: must be in [10, 20000]
    realtime.rate_hz = 20001: must be in [10, 20000]
    realtime.cpu = -1: must be an integer in [0, 1023]
    realtime.io_cpu = 1.0: must be an integer in [0, 1023]
    realtime.priority = 100: must be an integer in [1, 99]
    realtime.io_priority = 99999999999999999999: must be an integer in [1, 99]
    realtime.lock_memory = 1: must be true or false
    realtime.require_realtime = "no": must be true or false
    realtime.release = "spin": must be one of "sleep", "hybrid", "external", "lockstep"
    realtime.max_catch_up = 0: must be an integer in [1, 100]
    realtime.max_lead_us = 501: must be at most 500 (half a period of realtime.rate_hz = 1000)
    realtime.io_lead_us = 0: must be greater than 0
    realtime.cpu_dma_latency_us = -1: must be an integer in [0, 1000000]
    realtime.late_wakeup_us = 0: must be greater than 0
    realtime.late_wakeup_us = 501: must be at most 500 (half a period of realtime.rate_hz = 1000)
    operator.mode = "0777": must be one of "0600", "0660", "0666"
    operator.group = "a b": must be a name of 1 to 32 characters, each one of A-Z a-z 0-9 _ -
    measured.length_noise_m = 0: must be greater than 0
    drive.delay_us = 15001: must be in [0, 15000]
    control.disturbance_m_s2_per_sqrt_s = 0: must be greater than 0
    control.mode = "pid": must be one of "computed_torque", "feedforward_joint_pd", "gravity_joint_pd", "joint_pd"
    control.on_setpoint_lost = "coast": must be one of "fault", "stop", "park"
    control.position_bandwidth_hz = 0: must be greater than 0
    control.position_damping_ratio = 11: must be in [0.1, 10]
    control.orientation_damping_ratio = 11: must be in [0.1, 10]
    control.engage_position_m = 0.2: must be greater than 0 and at most 0.1
    control.engage_orientation_rad = 0.3: must be greater than 0 and at most 0.2
    control.fidelity_tolerance = 0: must be greater than 0 and at most 1
    control.fidelity_tolerance = 1.001: must be greater than 0 and at most 1
    control.fidelity_tolerance = -0.1: must be greater than 0 and at most 1
    limits.autonomous_scale = 1.1: must be greater than 0 and at most 1
    limits.velocity_m_s = 0: must be greater than 0
    limits.acceleration_m_s2 = 0: must be greater than 0
    limits.jerk_m_s3 = 0: must be greater than 0
    limits.velocity_rad_s = 0: must be greater than 0
    limits.acceleration_rad_s2 = 0: must be greater than 0
    limits.jerk_rad_s3 = 0: must be greater than 0
    limits.force_rate_n_s = 0: must be greater than 0
    timeouts.setpoint_ms = 1001: must be greater than 0 and at most 1000
    timeouts.measured_ms = 1: must be greater than 1 (one period of realtime.rate_hz = 1000)
    plant.force_timeout_ms = 0.5: must be greater than 1 (one period of realtime.rate_hz = 1000)
    plant.brake_deceleration_m_s2 = 0: must be greater than 0 and at most 1000
    plant.step_us = 5: must be in [10, 1000]"#;

#[test]
fn deployment_is_refused_beyond_what_the_rate_carries() {
    refused_each(FRIED, BEYOND.trim().lines());
    for (given, message) in [
        (
            "scheduler = \"deadline\"",
            "cpu = 0: must not be given with realtime.scheduler = \"deadline\" (Linux places such threads itself)",
        ),
        (
            "release = \"external\"",
            "on_overrun = \"catch_up\": must be one of \"skip\", \"fault\" with realtime.release = \"external\" (only the newest message is kept)",
        ),
        (
            "release = \"lockstep\"",
            "on_overrun = \"catch_up\": must be \"skip\" with realtime.release = \"lockstep\" (simulated time waits for the loop)",
        ),
        (
            "release = \"lockstep\"",
            "on_overrun = \"fault\": must be \"skip\" with realtime.release = \"lockstep\" (simulated time waits for the loop)",
        ),
        (
            "release = \"lockstep\"",
            "require_realtime = true: must be false with realtime.release = \"lockstep\" (simulated time)",
        ),
    ] {
        refused_each(&format!("{FRIED}[realtime]\n{given}\n"), [format!("realtime.{message}")]);
    }
    for accepted in [
        "[realtime]\nrate_hz = 20_000",
        "[operator]\ngroup = \"operators\"\nmode = \"0600\"",
        "[drive]\ndelay_us = 15000\nlag_us = 300",
        "[control]\nmode = \"joint_pd\"",
    ] {
        assert_eq!(messages(&format!("{FRIED}{accepted}")), [""; 0], "{accepted}");
    }
    // What follows from a refused number is not said again.
    let found =
        violations(&format!("{FRIED}[control]\nposition_bandwidth_hz = 300\ncompensate_disturbances = true"));
    let keys: Vec<_> = found.iter().map(|violation| violation.key.as_str()).collect();
    assert_eq!(keys, ["control.position_bandwidth_hz"]);
}

#[test]
fn fidelity_is_auto_or_a_rung_with_inertia() {
    let read = |text: &str| Config::parse(&format!("{FRIED}[control]\n{text}"), "test.toml").unwrap();
    let fidelity = |text: &str| read(text).deployment.control.fidelity;
    assert_eq!(fidelity(""), FidelityChoice::Fixed(Fidelity::Exact));
    assert_eq!(fidelity("fidelity = \"auto\""), FidelityChoice::Auto);
    for choice in &Fidelity::ALL[1..] {
        assert_eq!(fidelity(&format!("fidelity = \"{}\"", choice.name())), FidelityChoice::Fixed(*choice));
    }
    assert_eq!(read("fidelity_tolerance = 1").deployment.control.fidelity_tolerance_share, 1.0);
    let names = "\"exact\", \"rigid-legs\", \"no-velocity\", \"lumped-legs\", \"massless-legs\", \"auto\"";
    let message = |value| format!("control.fidelity = {value}: must be one of {names}");
    refused_each(FRIED, ["\"gravity\"", "\"Exact\"", "\"\"", "1", "[\"auto\"]"].map(message));
}

#[test]
fn the_cheapest_fidelity_within_the_tolerance_is_chosen_for_a_reason() {
    for (tolerance, choice, words) in [
        (
            "0.001",
            Fidelity::RigidLegs,
            &[
                "leaving out spin of the legs costs 0.00",
                "of the peak force, the largest found; tolerance 0.1 %; velocity terms and spin would cost 0.66",
                "extent of the legs would cost",
            ][..],
        ),
        ("1e-9", Fidelity::Exact, &["nothing may be left out at a tolerance of 0.0000001 %"]),
        // Gravity would be within this tolerance.
        ("1", Fidelity::MasslessLegs, &[]),
    ] {
        let text = format!("{FRIED}[control]\nfidelity = \"auto\"\nfidelity_tolerance = {tolerance}");
        let config = Config::parse(&text, "test.toml").unwrap();
        assert_eq!(fidelity(&config), choice, "{tolerance}");
        let model = InverseDynamics::new(&config.machine);
        let comparison = FidelityComparison::of_envelope(&model, &envelope(&config, &model));
        let reason = reason(&comparison, config.deployment.control.fidelity_tolerance_share);
        words.iter().for_each(|words| assert!(reason.contains(words), "{words:?} must be in {reason}"));
    }
}

#[test]
fn an_envelope_is_complete_and_about_home() {
    const GOOD: &str = "[envelope]
pose_min = [-0.1, -3.2, 0, -1, 0, -0.3]
pose_max = [0.1, 3.2, 0, 1, 0, 0.3]
velocity = [1, 2, 3, 4, 5, 6]
acceleration = [0, 0, 0, 0, 0, 9.81]
";
    let good = format!("{FRIED}{GOOD}");
    let limits = Config::parse(&good, "test.toml").unwrap().deployment.envelope.unwrap();
    assert_eq!(limits.pose_min, [-0.1, -3.2, 0.0, -1.0, 0.0, -0.3]);
    assert_eq!(limits.pose_max, [0.1, 3.2, 0.0, 1.0, 0.0, 0.3]);
    assert_eq!(limits.velocity, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(limits.acceleration, [0.0, 0.0, 0.0, 0.0, 0.0, 9.81]);
    assert_eq!(Config::parse(FRIED, "test.toml").unwrap().deployment.envelope, None);
    // The second with degrees.
    let rows = "envelope.pose_min[1] = 0.05: must be in [-3.2, 0]
        envelope.pose_max[1] = 6: must be in [0, 3.2]
        envelope.pose_min[6] = 0.01: must be at most 0
        envelope.pose_max[6] = -0.3: must be at least 0
        envelope.velocity[2] = -2: must be at least 0
        envelope.acceleration[6] = inf: must be a finite number, at most 1e12 in magnitude
        envelope.velocity = [1, 2, 3, 4, 5]: must be an array of 6 numbers
        envelope.velocity = 1: must be an array of 6 numbers
        envelope.velocity: missing, must be given with the other keys of the section
        envelope.speed = [1]: unknown key, must be one of: pose_min, pose_max, velocity, acceleration";
    refused_each(&good, rows.lines());
}

#[test]
#[ignore = "second tier: takes long"]
fn certificate_the_largest_bandwidth_in_the_message_is_accepted() {
    let loops = [
        (1000.0, 1.0, "10"),
        (1000.0, 0.1, "10"),
        (100.0, 0.7, "01"),
        (50.0, 10.0, "00"),
        (20_000.0, 3.0, "25"),
    ];
    for (rate, damping, lead) in cases(loops, 3) {
        for (axis, other) in [("position", "orientation"), ("orientation", "position")] {
            let text = |bandwidth: f64| {
                format!(
                    "{FRIED}[realtime]\nrate_hz = {rate}\n[timeouts]\nmeasured_ms = 100\n[control]\n\
                     {axis}_bandwidth_hz = {bandwidth}\n{axis}_damping_ratio = {damping}\n{other}_bandwidth_hz = 0.01\n"
                )
            };
            let found = violations(&text(rate));
            let [violation] = found.as_slice() else { panic!("{found:#?}") };
            assert_eq!(violation.key, format!("control.{axis}_bandwidth_hz"));
            let (_, bound) = violation.bound.split_once("must be at most ").unwrap();
            let (largest, rest) = bound.split_once(' ').unwrap();
            assert_eq!(
                rest,
                format!(
                    "at realtime.rate_hz = {rate} and {axis}_damping_ratio = {damping} (stable with 2.{lead} \
                     periods from measurement to force)"
                )
            );
            let largest: f64 = largest.parse().unwrap();
            assert_eq!(violations(&text(largest)), []);
            assert_eq!(violations(&text(largest + 0.002)).len(), 1);
        }
    }
}

#[test]
fn defaults_fit_the_rate() {
    for (rate_hz, late_wakeup_s, measured_s) in [
        // So slow a loop is not stable at home: the platform leaves it by itself. `check` refuses it.
        (10, 200e-6, 0.2),
        (100, 200e-6, 0.035),
        (2500, 200e-6, 0.02),
        (5000, 100e-6, 0.02),
        (20_000, 25e-6, 0.02),
    ] {
        let text = format!("{FRIED}[realtime]\nrate_hz = {rate_hz}\n");
        let Deployment { realtime, timeouts, control, .. } =
            Config::parse(&text, "test.toml").unwrap().deployment;
        assert_eq!(realtime.late_wakeup_s, late_wakeup_s);
        assert_eq!(timeouts.measured_s, measured_s);
        assert_eq!(control.position_bandwidth_hz == 10.0, rate_hz > 300);
    }
}

/// A slow loop at a high rate stands an age of many periods; the estimator knows only so many of the accelerations sent since.
#[test]
fn measurements_are_no_older_than_what_the_estimator_remembers() {
    let bandwidths = "[control]\nposition_bandwidth_hz = 5.0\norientation_bandwidth_hz = 5.0\n";
    let text = format!("{FRIED}[realtime]\nrate_hz = 20_000\n{bandwidths}[timeouts]\nmeasured_ms = 10.0\n");
    let Config { deployment, .. } = Config::parse(&text, "a test").expect("a valid file");
    let oldest_s = longest_stable_age_s(&deployment) + deployment.drive.total_delay_s();
    let remembered_s = (SENT_ACCELERATIONS - 1) as f64 * deployment.realtime.period_s();
    assert!((oldest_s - remembered_s).abs() < 1e-12, "{oldest_s} s of {remembered_s} s");
}
