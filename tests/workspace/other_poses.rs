//! How near another permitted pose with the same lengths is, by other ways to the same numbers.

use hexad::analysis::assembly_modes::other_permitted_modes;
use hexad::analysis::clearance::Clearance;
use hexad::analysis::other_pose_search::OtherPoseSearch;

use hexad_support::stability::trials::rigid;

use super::command::said;
use super::*;

fn search(machine: &Machine, count: usize) -> OtherPoseSearch {
    OtherPoseSearch::new(machine, &Clearance::new(machine, 80.0), count)
}

#[test]
fn a_longer_search_goes_on_where_a_shorter_one_ends() {
    let machine = machine("tsai2000");
    let [short, long] = [100, 300].map(|count| search(&machine, count));
    assert_eq!((short.poses, long.poses), (100, 300));
    assert!(0 < short.ambiguous_poses && short.ambiguous_poses < long.ambiguous_poses, "{short:?} {long:?}");
    assert!(long.ambiguous_from_rad <= short.ambiguous_from_rad && long.at_home.is_none());
    assert!(long.nearest.unwrap().rotation_rad > 0.05, "{long:?}");
    // With a larger permitted rotation each pose takes longer, so they are fewer.
    let wide = search(&Machine { max_rotation: FRAC_PI_2, ..machine }, 300);
    assert!(wide.poses == 33 && wide.at_home.is_some() && wide.ambiguous_from_rad == Some(0.0), "{wide:?}");
    let words = wide.to_string();
    assert!(words.starts_with("at home 48.7 deg and 1.14 m away; in the usable region from "), "{words}");
    assert!(words.contains("starts are ambiguous from 0 deg of rotation of home on (searched, "), "{words}");
}

/// Strokes of all sizes: the walk reaches what the joints permit, or what the stroke does.
#[test]
fn the_searched_poses_reach_the_edge_of_the_region() {
    for (name, least_deg, most_deg) in
        [("fried2008", 29.0, 30.0), ("piezo", 0.03, 1.0), ("telescope", 2.0, 10.0)]
    {
        let machine = machine(name);
        let found = search(&machine, 200);
        let reach = found.largest_rotation_rad.to_degrees();
        assert!((least_deg..=most_deg).contains(&reach) && found.nearest.is_none(), "{name}: {found:?}");
        assert!(found.to_string().starts_with("at home none (proved); in the usable region none found up to "));
        // Home alone, if it is not usable.
        assert_eq!(search(&machine.within_margin(machine.actuator.stroke()), 200).poses, 1);
    }
}

#[test]
fn poses_with_another_permitted_pose_are_counted_and_hatched() {
    for (name, plane, has_some) in [("tsai2000", "x-z", true), ("fried2008", "y-x", false)] {
        let (folder, config) = (TempDir::new().unwrap(), deployed(name));
        let text = said(name, folder.path(), &["--json", "--resolution", "21", "--plane", plane]);
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        let machine = config.machine.within_margin(config.deployment.limits.stroke_margin_m);
        let clearance = Clearance::new(&machine, report["condition_limit"].as_f64().unwrap());
        let table = Table::read(&folder.path().join(plane).with_extension("csv"));
        let poses = (0..table.rows.len()).map(|row| rigid(table.coordinates(row, "").into()));
        let usable: Vec<_> = poses.filter(|pose| clearance.violation_at(pose).is_none()).collect();
        let others = |pose: &&Pose| {
            !other_permitted_modes(&machine, &KinematicState::new(&machine, **pose)).poses.is_empty()
        };
        let ambiguous = usable.iter().filter(others).count();
        let slice = &report["slices"][0];
        assert_eq!([&slice["searched"], &slice["ambiguous"]], [usable.len(), ambiguous], "{name}");
        assert_eq!(
            (ambiguous > 0, &report["other_pose_search"]["poses"]),
            (has_some, &1000.into()),
            "{name}"
        );
        let svg = fs::read_to_string(folder.path().join(plane).with_extension("svg")).unwrap();
        assert_eq!(svg.contains("another permitted pose, same lengths"), has_some, "{name}");
    }
}
