//! Cells that are just accepted as regular: a dense search for a pose beyond the limit or beyond a singular pose.

use hexad::analysis::clearance::Clearance;
use hexad::analysis::region_shape::{PoseCell, RegionShape};
use hexad::model::inverse_jacobian::scaled_wrenches;
use hexad::model::machine::Machine;
use hexad::model::rigid::Pose;
use hexad::model::task::TaskState;

use super::common::{MACHINES, machine};
use super::numbers;

const SHAPE: RegionShape = RegionShape::Box { low: [-1.0; 6], high: [1.0; 6] };

/// The pose of a box at parameters.
fn at(machine: &Machine, parameters: &[f64; 6]) -> Pose {
    TaskState::at_rest(core::array::from_fn(|axis| machine.home[axis] + parameters[axis])).motion().pose
}

/// Inverse of the condition with the sign of the determinant, by LU and not as the code under test.
fn inverse_condition(machine: &Machine, parameters: &[f64; 6], side: f64) -> f64 {
    let wrenches = scaled_wrenches(machine, &at(machine, parameters));
    let inverse = wrenches.try_inverse().map_or(f64::INFINITY, |inverse| inverse.norm());
    (wrenches.determinant() * side).signum() / (wrenches.norm() * inverse)
}

/// The smallest inverse condition over the limit's that a search along a cell's long axes finds.
fn worst(machine: &Machine, cell: &PoseCell, k: u32) -> f64 {
    let side = scaled_wrenches(machine, &at(machine, &cell.middle)).determinant();
    let value = |shares: &[f64; 6]| {
        let parameters = core::array::from_fn(|axis| cell.middle[axis] + shares[axis] * cell.half[axis]);
        inverse_condition(machine, &parameters, side)
    };
    let mut worst = f64::INFINITY;
    for step in -20..=20 {
        let share = f64::from(step) / 20.0;
        worst = worst.min(value(&[share; 6]));
        let mut crossed = [share; 6];
        crossed.iter_mut().step_by(2).for_each(|share| *share = -*share);
        worst = worst.min(value(&crossed));
    }
    for corner in 0..20 {
        worst = worst.min(value(&numbers(k * 20 + corner).map(f64::signum)));
    }
    worst
}

/// A cell of a machine: one, two or six axes, with the size at which it is just accepted, its limit and its worst pose.
fn just_accepted(machine: &Machine, k: u32) -> Option<(PoseCell, f64, f64)> {
    let [a, b, c, x, y, z] = numbers(3 * k);
    let [kind, first, second, strict, scale, _] = numbers(3 * k + 1).map(|x| 0.5 * (x + 1.0));
    let radius = machine.joints.radius;
    let middle = [1.2 * a, 0.8 * b, 1.2 * c, radius * x, radius * y, 0.8 * radius * z];
    let directions = numbers(3 * k + 2);
    let half: [f64; 6] = core::array::from_fn(|axis| {
        let length = if axis < 3 { 1.0 } else { radius };
        let chosen = |number: f64| (number * 6.0) as usize == axis;
        match (kind * 3.0) as u32 {
            0 => f64::from(chosen(first)) * length,
            1 => f64::from(chosen(first) || chosen(second)) * length * (0.3 + directions[axis].abs()),
            _ => directions[axis].abs() * length * scale,
        }
    });
    let cell = |size: f64| PoseCell { middle, half: half.map(|half| half * size) };
    let side = scaled_wrenches(machine, &at(machine, &middle)).determinant();
    let here = 1.0 / inverse_condition(machine, &middle, side);
    let limit = here * (1.0 + 10.0_f64.powf(4.0 * strict - 2.0));
    let clearance = Clearance::new(machine, limit);
    let (mut low, mut high) = (0.0, 3.0);
    for _ in 0..40 {
        let size = 0.5 * (low + high);
        if clearance.is_regular(&SHAPE, &cell(size)) { low = size } else { high = size }
    }
    (low > 0.0 && here < 200.0).then(|| (cell(low), limit, worst(machine, &cell(low), k)))
}

#[test]
fn no_pose_of_a_cell_just_accepted_is_beyond_the_limit() {
    let (mut largest, mut count) = (0.0_f64, 0);
    for name in MACHINES {
        let machine = machine(name);
        for k in 0..2000 {
            let Some((cell, limit, worst)) = just_accepted(&machine, k) else { continue };
            assert!(worst * limit >= 1.0 - 1e-9, "{name} {k}: {cell:?}, {limit}, {}", worst * limit);
            largest = largest.max(1.0 / (worst * limit));
            count += 1;
        }
    }
    println!("{count} cells, condition up to {largest} of the limit");
    assert!(count > 10_000 && largest > 0.98, "{count} cells, {largest}");
}
