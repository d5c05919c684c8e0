//! Examination of `[envelope]`: stroke, singular poses and condition by proof, forces at sample poses.

use super::Examiner;
use super::machine::examine_holding;
use crate::analysis::clearance::{Clearance, WorkspaceLimit};
use crate::analysis::envelope::{CORNER_COUNT, EnvelopeBounds, MotionEnvelope};
use crate::analysis::region_proof::{RegionProof, poses, prove};
use crate::config::machine::rounded;
use crate::text::numbers::{AXES, axis_unit, significant};
use hexad_core::control::constants::MAX_HOLDING_SHARE;
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::inverse_dynamics;
use hexad_core::model::fidelity::Exact;
use hexad_core::model::inverse_geometry::leg_motion;
use hexad_core::model::task::TaskState;

pub(super) fn examine(examiner: &mut Examiner) {
    let config = examiner.config;
    let Some(bounds) = &config.deployment.envelope else { return };
    let limits = &config.deployment.limits;
    let reachable = config.machine.with_stroke_margin(limits.stroke_margin_m);
    let clearance = Clearance::new(&reachable, limits.condition).in_cone(examiner.cone_rad);
    match prove(&reachable, &clearance, bounds) {
        RegionProof::Clear => examine_forces(examiner, bounds),
        RegionProof::Violated(offsets, WorkspaceLimit::HoldingForce(_)) => {
            let x: [f64; 6] =
                (nalgebra::Vector6::from(config.machine.home) + nalgebra::Vector6::from(offsets)).into();
            let pose = TaskState::at_rest(x).motion().pose;
            let Some((leg, force)) = examiner.largest_holding_force(&pose) else { return };
            let place = format!("within [envelope] {}", offset_text(&offsets));
            examine_holding(examiner, leg, force, &place);
        }
        RegionProof::Violated(offsets, limit) => {
            examiner.error("envelope", offset_text(&offsets), limit_text(limit, limits.condition));
        }
        RegionProof::Open(cells) => {
            let bound = "no pose beyond a limit was found, and no proof that there is none: shrink it by a hundredth or two";
            examiner.warn("envelope", format!("examined in {cells} cells"), bound);
            examine_forces(examiner, bounds);
        }
    }
}

/// Compares the drives with the forces at rest at corners and spread poses, and with those and the leg rates of the corners in
/// motion. Between samples of a box without singular poses forces vary slowly; the margin covers it.
fn examine_forces(examiner: &mut Examiner, bounds: &EnvelopeBounds) {
    let machine = &examiner.config.machine;
    let states = poses(machine, bounds).map(|state| state.x.into());
    let Some(held) = examiner.gravity().worst_holding(machine, states) else { return };
    if held.force_ratio > MAX_HOLDING_SHARE {
        let mut offsets = held.pose;
        offsets.iter_mut().zip(machine.home).for_each(|(x, home)| *x -= home);
        let place = format!("within [envelope] {}", offset_text(&offsets));
        examine_holding(examiner, held.leg - 1, held.force_n, &place);
        return;
    }
    examine_motion(examiner, bounds);
}

fn examine_motion(examiner: &mut Examiner, bounds: &EnvelopeBounds) {
    let machine = &examiner.config.machine;
    let envelope = MotionEnvelope::new(&machine.home, *bounds);
    let (mut largest_force, mut largest_rate) = (0.0_f64, 0.0_f64);
    for motion in (0..CORNER_COUNT).map(|k| envelope.at(&envelope.corner(k)).motion()) {
        let largest = |values: [f64; LEGS]| values.into_iter().map(f64::abs).fold(0.0, f64::max);
        largest_rate = largest_rate.max(largest(leg_motion(machine, &motion).rate_m_s));
        largest_force = largest_force.max(inverse_dynamics::<Exact>(machine, &motion).map_or(0.0, largest));
    }
    let actuator = &machine.actuator;
    for (key, largest, limit, unit, limited) in [
        (
            "envelope.acceleration",
            largest_force,
            actuator.weakest_available_force_n(),
            "N",
            "actuator.max_force_n",
        ),
        ("envelope.velocity", largest_rate, actuator.max_rate_m_s, "m/s", "actuator.max_rate_m_s"),
    ] {
        if largest > limit {
            let value = format!("up to {} {unit} in a leg", rounded(largest));
            examiner.warn(
                key,
                value,
                format!(
                    "the drives give {limit} {unit} ({limited}), and cannot give all that is required at once"
                ),
            );
        }
    }
}

/// Offsets from home in units for people, those that are not zero.
fn offset_text(offsets: &[f64; 6]) -> String {
    let parts = AXES.into_iter().zip(offsets).enumerate().filter(|(_, (_, x))| x.abs() > 1e-9).map(
        |(axis, (name, x))| {
            let (scale, unit) = axis_unit(axis);
            format!("{name} {} {unit}", significant(scale * x))
        },
    );
    let parts: Vec<_> = parts.collect();
    if parts.is_empty() { "at home".into() } else { format!("at {} from home", parts.join(", ")) }
}

fn limit_text(limit: WorkspaceLimit, condition: f64) -> String {
    match limit {
        WorkspaceLimit::LegTooShort(leg) => {
            format!(
                "leg {} is shorter there than actuator.min_length_m and limits.stroke_margin_m allow; shrink the ranges",
                leg + 1
            )
        }
        WorkspaceLimit::LegTooLong(leg) => {
            format!(
                "leg {} is longer there than actuator.max_length_m and limits.stroke_margin_m allow; shrink the ranges",
                leg + 1
            )
        }
        WorkspaceLimit::Singular => "it is across a singular pose; shrink the ranges".into(),
        WorkspaceLimit::UniversalJoint => {
            "a leg comes too near to the first axis of its universal joint there; shrink the ranges".into()
        }
        WorkspaceLimit::HoldingForce(leg) => {
            format!("leg {} needs too much force there to hold the platform; shrink the ranges", leg + 1)
        }
        WorkspaceLimit::Condition => {
            format!(
                "the condition there is beyond limits.condition = {}; shrink the ranges",
                significant(condition)
            )
        }
    }
}
