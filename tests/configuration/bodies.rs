//! Machines that cannot exist: inertia, stroke, joints, home.

use std::f64::consts::{FRAC_PI_3, FRAC_PI_6};

use hexad::config::Config;
use nalgebra::Vector3;

use super::{FRIED, SIX_THREE, fried_with, messages, refused, refused_each, violations};

#[test]
fn bodies_must_be_possible() {
    let inertia = "inertia_kg_m2 = { xx = 0.375, yy = 0.1875, zz = 0.1875 }";
    let tensor = |t: &str| format!("inertia_kg_m2 = {t}");
    refused(
        inertia,
        &tensor("{ xx = 0.38, yy = 0.1875, zz = 0.1875 }"),
        "platform.inertia_kg_m2 = principal moments [0.1875, 0.1875, 0.38]: the greatest must be at most the \
         sum of the others",
    );
    refused(
        inertia,
        &tensor("{ xx = 2, yy = 2, zz = 2, xy = 3 }"),
        "platform.inertia_kg_m2 = principal moments [-1.0, 2.0, 5.0]: must all be greater than 0",
    );
    assert_eq!(violations(&fried_with(inertia, &tensor("{ xx = 2, yy = 2, zz = 2, xy = -1 }"))), []);
    // A thin rod along the leg: as much as nothing about its axis, and a disc: twice as much as across.
    let cylinder = "axial_inertia_kg_m2 = 0.0002\ntransverse_inertia_kg_m2 = 0.0038";
    let with = |axial: f64, transverse: &str| {
        format!("axial_inertia_kg_m2 = {axial}\ntransverse_inertia_kg_m2 = {transverse}")
    };
    for (axial, transverse) in [(0.0, "0"), (0.0, "0.1"), (0.2, "0.1")] {
        assert_eq!(violations(&fried_with(cylinder, &with(axial, transverse))), []);
    }
    let refused_inertia = |axial: f64, transverse: &str, least: &str, bound: &str| {
        let message = format!(
            "cylinder.transverse_inertia_kg_m2 = {least} at its least over the stroke: must be at least {bound} \
             (half of axial_inertia_kg_m2)"
        );
        refused(cylinder, &with(axial, transverse), &message);
    };
    refused_inertia(0.2, "0.0999", "0.0999", "0.1");
    refused_inertia(0.2, "0", "0", "0.1");
    // The least is at the reference length if that is within the stroke [0.85, 1.6], else at an end.
    let at = |c: f64, q: f64, l: f64| {
        format!("{{ constant_kg_m2 = {c}, quadratic_kg = {q}, reference_length_m = {l} }}")
    };
    refused_inertia(0.2, &at(0.05, 1.0, 1.2), "0.05", "0.1");
    refused_inertia(0.2, &at(0.05, 1.0, 0.65), "0.09", "0.1");
    refused_inertia(0.2, &at(1.05, -1.0, 0.6), "0.05", "0.1");
    refused_inertia(0.2, &at(1.05, -1.0, 1.85), "0.05", "0.1");
    refused_inertia(0.0, &at(-0.1, 1.0, 0.65), "-0.06", "0");
    assert_eq!(violations(&fried_with(cylinder, &with(0.2, &at(0.05, 1.0, 0.6)))), []);
}

#[test]
fn the_geometry_must_hold_the_platform() {
    refused(
        "min_length_m = 0.85\nmax_length_m = 1.6",
        "min_length_m = 1.6\nmax_length_m = 1.6",
        "actuator.max_length_m = 1.6: must be greater than 1.6 (actuator.min_length_m)",
    );
    let stroke = "must be in [0.85, 1.6] (actuator.min_length_m, actuator.max_length_m)";
    for (base, message) in [
        ("[-1.0, -0.482090707265, 0.574533332339]", &format!("2.15591 m long at home: {stroke}")),
        ("[0.5, -0.482090707265, 0.574533332339]", &format!("0.773283 m long at home: {stroke}")),
        (
            "[1.1, -0.492403876506, 0.086824088833]",
            &"0.0 m long at home: base_m and platform_m must not coincide at home".to_owned(),
        ),
    ] {
        let old = "base_m = [0.0, -0.482090707265, 0.574533332339]";
        refused(old, &format!("base_m = {base}"), &format!("leg[3] = {message}"));
    }
    let axis = |axis: &str| {
        format!("[[leg]]\nuniversal_axis = {axis}\nbase_m = [0.0, 0.738605814759, 0.13023613325]")
    };
    let leg = "[[leg]]\nbase_m = [0.0, 0.738605814759, 0.13023613325]";
    refused_each(FRIED, ["leg[1].universal_axis = [0, 0, 0]: must not be zero: it is a direction"]);
    refused(
        leg,
        &axis("[11.0, -4.17212, 2.53]"),
        "leg[1].universal_axis = 0.000173796 rad from the leg at home: must be at least 0.001 rad from it",
    );
    assert_eq!(violations(&fried_with(leg, &axis("[11.0, -4.2, 2.53]"))), []);
    // However long it is, it is a direction: squares of these are no numbers.
    for (short, unit) in [("[0, 3e-170, -4e-170]", [0.0, 0.6, -0.8]), ("[0, 5e-324, 0]", [0.0, 1.0, 0.0])] {
        let machine = Config::parse(&fried_with(leg, &axis(short)), "test.toml").unwrap().machine;
        let read = machine.joints.triples.unpack_vectors(&machine.joints.universal_axis)[0];
        assert!((read - Vector3::from(unit)).norm() < 1e-9, "{short}: {read}");
    }
}

/// The only message, which begins like this.
fn only(text: &str, start: &str) -> String {
    let found = messages(text);
    assert!(found.len() == 1 && found[0].starts_with(start), "{found:#?}");
    found[0].clone()
}

/// A machine from twelve points, with a stroke for every length.
fn machine_with(base: [[f64; 3]; 6], platform: [[f64; 3]; 6]) -> String {
    let (head, _) = FRIED.split_once("[[leg]]").unwrap();
    head.replace("max_length_m = 1.6", "max_length_m = 16") + &legs(base, platform)
}

fn legs(base: [[f64; 3]; 6], platform: [[f64; 3]; 6]) -> String {
    base.iter()
        .zip(&platform)
        .map(|(b, p)| format!("[[leg]]\nbase_m = {b:?}\nplatform_m = {p:?}\n"))
        .collect()
}

#[test]
fn singular_machines_are_refused() {
    let ring = |radius: f64, phase: f64| -> [[f64; 3]; 6] {
        std::array::from_fn(|i| {
            let angle = phase + i as f64 * FRAC_PI_3;
            [0.0, radius * angle.cos(), radius * angle.sin()]
        })
    };
    let line: [[f64; 3]; 6] = std::array::from_fn(|i| [0.0, i as f64 * 0.1, i as f64 * 0.3]);
    let point = [[0.1; 3]; 6];
    let only = |text: String, start: &str, end: &str| {
        let message = only(&text, start);
        assert!(message.ends_with(end), "{message}");
    };
    let bound = "of the radius: no leg resists a turn about it";
    only(machine_with(ring(0.7, 0.0), line), "leg[1].platform_m = on one line with all others", bound);
    only(machine_with(line, ring(0.5, 0.2)), "leg[1].base_m = on one line with all others", bound);
    only(machine_with(ring(0.7, 0.0), point), "leg[1].platform_m = on one line with all others", bound);
    let within = machine_with(ring(0.7, 0.0), ring(1e-7, 0.2));
    only(within, "leg[1].platform_m = one of six within 1e-7 m", "must be within at least 1e-6 m (RMS)");
    // Regular hexagons at any angle to each other, and similar semi-regular ones: all the legs belong to one linear
    // complex wherever the platform goes.
    let semi = |radius: f64, phase: f64| -> [[f64; 3]; 6] {
        std::array::from_fn(|i| {
            let angle = phase + (i / 2) as f64 * 2.0 * FRAC_PI_3 + (i % 2) as f64 * 0.6;
            [0.0, radius * angle.cos(), radius * angle.sin()]
        })
    };
    let everywhere = "at best around home: joints laid out like this are singular everywhere";
    for platform in [ring(0.5, 0.0), ring(0.5, FRAC_PI_6), ring(0.5, 0.3), ring(0.5, 1e-5)] {
        only(machine_with(ring(0.7, 0.0), platform), "leg[1] = condition number ", everywhere);
    }
    for platform in [semi(0.5, 0.0), semi(0.5, 0.3), semi(0.5, 0.3 + 1e-6)] {
        only(machine_with(semi(0.7, 0.0), platform), "leg[1] = condition number ", everywhere);
    }
    // A semi-regular hexagon that is not similar will do.
    let other = std::array::from_fn(|i| semi(0.5, FRAC_PI_3)[(i + 5) % 6]);
    assert_eq!(violations(&machine_with(semi(0.7, 0.0), other)), []);
}

#[test]
fn two_legs_may_share_one_joint_centre_and_not_both() {
    let shared =
        SIX_THREE.replace("platform_m = [0.2656586, -0.1240536, 0.0]", "platform_m = [0.0254, 0.2921, 0.0]");
    let found = violations(&shared);
    let [violation] = found.as_slice() else { panic!("{found:#?}") };
    assert_eq!(
        violation.to_string(),
        "leg[3] = 0.0 m from the base joint of leg[2], 0.0 m from its platform joint: must be at least 1e-6 of the joints' \
         radius from one of them: legs may share one joint centre, not both"
    );
    assert_eq!(violation.line, 1 + shared.lines().position(|line| line == "[[leg]]").unwrap() + 2 * 3);
    // A 6-3 machine, the same with its sides exchanged, and a 3-3 machine.
    let points = |key: &str| -> [[f64; 3]; 6] {
        let table: toml::Table = SIX_THREE.parse().unwrap();
        let point = |leg: usize| table["leg"][leg][key].clone().try_into().unwrap();
        std::array::from_fn(point)
    };
    let [base, platform] = ["base_m", "platform_m"].map(points);
    let corners = std::array::from_fn(|leg| platform[leg / 2 * 2]);
    for joints in [(base, platform), (platform, base), (base, corners)] {
        let text = SIX_THREE.split_once("[[leg]]").unwrap().0.to_owned() + &legs(joints.0, joints.1);
        let found = Config::parse(&text, "test.toml").unwrap().examine();
        assert_eq!((found.errors, found.warnings), (vec![], vec![]));
    }
}

/// The order is alpha, beta, gamma, x, y, z; the other one puts the platform where no leg reaches.
#[test]
fn angles_after_positions_are_named() {
    refused(
        "pose = [0.0, 0.0, 0.0, 1.1, 0.0, 0.0]",
        "pose = [1.1, 0.0, 0.0, 0.0, 0.0, 0.0]",
        "home.pose = [1.1, 0.0, 0.0, 0.0, 0.0, 0.0]: must be alpha, beta, gamma [rad], then x, y, z [m]: at [0.0, 0.0, 0.0, 1.1, \
         0.0, 0.0] every leg is within its stroke",
    );
}

/// The machine is sound, its home is not.
#[test]
fn singular_homes_are_refused() {
    let home = "pose = [0.0, 0.0, 0.0, 1.1, 0.0, 0.0]";
    let stroke = "min_length_m = 0.85\nmax_length_m = 1.6";
    let at = |pose: &str| {
        fried_with(home, pose)
            .replace(stroke, "min_length_m = 0.16\nmax_length_m = 16.0")
            .replace("axial_inertia_kg_m2 = 0.0013", "axial_inertia_kg_m2 = 0.001")
    };
    // Fichter's: turned by a quarter about the vertical; and all legs in one plane.
    for pose in ["pose = [1.5707963267948966, 0, 0, 1.1, 0, 0]", "pose = [0, 0, 0, 1e-9, 0, 0]"] {
        let message = only(&at(pose), "home.pose = condition number ");
        let (_, best) = message.rsplit_once("poses around it have ").unwrap();
        assert!(best.trim_end_matches(" at best").parse::<f64>().unwrap() < 100.0, "{message}");
    }
    let tilted = at("pose = [1.3, 0, 0, 1.1, 0, 0]");
    assert_eq!(violations(&tilted), []);
    let warnings = Config::parse(&tilted, "test.toml").unwrap().examine().warnings;
    assert!(warnings.iter().all(|warning| warning.key != "home.pose"), "{warnings:#?}");
}
