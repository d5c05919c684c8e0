//! Parameters of the controller and of the cyclic loop, from the deployment.

use core::f64::consts::TAU;

use nalgebra::Vector6;

use hexad_client::realtime::cyclic::{ReleaseMode, Timing};
use hexad_core::control::constants::Constants;
use hexad_core::control::law::Law;
use hexad_core::control::law::estimator::ReadingErrors;
use hexad_core::control::law::estimator::covariance::NoiseModel;
use hexad_core::control::law::gains::Gains;
use hexad_core::control::parameters::{Envelope, Parameters};
use hexad_core::control::signals::pair::Pair;
use hexad_core::model::fidelity::Fidelity;
use hexad_core::model::machine::Machine;
use hexad_machine::config::Config;
use hexad_machine::config::control_loops::longest_stable_age_s;
use hexad_machine::config::deployment::Deployment;

/// Constants of the controller, for motions of its reference, which do not depend on the fidelity.
pub fn constants(config: &Config) -> Constants {
    Constants::new(&config.machine, parameters(&config.machine, &config.deployment, Fidelity::Exact))
}

/// Parameters of the controller. `fidelity` is the result of the deployment's choice.
pub fn parameters(machine: &Machine, deployment: &Deployment, fidelity: Fidelity) -> Parameters {
    let Deployment { control, timeouts, limits, .. } = deployment;
    let envelope = deployment.envelope.map(|limits| {
        let home = Vector6::from(machine.home);
        let from_home = |offsets: [f64; 6]| (home + Vector6::from(offsets)).into();
        Envelope { lowest: from_home(limits.pose_min), highest: from_home(limits.pose_max) }
    });
    Parameters {
        period_ns: nanoseconds(deployment.realtime.period_s()),
        law: Law::new(
            machine,
            control.mode,
            Pair {
                angular: Gains::new(control.orientation_bandwidth_hz, control.orientation_damping_ratio),
                linear: Gains::new(control.position_bandwidth_hz, control.position_damping_ratio),
            },
            control.leg_masses,
            control.compensate_disturbances,
            &limits.reference,
        ),
        noise: NoiseModel {
            bandwidth_rad_s: TAU * control.estimator_bandwidth_hz,
            rate_noise_ratio: deployment.noise.rate_m_s.map(|rate| rate / deployment.noise.length_m),
            period_s: deployment.realtime.period_s(),
        },
        reading_errors: ReadingErrors {
            deviation_m: deployment.noise.length_m,
            resolution_or_0_m: deployment.noise.length_step_m,
        },
        force_delay_ns: nanoseconds(deployment.drive.total_delay_s()),
        fidelity,
        engage_position_m: control.engage_position_m,
        engage_orientation_rad: control.engage_orientation_rad,
        following_position_m: control.following_position_m,
        following_orientation_rad: control.following_orientation_rad,
        setpoint_timeout_ns: nanoseconds(timeouts.setpoint_s),
        measured_timeout_ns: nanoseconds(timeouts.measured_s),
        ready_timeout_ns: nanoseconds(deployment.drive.ready_timeout_s),
        pose_tolerance_m: deployment.noise.pose_tolerance_m,
        max_age_at_arrival_ns: nanoseconds(longest_stable_age_s(deployment)),
        longest_cycle_gap_ns: nanoseconds(longest_pause_s(deployment)),
        limits: limits.in_force(),
        limits_scale: limits.scale,
        force_rate_n_s: limits.force_rate_n_s,
        max_condition: limits.condition,
        envelope,
        after_loss: control.on_setpoint_lost,
        lost_hold_ns: nanoseconds(control.lost_hold_s),
        on_violation: deployment.setpoint.on_violation,
        approach: deployment.setpoint.approach,
        holds_on_return: deployment.setpoint.holds_on_return,
        // A ratio of the scaled limits.
        feedback_scale: limits.feedback_scale / limits.scale,
        payload_change_kg: limits.payload_change_kg,
        disturbance_step_m_s2: limits.disturbance_step_m_s2,
        stroke_margin_m: limits.stroke_margin_m,
        following_velocity_m_s: control.following_velocity_m_s,
        following_angular_velocity_rad_s: control.following_velocity_rad_s,
    }
}

/// Longest time between two cycles of a daemon that was not held \[s\]. With external release the daemon runs
/// a cycle after each timeout without a message. One late cycle may be caused by the driver; a pause of two
/// timeouts is not.
fn longest_pause_s(deployment: &Deployment) -> f64 {
    let timeout_s = deployment.timeouts.measured_s;
    if deployment.realtime.release == ReleaseMode::External { 2.0 * timeout_s } else { timeout_s }
}

/// Timing of the cyclic loop. Releases are half a period away from multiples of the period, at which plants
/// measure.
pub fn timing(deployment: &Deployment) -> Timing {
    let Deployment { realtime, timeouts, .. } = deployment;
    let period_ns = nanoseconds(realtime.period_s());
    Timing {
        period_ns,
        phase_ns: period_ns / 2,
        release: realtime.release,
        max_lead_ns: nanoseconds(realtime.max_lead_s),
        timeout_ns: nanoseconds(timeouts.measured_s),
        on_overrun: realtime.on_overrun,
        late_wakeup_ns: nanoseconds(realtime.late_wakeup_s),
    }
}

/// Converts seconds to nanoseconds, for durations within the bounds of the configuration.
pub fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}
