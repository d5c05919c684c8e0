//! How near another permitted pose with the same lengths is.

use hexad::analysis::clearance::Clearance;
use hexad::analysis::other_pose_search::{OtherPoseSearch, nearest_permitted};
use hexad_support::stability::trials::rigid;

use super::command::said;
use super::*;

fn search(machine: &Machine, count: usize) -> OtherPoseSearch {
    OtherPoseSearch::new(machine, &Clearance::new(machine, 80.0), count)
}

/// The poses reach the edge of the region, for strokes of all sizes; a longer search goes on where a shorter one ends.
#[test]
fn the_usable_region_is_searched_to_its_edge() {
    for (name, reach_deg) in [("fried2008", 29.0..30.0), ("piezo", 0.03..1.0), ("telescope", 2.0..10.0)] {
        let found = search(&machine(name), 200);
        let reach = found.largest_rotation_rad.to_degrees();
        assert!(reach_deg.contains(&reach) && found.nearest.is_none(), "{name}: {found:?}");
    }
    let tsai = machine("tsai2000");
    let [short, long] = [100, 300].map(|count| search(&tsai, count));
    assert!(0 < short.ambiguous_poses && short.ambiguous_poses < long.ambiguous_poses, "{short:?} {long:?}");
    assert!(long.ambiguous_from_rad <= short.ambiguous_from_rad && long.at_home.is_none(), "{long:?}");
    let words = search(&tsai.with_stroke_margin(tsai.actuator.stroke()), 200).to_string();
    assert!(words.ends_with("none found up to 0 deg (searched, 1 poses)"), "home is not usable: {words}");
    let words = search(&Machine { max_rotation_rad: FRAC_PI_2, ..tsai }, 300).to_string();
    assert!(words.starts_with("at home 48.7 deg and 1.14 m away; in the usable region from "), "{words}");
    assert!(words.contains("some starts are ambiguous from 0 deg of rotation of home on (searched, "));
}

#[test]
fn poses_with_another_permitted_pose_are_counted_and_hatched() {
    for (name, plane, has_some) in [("tsai2000", "x-z", true), ("fried2008", "y-x", false)] {
        let (folder, config) = (TempDir::new().unwrap(), deployed(name));
        let text = said(name, folder.path(), &["--json", "--resolution", "21", "--plane", plane]);
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        let machine = config.machine.with_stroke_margin(config.deployment.limits.stroke_margin_m);
        let clearance = Clearance::new(&machine, report["condition_limit"].as_f64().unwrap());
        let table = Table::read(&folder.path().join(format!("{plane}.csv")));
        let poses = (0..table.rows.len()).map(|row| rigid(table.coordinates(row, "").into()));
        let usable: Vec<_> = poses.filter(|pose| clearance.violation_at(pose).is_none()).collect();
        let ambiguous = usable.iter().filter_map(|pose| nearest_permitted(&machine, pose)).count();
        let slice = &report["slices"][0];
        assert_eq!([&slice["searched"], &slice["ambiguous"]], [usable.len(), ambiguous], "{name}");
        assert_eq!((ambiguous > 0, &report["other_pose_search"]["poses"]), (has_some, &1000.into()));
        let svg = fs::read_to_string(folder.path().join(format!("{plane}.svg"))).unwrap();
        assert_eq!(svg.contains("another permitted pose, same lengths"), has_some, "{name}");
    }
}
