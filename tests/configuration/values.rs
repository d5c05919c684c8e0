//! One value at a time: where it goes, and what is said when it is missing, unknown or out of bounds.

use std::path::Path;

use hexad::config::Config;

use super::{FRIED, fried_with, messages, refused, refused_each};

#[test]
fn values_arrive_where_they_belong() {
    let text = fried_with(
        "platform_m = [0.0, 0.321393804843, 0.383022221559]",
        "platform_m = [0.0, 0.321393804843, 0.383022221559]\nuniversal_axis = [0, 3, -4]",
    ) + "[realtime]\nrate_hz = 2_000\ncpu = 0x3\n[timeouts]\nmeasured_ms = 5\n[plant]\nstep_us = 100\n";
    let config = Config::parse(&text, "test.toml").unwrap();
    let machine = &config.machine;
    assert_eq!(machine.gravity_m_s2.as_slice(), [-9.81, 0.0, 0.0]);
    assert_eq!(machine.platform.inertia.m11, 0.375);
    assert_eq!(machine.rod.transverse_inertia.reference_length_m, 0.83);
    assert_eq!(machine.cylinder.transverse_inertia.constant_kg_m2, 0.0038);
    assert_eq!(machine.cylinder.transverse_inertia.quadratic_kg, 0.0);
    assert_eq!((machine.actuator.max_rate_m_s, machine.actuator.max_force_n), (2.0, 500.0));
    assert_eq!(machine.home, [0.0, 0.0, 0.0, 1.1, 0.0, 0.0]);
    assert_eq!(machine.joints.triples.unpack(&machine.joints.base[2])[1], 0.704769465589);
    assert_eq!(machine.joints.triples.unpack(&machine.joints.platform[1])[5], 0.321393804843);
    let axes = |k: usize| machine.joints.triples.unpack(&machine.joints.universal_axis[k]);
    assert_eq!((axes(1), axes(2)), ([0.6, 1.0, 1.0, 1.0, 1.0, 1.0], [-0.8, 0.0, 0.0, 0.0, 0.0, 0.0]));
    let deployment = &config.deployment;
    assert_eq!((deployment.realtime.rate_hz, deployment.realtime.period_s()), (2000.0, 5e-4));
    assert_eq!((deployment.realtime.cpu, deployment.realtime.io_cpu), (Some(3), None));
    assert_eq!((deployment.timeouts.measured_s, deployment.timeouts.setpoint_s), (0.005, 0.05));
    assert_eq!((deployment.plant.step_s, deployment.realtime.late_wakeup_s), (1e-4, 2e-4));
}

#[test]
fn off_diagonal_inertia_is_symmetric() {
    let config = Config::load(Path::new("config/motion_base.toml")).unwrap();
    let inertia = config.machine.platform.inertia;
    assert_eq!((inertia.m12, inertia.m13, inertia.m23), (12.0, -20.0, 8.0));
    assert_eq!(inertia, inertia.transpose());
}

#[test]
fn single_values_are_refused_with_key_value_and_bound() {
    let rows = r#"
        platform.mass_kg = -3: must be greater than 0
        platform.mass_kg = 0.0: must be greater than 0
        platform.mass_kg = 1e-300: must be at least 1e-12
        platform.mass_kg = "3": must be a number, greater than 0
        platform.mass_kg = [3.0]: must be a number, greater than 0
        platform.mass_kg = nan: must be a finite number, at most 1e12 in magnitude
        platform.mass_kg = -inf: must be a finite number, at most 1e12 in magnitude
        platform.mass_kg = 1e999: must be a finite number, at most 1e12 in magnitude
        platform.mass_kg = 2e12: must be a finite number, at most 1e12 in magnitude
        gravity_m_s2 = [-98.1, 0.0, 98.1]: must be at most 100 long
        gravity_m_s2[2] = inf: must be a finite number, at most 1e12 in magnitude
        home.pose = [0.0, 0.0, 0.0, 1.1, 0.0]: must be an array of 6 numbers
        leg[3].base_m = [0, 1, 2, 3]: must be an array of 3 numbers
        leg[3].base_m[1] = "0": must be a finite number
        cylinder.center_of_mass_m = -0.15: must be at least 0
        actuator.max_force_n = 0: must be greater than 0
        actuator.max_rate_m_s = 0: must be greater than 0
        actuator.reflected_mass_kg = -1e-3: must be at least 0
        actuator.viscous_friction_n_s_m = -1e-3: must be at least 0
        actuator.coulomb_friction_n = -1e-3: must be at least 0
        actuator.friction_uncertainty_n = -1e-3: must be at least 0
        actuator.load_friction = [0.1, 0.1]: must be a number, or an array of 6 numbers, one per leg
        actuator.load_friction = 1: must be in [0, 0.8]
        platform.mass_kg: missing, must be greater than 0
        gravity_m_s2: missing, must be an array of 3 numbers
        home.pose: missing, must be an array of 6 numbers
        control = 3: must be a table
        cylinder.transverse_inertia_kg_m2 = "thin": must be a number, at least 0
        platform.inertia_kg_m2 = 0.375: must be a table"#;
    refused_each(FRIED, rows.trim().lines());
    let name = "must be a name of 1 to 64 characters, each one of A-Z a-z 0-9 _ -";
    let literals = ["\"\"", "\"a/b\"", "\"two words\"", "\"\u{e9}\"", "7"];
    refused_each(FRIED, literals.map(|literal| format!("name = {literal}: {name}")));
    let long = format!("name = \"{}\"", "x".repeat(65));
    refused("name = \"fried2008\"", &long, &format!("name = \"{}...: {name}", "x".repeat(59)));
    refused("xx = 0.375,", "xx = 0,", "platform.inertia_kg_m2.xx = 0: must be greater than 0");
    let each = FRIED.replace("[home]", "force_scale = [1, 1, 1, 1, 1, 1]\n[home]");
    refused_each(&each, ["actuator.force_scale[6] = 0.4: must be in [0.5, 2]"]);
}

#[test]
fn unknown_keys_are_refused_with_the_known_ones() {
    refused_each(
        FRIED,
        ["actuator.min_lenght_m = 0.85: unknown key, probably min_length_m, must be one of: min_length_m, \
          max_length_m, max_rate_m_s, max_force_n, reflected_mass_kg, viscous_friction_n_s_m, coulomb_friction_n, \
          load_friction, force_scale, friction_uncertainty_n"],
    );
    refused(
        "reference_length_m = 0.83 }",
        "reference_length_m = 0.83, x = 1 }",
        "rod.transverse_inertia_kg_m2.x = 1: unknown key, must be one of: constant_kg_m2, quadratic_kg, \
         reference_length_m",
    );
    let sections = "name, gravity_m_s2, platform, actuator, cylinder, rod, home, leg, frame, realtime, limits, \
                    measured, drive, control, setpoint, timeouts, in_position, operator, plant, envelope";
    let unknown =
        |key: &str, probably: &str| format!("{key}: unknown key,{probably} must be one of: {sections}");
    refused("[home]\n", "[topics]\nx = 1\n\n[home]\n", &unknown("topics", ""));
    refused("[home]\n", "[[legs]]\nx = 1\n\n[home]\n", &unknown("legs", " probably leg,"));
    refused_each(FRIED, [unknown("legs = []", " probably leg,")]);
    let misnamed = messages(&fried_with("[actuator]\n", "[actuators]\n"));
    assert!(misnamed.contains(&unknown("actuators", " probably actuator,")), "{misnamed:#?}");
}

#[test]
fn the_keys_of_what_is_no_table_are_not_missing() {
    let (head, rest) = FRIED.split_once("[platform]").unwrap();
    let (_, rest) = rest.split_once("[cylinder]").unwrap();
    let found = messages(&format!("platform = 3\n{head}[cylinder]{rest}"));
    assert_eq!(found, ["platform = 3: must be a table"]);
}

#[test]
fn legs_are_six() {
    let (machine, _) = FRIED.split_once("[[leg]]").unwrap();
    let legs: Vec<_> = FRIED.split("[[leg]]").skip(1).collect();
    let text = |count: usize| {
        machine.to_owned() + &legs[..count].iter().map(|leg| format!("[[leg]]{leg}")).collect::<String>()
    };
    assert_eq!(messages(&text(6)), [""; 0]);
    assert_eq!(messages(&text(5)), ["leg = 5 sections: must be 6 sections headed [[leg]]"]);
    assert_eq!(messages(&text(1)), ["leg = 1 sections: must be 6 sections headed [[leg]]"]);
    assert_eq!(messages(&text(0)), ["leg: missing, must be 6 sections headed [[leg]]"]);
    let seven = text(6) + "[[leg]]\nbase_m = [0, 0, 0]\nplatform_m = [0, 0, \"\"]\n";
    let joint = "leg[7].platform_m[3] = \"\": must be a finite number";
    assert_eq!(messages(&seven), ["leg = 7 sections: must be 6 sections headed [[leg]]", joint]);
    let number = "leg = 6\n".to_owned() + &text(0);
    assert_eq!(messages(&number), ["leg = 6: must be 6 sections headed [[leg]]"]);
}
