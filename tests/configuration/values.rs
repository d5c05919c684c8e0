//! One value at a time: where it goes, and what is said when it is missing, unknown or out of bounds.

use std::path::Path;

use hexad::config::{Config, Violation};

use super::{FRIED, fried_with, refused, violations};

#[test]
fn values_arrive_where_they_belong() {
    let text = fried_with(
        "platform_m = [0.0, 0.321393804843, 0.383022221559]",
        "platform_m = [0.0, 0.321393804843, 0.383022221559]\nuniversal_axis = [0, 3, -4]",
    ) + "[realtime]\nrate_hz = 2_000\ncpu = 0x3\n[timeouts]\nmeasured_ms = 5\n[plant]\nstep_us = 100\n";
    let config = Config::parse(&text, "test.toml").unwrap();
    let machine = &config.machine;
    assert_eq!(machine.gravity.as_slice(), [-9.81, 0.0, 0.0]);
    assert_eq!(machine.platform.inertia.m11, 0.375);
    assert_eq!(machine.rod.transverse_inertia.reference_length, 0.83);
    assert_eq!(machine.cylinder.transverse_inertia.constant, 0.0038);
    assert_eq!(machine.cylinder.transverse_inertia.quadratic, 0.0);
    assert_eq!((machine.actuator.max_rate, machine.actuator.max_force), (2.0, 500.0));
    assert_eq!(machine.home, [0.0, 0.0, 0.0, 1.1, 0.0, 0.0]);
    assert_eq!(machine.joints.triples.unpack(&machine.joints.base[2])[1], 0.704769465589);
    assert_eq!(machine.joints.triples.unpack(&machine.joints.platform[1])[5], 0.321393804843);
    assert_eq!(
        machine.joints.triples.unpack(&machine.joints.universal_axis[1]),
        [0.6, 1.0, 1.0, 1.0, 1.0, 1.0]
    );
    assert_eq!(
        machine.joints.triples.unpack(&machine.joints.universal_axis[2]),
        [-0.8, 0.0, 0.0, 0.0, 0.0, 0.0]
    );
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
    let number = "mass_kg = 3.0";
    refused(number, "mass_kg = -3", "platform.mass_kg = -3: must be greater than 0");
    refused(number, "mass_kg = 0.0", "platform.mass_kg = 0.0: must be greater than 0");
    refused(number, "mass_kg = 1e-300", "platform.mass_kg = 1e-300: must be at least 1e-12");
    refused(number, "mass_kg = \"3\"", "platform.mass_kg = \"3\": must be a number, greater than 0");
    refused(number, "mass_kg = [3.0]", "platform.mass_kg = [3.0]: must be a number, greater than 0");
    for literal in ["nan", "-inf", "1e999", "2e12"] {
        let message =
            format!("platform.mass_kg = {literal}: must be a finite number, at most 1e12 in magnitude");
        refused(number, &format!("mass_kg = {literal}"), &message);
    }
    let name = "must be a name of 1 to 64 characters, each one of A-Z a-z 0-9 _ -";
    for literal in ["\"\"", "\"a/b\"", "\"two words\"", "\"\u{e9}\"", "7"] {
        refused("name = \"fried2008\"", &format!("name = {literal}"), &format!("name = {literal}: {name}"));
    }
    let long = format!("name = \"{}\"", "x".repeat(65));
    refused("name = \"fried2008\"", &long, &format!("name = \"{}...: {name}", "x".repeat(59)));
    refused(
        "gravity_m_s2 = [-9.81, 0.0, 0.0]",
        "gravity_m_s2 = [-98.1, 0.0, 98.1]",
        "gravity_m_s2 = [-98.1, 0.0, 98.1]: must be at most 100 long",
    );
    refused(
        "gravity_m_s2 = [-9.81, 0.0, 0.0]",
        "gravity_m_s2 = [-9.81, inf, 0.0]",
        "gravity_m_s2[2] = inf: must be a finite number, at most 1e12 in magnitude",
    );
    refused(
        "pose = [0.0, 0.0, 0.0, 1.1, 0.0, 0.0]",
        "pose = [0.0, 0.0, 0.0, 1.1, 0.0]",
        "home.pose = [0.0, 0.0, 0.0, 1.1, 0.0]: must be an array of 6 numbers",
    );
    refused(
        "base_m = [0.0, -0.482090707265, 0.574533332339]",
        "base_m = [0, 1, 2, 3]",
        "leg[3].base_m = [0, 1, 2, 3]: must be an array of 3 numbers",
    );
    refused(
        "base_m = [0.0, -0.482090707265, 0.574533332339]",
        "base_m = [\"0\", -0.482090707265, 0.574533332339]",
        "leg[3].base_m[1] = \"0\": must be a finite number",
    );
    refused("max_force_n = 500.0", "max_force_n = 0", "actuator.max_force_n = 0: must be greater than 0");
    refused("max_rate_m_s = 2.0", "max_rate_m_s = 0", "actuator.max_rate_m_s = 0: must be greater than 0");
    for key in ["reflected_mass_kg", "viscous_friction_n_s_m", "coulomb_friction_n", "friction_uncertainty_n"]
    {
        refused(
            "max_force_n = 500.0\n",
            &format!("max_force_n = 500.0\n{key} = -1e-3\n"),
            &format!("actuator.{key} = -1e-3: must be at least 0"),
        );
    }
    refused("xx = 0.375,", "xx = 0,", "platform.inertia_kg_m2.xx = 0: must be greater than 0");
    refused(
        "[cylinder]\nmass_kg = 0.5\ncenter_of_mass_m = 0.15",
        "[cylinder]\nmass_kg = 0.5\ncenter_of_mass_m = -0.15",
        "cylinder.center_of_mass_m = -0.15: must be at least 0",
    );
}

#[test]
fn numbers_of_legs_are_one_or_six() {
    refused(
        "max_force_n = 500.0\n",
        "max_force_n = 500.0\nforce_scale = [1, 1, 1, 1, 1, 0.4]\n",
        "actuator.force_scale[6] = 0.4: must be in [0.5, 2]",
    );
    refused(
        "max_force_n = 500.0\n",
        "max_force_n = 500.0\nload_friction = [0.1, 0.1]\n",
        "actuator.load_friction = [0.1, 0.1]: must be a number, or an array of 6 numbers, one per leg",
    );
    refused(
        "max_force_n = 500.0\n",
        "max_force_n = 500.0\nload_friction = 1\n",
        "actuator.load_friction = 1: must be in [0, 0.8]",
    );
}

#[test]
fn keys_are_refused_when_missing_unknown_or_of_the_wrong_shape() {
    refused("mass_kg = 3.0\n", "", "platform.mass_kg: missing, must be greater than 0");
    refused("gravity_m_s2 = [-9.81, 0.0, 0.0]\n", "", "gravity_m_s2: missing, must be an array of 3 numbers");
    refused(
        "pose = [0.0, 0.0, 0.0, 1.1, 0.0, 0.0]   # alpha, beta, gamma [rad], x, y, z [m]\n",
        "",
        "home.pose: missing, must be an array of 6 numbers",
    );
    refused(
        "min_length_m = 0.85",
        "min_length_m = 0.85\nmin_lenght_m = 0.85",
        "actuator.min_lenght_m = 0.85: unknown key, probably min_length_m, must be one of: min_length_m, \
         max_length_m, max_rate_m_s, max_force_n, reflected_mass_kg, viscous_friction_n_s_m, coulomb_friction_n, \
         load_friction, force_scale, friction_uncertainty_n",
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
    refused("name =", "legs = []\nname =", &unknown("legs = []", " probably leg,"));
    let misnamed = violations(&fried_with("[actuator]\n", "[actuators]\n"));
    let named = misnamed.iter().find(|violation| violation.key == "actuators").unwrap().to_string();
    assert_eq!(named, unknown("actuators", " probably actuator,"));
    refused("name =", "control = 3\nname =", "control = 3: must be a table");
    refused(
        "transverse_inertia_kg_m2 = 0.0038",
        "transverse_inertia_kg_m2 = \"thin\"",
        "cylinder.transverse_inertia_kg_m2 = \"thin\": must be a number, at least 0",
    );
    refused(
        "inertia_kg_m2 = { xx = 0.375, yy = 0.1875, zz = 0.1875 }",
        "inertia_kg_m2 = 0.375",
        "platform.inertia_kg_m2 = 0.375: must be a table",
    );
}

#[test]
fn the_keys_of_what_is_no_table_are_not_missing() {
    let (head, rest) = FRIED.split_once("[platform]").unwrap();
    let (_, rest) = rest.split_once("[cylinder]").unwrap();
    let found = violations(&format!("platform = 3\n{head}[cylinder]{rest}"));
    assert_eq!(found.iter().map(Violation::to_string).collect::<Vec<_>>(), ["platform = 3: must be a table"]);
}

#[test]
fn legs_are_six() {
    let (machine, _) = FRIED.split_once("[[leg]]").unwrap();
    let legs: Vec<_> = FRIED.split("[[leg]]").skip(1).collect();
    let text = |count: usize| {
        machine.to_owned() + &legs[..count].iter().map(|leg| format!("[[leg]]{leg}")).collect::<String>()
    };
    let messages = |text: &str| -> Vec<_> { violations(text).iter().map(Violation::to_string).collect() };
    assert_eq!(messages(&text(6)), [""; 0]);
    assert_eq!(messages(&text(5)), ["leg = 5 sections: must be 6 sections headed [[leg]]"]);
    assert_eq!(messages(&text(1)), ["leg = 1 sections: must be 6 sections headed [[leg]]"]);
    assert_eq!(messages(&text(0)), ["leg: missing, must be 6 sections headed [[leg]]"]);
    let seven = text(6) + "[[leg]]\nbase_m = [0, 0, 0]\nplatform_m = [0, 0, \"\"]\n";
    assert_eq!(
        messages(&seven),
        [
            "leg = 7 sections: must be 6 sections headed [[leg]]",
            "leg[7].platform_m[3] = \"\": must be a finite number"
        ]
    );
    assert_eq!(
        messages(&("leg = 6\n".to_owned() + &text(0))),
        ["leg = 6: must be 6 sections headed [[leg]]"]
    );
}
