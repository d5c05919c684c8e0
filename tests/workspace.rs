//! What a pose is worth, against brute force; regions without obstacle, against poses in and around them; the command.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod command;
mod forces;
mod gravity_cone;
mod other_poses;
mod regions;

use hexad::analysis::pose_quality::{AccelerationDemand, PoseEvaluator};

use crate::*;

/// Numbers in -1..1, six of the k-th even point.
fn numbers(k: u32) -> [f64; 6] {
    let shares = MotionEnvelope::spread(k);
    core::array::from_fn(|axis| 2.0 * shares[axis] - 1.0)
}

/// Two directions, evenly over both spheres.
fn directions(k: u32) -> [Vector3<f64>; 2] {
    let shares = MotionEnvelope::spread(k);
    [0, 2].map(|first| {
        let (z, angle) = (2.0 * shares[first] - 1.0, TAU * shares[first + 1]);
        let radius = (1.0 - z * z).sqrt();
        Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
    })
}

/// X beside home: up to so many radians and radii.
fn beside_home(machine: &Machine, k: u32, size: f64) -> [f64; 6] {
    let shift = size * machine.joints.radius_m;
    let scales = [size, size, size, shift, shift, shift];
    let offsets = numbers(k);
    core::array::from_fn(|axis| machine.home[axis] + scales[axis] * offsets[axis])
}
