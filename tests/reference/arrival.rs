//! Arrival at a target that jumps: against the time-optimal profile, without overshoot, at every rate.

use hexad::config::Config;
use hexad::control::constants::Constants;
use hexad::control::reference::ReferenceGenerator;
use hexad::control::setpoint::motion::SetpointMotion;
use hexad::control::setpoint::target::Target;
use hexad::control::signals::inputs::Setpoint;
use hexad::control::signals::limits::DerivativeLimits;
use hexad::model::task::TaskState;
use nalgebra::{Vector3, Vector6};
use rsruckig::prelude::*;

use hexad_support::data;
use hexad_support::rig::parameters;

/// Part of the way that is left on arrival.
pub const ARRIVED: f64 = 0.01;

/// Time of the time-optimal profile from rest to rest until 1 % of the way is left.
pub fn optimal_s(way: f64, limits: &DerivativeLimits) -> f64 {
    let mut generator = Ruckig::<1, ThrowErrorHandler>::new(None, 1e-5);
    let mut input = InputParameter::new(None);
    input.target_position[0] = way;
    input.max_velocity[0] = limits.velocity;
    input.max_acceleration[0] = limits.acceleration;
    input.max_jerk[0] = limits.jerk;
    let mut trajectory = Trajectory::new(None);
    generator.calculate(&input, &mut trajectory).unwrap();
    let duration_s = trajectory.get_duration();
    let (mut low, mut high) = (0.0, duration_s);
    while high - low > 1e-7 {
        let t = 0.5 * (low + high);
        let (mut p, mut v, mut a) =
            (DataArrayOrVec::Stack([0.0]), DataArrayOrVec::Stack([0.0]), DataArrayOrVec::Stack([0.0]));
        trajectory.at_time(t, &mut Some(&mut p), &mut Some(&mut v), &mut Some(&mut a), &mut None, &mut None);
        if p[0] < (1.0 - ARRIVED) * way { low = t } else { high = t }
    }
    high
}

/// Time to arrive at a target a displacement away, and the overshoot as a share of the way.
fn arrival(constants: &Constants, displacement: &Vector6<f64>) -> [f64; 2] {
    let home = Vector6::from(constants.machine().home);
    let x = home + displacement;
    let setpoint = SetpointMotion::new(Setpoint::motion(0, TaskState::at_rest(x.into())));
    let mut reference = ReferenceGenerator::new(constants);
    let start = *reference.motion();
    reference.verify_start(constants, &start).ok();
    reference.begin_placed_motion(0);
    let way = start.pose.displacement_to(&setpoint.motion.pose).vector();
    let period_ns = constants.parameters.period_ns;
    let (mut arrived_s, mut overshoot) = (f64::INFINITY, 0.0_f64);
    for k in 1..=4_000_000_000 / period_ns {
        reference.advance(constants, k * period_ns, Some(&Target::Motion(&setpoint)));
        let left = reference.motion().pose.displacement_to(&setpoint.motion.pose).vector();
        if left.norm() > ARRIVED * way.norm() {
            arrived_s = f64::INFINITY;
        } else if arrived_s.is_infinite() {
            // Between two cycles, as the profile is continuous.
            arrived_s = (k * period_ns) as f64 * 1e-9;
        }
        overshoot = overshoot.max(-left.dot(&way) / way.norm_squared());
    }
    [arrived_s, overshoot]
}

#[test]
fn a_target_that_jumps_is_reached_almost_as_fast_as_possible() {
    let config = Config::load(&data("motion_base", "toml")).unwrap();
    let mut slowest = Vec::new();
    for rate_hz in [250, 1000, 4000, 20000] {
        let mut parameters = parameters(&config);
        parameters.period_ns = 1_000_000_000 / rate_hz;
        let constants = Constants::new(&config.machine, parameters);
        for (way, most) in [(0.005, 1.4), (0.02, 1.2), (0.05, 1.2), (0.2, 1.2)] {
            for direction in [Vector3::x(), Vector3::z(), Vector3::new(-1.0, 2.0, 0.5).normalize()] {
                let d = direction * way;
                let displacement = Vector6::new(0.0, 0.0, 0.0, d.x, d.y, d.z);
                let [arrived_s, overshoot] = arrival(&constants, &displacement);
                let ratio = arrived_s / optimal_s(way, &constants.parameters.limits.position);
                println!("{rate_hz} Hz, {way} m: {ratio:.3}, overshoot {overshoot:.1e}");
                slowest.push((ratio / most, rate_hz, way));
                assert!(overshoot < 1e-6);
            }
        }
        for turn in [0.02, 0.1, 0.3] {
            let displacement = Vector6::new(0.0, turn, 0.0, 0.0, 0.0, 0.0);
            let [arrived_s, overshoot] = arrival(&constants, &displacement);
            let ratio = arrived_s / optimal_s(turn, &constants.parameters.limits.orientation);
            println!("{rate_hz} Hz, {turn} rad: {ratio:.3}, overshoot {overshoot:.1e}");
        }
    }
    for (share, rate_hz, way) in slowest {
        assert!(share <= 1.0, "{rate_hz} Hz, {way} m: {share}");
    }
}
