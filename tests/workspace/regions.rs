//! Regions that are said to be without obstacle have none, and hardly larger ones have one.

use hexad::analysis::clearance::{Clearance, WorkspaceLimit};
use hexad::analysis::reachable_envelope::nominal_bounds;
use hexad::analysis::region_search::{RegionBounds, largest_region};
use hexad::analysis::region_shape::{PoseCell, RegionShape};
use indicatif::ProgressBar;
use rayon::prelude::*;

use super::*;

const SAMPLES: u32 = 50_000;
const TURN: f64 = 0.17;

fn found(config: &Config, shape: &RegionShape) -> RegionBounds {
    let condition = config.deployment.limits.condition;
    let clearance = Clearance::new(&config.machine, condition);
    largest_region(&config.machine, &clearance, shape, &ProgressBar::hidden())
}

/// How far from the nearest end of a stroke, and what is said of a pose by singular values and a determinant of LU.
fn margin(machine: &Machine, pose: &Pose) -> f64 {
    let actuator = &machine.actuator;
    let lengths = leg_lengths(machine, pose);
    lengths
        .iter()
        .map(|l| (l - actuator.min_length_m).min(actuator.max_length_m - l))
        .fold(f64::INFINITY, f64::min)
}

fn is_fine(config: &Config, pose: &Pose) -> bool {
    let machine = &config.machine;
    let home = machine.home_pose();
    let [here, there] = [pose, &home].map(|pose| scaled_wrenches(machine, pose));
    let values = here.singular_values();
    let inverse = values.iter().map(|value| value.powi(-2)).sum::<f64>().sqrt();
    margin(machine, pose) >= -1e-12
        && here.determinant() * there.determinant() > 0.0
        && here.norm() * inverse <= config.deployment.limits.condition * (1.0 + 1e-9)
}

/// A pose of the ball: the k-th; half of them on its edge.
fn of_ball(machine: &Machine, k: u32, radius: f64, turn: f64) -> Pose {
    let [axis, way] = directions(k);
    let [a, b, ..] = numbers(k + SAMPLES);
    let share = |x: f64| if k.is_multiple_of(2) { 1.0 } else { x.abs().cbrt() };
    let home = machine.home_pose();
    Pose {
        rotation: exp(&(axis * turn * share(a))) * home.rotation,
        position: home.position + way * radius * share(b),
    }
}

/// A pose of the box: first all corners, then some inside.
fn of_box(machine: &Machine, k: u32, size: f64) -> Pose {
    let high = nominal_bounds(machine).pose_max;
    let corner = |axis: usize| if k >> axis & 1 == 0 { -1.0 } else { 1.0 };
    let share = |axis| if k < 64 { corner(axis) } else { numbers(k)[axis] };
    let x = core::array::from_fn(|axis| machine.home[axis] + size * high[axis] * share(axis));
    TaskState::at_rest(x).motion().pose
}

#[test]
#[ignore = "second tier: takes long"]
fn balls_and_boxes_have_no_obstacle_and_larger_ones_do() {
    for name in ["fried2008", "motion_base", "tsai2000", "reference"] {
        let config = deployed(name);
        let machine = &config.machine;
        for turn_rad in [0.0, TURN] {
            let found = found(&config, &RegionShape::Ball { turn_rad });
            assert!(found.guaranteed > 0.1 * machine.joints.radius_m, "{name}: {found:?}");
            let bad =
                (0..SAMPLES).find(|k| !is_fine(&config, &of_ball(machine, *k, found.guaranteed, turn_rad)));
            assert_eq!(bad, None, "{name}: {found:?}");
            // C comes as far along a leg as that leg has stroke left: that is the ball of an orientation.
            let (size, obstacle) = found.violation.unwrap();
            let least = (0..SAMPLES).map(|k| margin(machine, &of_ball(machine, 2 * k, 0.0, turn_rad)));
            let least = least.fold(f64::INFINITY, f64::min);
            match obstacle {
                WorkspaceLimit::LegTooShort(_) | WorkspaceLimit::LegTooLong(_) => {
                    assert!(size <= least * (1.0 + 1e-9) && size > 0.98 * least, "{name}: {least}");
                }
                _ => assert!(size < least, "{name}: {found:?}, {least}"),
            }
        }
        let high = nominal_bounds(machine).pose_max;
        let found = found(&config, &RegionShape::Box { low: high.map(|x| -x), high });
        let fine = |size: f64| (0..SAMPLES).find(|k| !is_fine(&config, &of_box(machine, *k, size)));
        assert_eq!(fine(found.guaranteed), None, "{name}: {found:?}");
        assert!(fine(1.02 * found.violation.unwrap().0).is_some(), "{name}: {found:?}");
    }
}

/// Within the stroke the bounds end next to what is in the way. (Where the condition is, they end earlier.)
#[test]
fn what_is_guaranteed_is_near_to_what_is_in_the_way() {
    for name in ["fried2008", "motion_base", "reference"] {
        let config = deployed(name);
        let high = nominal_bounds(&config.machine).pose_max;
        let shapes = [
            RegionShape::Ball { turn_rad: 0.0 },
            RegionShape::Ball { turn_rad: TURN },
            RegionShape::Box { low: high.map(|x| -x), high },
        ];
        for shape in shapes {
            let found = found(&config, &shape);
            let (size, _) = found.violation.unwrap();
            assert!(found.guaranteed <= size && found.guaranteed > 0.95 * size, "{name}: {found:?}");
        }
    }
}

/// A stroke of 25 mm has no room for ten degrees.
#[test]
fn a_turn_that_home_has_no_room_for_has_no_ball() {
    let config = Config::load(&data("telescope", "toml")).unwrap();
    let none = found(&config, &RegionShape::Ball { turn_rad: TURN });
    let (size, obstacle) = none.violation.unwrap();
    assert!(none.guaranteed == 0.0 && size <= 0.0, "{none:?}");
    assert!(matches!(obstacle, WorkspaceLimit::LegTooShort(_) | WorkspaceLimit::LegTooLong(_)), "{none:?}");
}

/// Fichter: a quarter turn about the vertical makes this layout singular, whatever its size. A surface without
/// thickness: no sample meets it.
#[test]
fn a_singular_surface_between_samples_is_found() {
    let text = fs::read_to_string(data("motion_base", "toml")).unwrap();
    let text = text
        .replace("pose = [0.0, 0.0, 0.0,", &format!("pose = [0.0, 0.0, {},", 80_f64.to_radians()))
        .replace("max_force_n = 20000.0", "max_force_n = 2e9")
        .replace("min_length_m = 1.1\nmax_length_m = 2.3", "min_length_m = 0.5\nmax_length_m = 4.0");
    let config = Config::parse(&(text + "\n[limits]\ncondition = 1e6\n"), "turned.toml").unwrap();
    let mut high = [0.0; 6];
    high[2] = 1_f64.to_radians();
    let found = found(&config, &RegionShape::Box { low: high.map(|x| -x), high });
    let (size, obstacle) = found.violation.unwrap();
    assert!(matches!(obstacle, WorkspaceLimit::Singular | WorkspaceLimit::Condition), "{found:?}");
    assert!((size - 10.0).abs() < 1e-2, "{found:?}");
    assert!(found.guaranteed > 9.9 && found.guaranteed < 10.0, "{found:?}");
    // The proof itself: poses beyond it would be met by their sign, those of a cell that it cuts by nothing else.
    let clearance = Clearance::new(&config.machine, 1e6);
    let proved = |angle: f64, half: f64| {
        let mut cell = PoseCell { middle: [0.0; 6], half: [0.0; 6] };
        (cell.middle[2], cell.half[2]) = (10_f64.to_radians() + angle, half);
        clearance.is_regular(&RegionShape::Box { low: high.map(|x| -x), high }, &cell)
    };
    for half in [1e-1, 1e-2, 1e-3, 1e-4] {
        for share in [-0.99, -0.4, 0.1, 0.7, 0.99] {
            assert!(!proved(share * half, half), "{half} {share}");
        }
        assert!(proved(-10.0 * half.min(0.02), half.min(0.02)), "{half}: not proved where nothing is");
    }
}

/// A pose of a cell by numbers in -1..1, multiplied out without the code under test.
fn of_cell(machine: &Machine, shape: &RegionShape, cell: &PoseCell, numbers: &[f64; 6]) -> Pose {
    let p: [f64; 6] = core::array::from_fn(|axis| cell.middle[axis] + cell.half[axis] * numbers[axis]);
    let home = machine.home_pose();
    let [alpha, beta, gamma, ..] = machine.home;
    let rotation = match shape {
        RegionShape::Ball { .. } => rotation(p[0], p[1], p[2]) * home.rotation,
        RegionShape::Box { .. } => rotation(alpha + p[0], beta + p[1], gamma + p[2]),
    };
    Pose { rotation, position: home.position + Vector3::new(p[3], p[4], p[5]) }
}

/// The bounds themselves, at their sharpest: the smallest limit of the condition that a cell of one, two or six axes is proved to keep,
/// and its least margin, against poses of the cell, all corners among them. How many cells are proved, and the sharpest.
fn sharpest(names: &[&str], cells: u32, reach: f64, poses: u32) -> (u32, f64) {
    let (mut proved, mut sharpness) = (0, 0.0_f64);
    for name in names {
        let machine = &if *name == "reference" { deployed(name).machine } else { machine(name) };
        let radius = machine.joints.radius_m;
        let shapes =
            [RegionShape::Ball { turn_rad: 1.0 }, RegionShape::Box { low: [-1.0; 6], high: [1.0; 6] }];
        for (k, shape) in (0..cells).flat_map(|k| shapes.iter().map(move |shape| (k, shape))) {
            let scales = [0.3, 0.3, 0.3, 0.2 * radius, 0.2 * radius, 0.2 * radius];
            let (place, size) = (numbers(k), numbers(k + cells));
            let share = reach * 0.6_f64.powi(k as i32 % 12);
            let is_long = |axis: usize| match k % 3 {
                0 => true,
                1 => axis == k as usize / 3 % 6,
                _ => axis == k as usize / 3 % 6 || axis == k as usize / 18 % 6,
            };
            let cell = PoseCell {
                middle: core::array::from_fn(|axis| reach * scales[axis] * place[axis]),
                half: core::array::from_fn(|axis| {
                    f64::from(u8::from(is_long(axis))) * share * scales[axis] * size[axis].abs()
                }),
            };
            let sign = scaled_wrenches(machine, &of_cell(machine, shape, &cell, &[0.0; 6])).determinant();
            let (mut low, mut high) = (6.0_f64, 1e4_f64);
            for _ in 0..40 {
                let limit = (low * high).sqrt();
                let keeps = Clearance::new(machine, limit).is_regular(shape, &cell);
                (low, high) = if keeps { (low, limit) } else { (limit, high) };
            }
            let least = Clearance::new(machine, 100.0).least_stroke_margin(shape, &cell);
            let mut worst = 0.0_f64;
            for j in 0..poses {
                let corner: [f64; 6] =
                    core::array::from_fn(|axis| if j >> axis & 1 == 0 { -1.0 } else { 1.0 });
                let pose = of_cell(machine, shape, &cell, &if j < 64 { corner } else { numbers(j) });
                assert!(margin(machine, &pose) >= least - 1e-12, "{name}, cell {k}: {least}");
                let wrenches = scaled_wrenches(machine, &pose);
                let inverse = wrenches.try_inverse().map_or(f64::INFINITY, |inverse| inverse.norm());
                worst = worst.max(wrenches.norm() * inverse);
                assert!(high > 9e3 || worst <= high * (1.0 + 1e-9), "{name}, cell {k}: {worst} over {high}");
                assert!(high > 9e3 || sign * wrenches.determinant() > 0.0, "{name}, cell {k}");
            }
            if high < 9e3 {
                proved += 1;
                sharpness = sharpness.max(worst / high);
            }
        }
    }
    (proved, sharpness)
}

#[test]
fn no_pose_of_a_cell_is_beyond_its_bounds() {
    let (proved, sharpness) = sharpest(&["fried2008", "motion_base", "tsai2000", "reference"], 60, 1.0, 2000);
    assert!(proved > 200 && sharpness > 0.9, "{proved}, {sharpness}");
}

#[test]
#[ignore = "second tier: takes long"]
fn no_pose_of_many_cells_is_beyond_their_bounds() {
    let found = MACHINES.into_par_iter().map(|name| sharpest(&[name], 1500, 3.0, 200));
    let (proved, sharpness) = found.reduce(|| (0, 0.0), |a, b| (a.0 + b.0, a.1.max(b.1)));
    assert!(proved > 10_000 && sharpness > 0.98, "{proved}, {sharpness}");
}
