//! Classical Runge-Kutta of fourth order on SE(3).
//!
//! Within a step the rotation is `R = exp(theta~) R_0`, so that an ordinary method for vectors applies to
//! `[theta C omega v]` (Munthe-Kaas): `theta' = omega - theta x omega / 2 + theta x (theta x omega) / 12`,
//! exact to the order of the method. Forces are constant over a step, hence the work they do is exactly
//! force times change of length.

use nalgebra::Vector3;

use super::forward_dynamics::ForwardDynamics;
use crate::model::machine::LEGS;
use crate::model::rigid::{Acceleration, Pose, Twist};

/// Pose and twist of the platform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantState {
    pub pose: Pose,
    pub twist: Twist,
}

/// Time derivative of the state, angular part first.
#[derive(Clone, Copy)]
struct Slope {
    pose: Twist,
    twist: Acceleration,
}

/// The state `step` seconds later under constant forces; `None` where the dynamics are not defined.
pub fn integrate(
    dynamics: &ForwardDynamics,
    start: &PlantState,
    force: &[f64; LEGS],
    step: f64,
) -> Option<PlantState> {
    // The state at `start` displaced by `theta` and `slope` over `dt`, and the slope there.
    let slope_at = |slope: &Slope, dt: f64| {
        let theta = slope.pose.angular * dt;
        let state = advanced(start, slope, dt);
        let twist = dynamics.acceleration(&state.pose, &state.twist, force)?;
        let angular = dexp_inverse(&theta, &state.twist.angular);
        Some(Slope { pose: Twist { angular, linear: state.twist.linear }, twist })
    };
    let rest = Slope { pose: Twist::default(), twist: Acceleration::default() };
    let k1 = slope_at(&rest, 0.0)?;
    let k2 = slope_at(&k1, 0.5 * step)?;
    let k3 = slope_at(&k2, 0.5 * step)?;
    let k4 = slope_at(&k3, step)?;
    let mean = |f: fn(&Slope) -> Vector3<f64>| (f(&k1) + (f(&k2) + f(&k3)) * 2.0 + f(&k4)) / 6.0;
    let slope = Slope {
        pose: Twist { angular: mean(|k| k.pose.angular), linear: mean(|k| k.pose.linear) },
        twist: Acceleration { angular: mean(|k| k.twist.angular), linear: mean(|k| k.twist.linear) },
    };
    Some(advanced(start, &slope, step))
}

fn advanced(start: &PlantState, slope: &Slope, dt: f64) -> PlantState {
    PlantState {
        pose: start
            .pose
            .displaced(&Twist { angular: slope.pose.angular * dt, linear: slope.pose.linear * dt }),
        twist: Twist {
            angular: start.twist.angular + slope.twist.angular * dt,
            linear: start.twist.linear + slope.twist.linear * dt,
        },
    }
}

/// `theta'` that gives the angular velocity `omega` at `R = exp(theta~) R_0`, to third order in theta.
fn dexp_inverse(theta: &Vector3<f64>, omega: &Vector3<f64>) -> Vector3<f64> {
    let once = theta.cross(omega);
    omega - once * 0.5 + theta.cross(&once) / 12.0
}
