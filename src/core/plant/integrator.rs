//! Classical Runge-Kutta of fourth order on SE(3).
//!
//! Within a step the rotation is `R = exp(theta~) R_0`, so that an ordinary method for vectors applies to
//! `[theta C omega v]` (Munthe-Kaas): `theta' = omega - theta x omega / 2 + theta x (theta x omega) / 12`,
//! exact to the order of the method. Drives that move on their own, where legs are elastic, are six more
//! positions and rates of the same step. Where forces are constant over a step, the work they do is exactly
//! force times change of length.

use nalgebra::{Vector3, Vector6};

use crate::model::rigid::{Acceleration, Pose, Twist};

/// State of the platform as a rigid body: pose and twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyState {
    /// R and C.
    pub pose: Pose,
    /// omega and v.
    pub twist: Twist,
}

/// State of the drives of elastic legs, as lengths of legs without load; not used where legs are rigid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveStates {
    /// \[m\]
    pub length_m: Vector6<f64>,
    /// \[m/s\]
    pub rate_m_s: Vector6<f64>,
}

/// State of the plant: platform and drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantState {
    /// Pose and twist.
    pub platform: BodyState,
    /// Lengths and rates.
    pub drives: DriveStates,
}

/// Accelerations of platform and drives.
#[derive(Clone, Copy, Debug)]
pub struct Accelerations {
    /// omega' and v'.
    pub platform: Acceleration,
    /// \[m/s^2\]; zeros where legs are rigid.
    pub drives_m_s2: Vector6<f64>,
}

/// Time derivative of the state, angular part first.
#[derive(Clone, Copy)]
struct Slope {
    pose: Twist,
    twist: Acceleration,
    drives: DriveStates,
}

/// The state `step_s` seconds later; `None` where the dynamics are not defined. `accelerations` takes a state and
/// its time since the start of the step.
pub fn integrate(
    start: &PlantState,
    step_s: f64,
    accelerations: impl Fn(&PlantState, f64) -> Option<Accelerations>,
) -> Option<PlantState> {
    // The state at `start` displaced by `theta` and `slope` over `dt`, and the slope there.
    let slope_at = |slope: &Slope, dt: f64| {
        let theta = slope.pose.angular * dt;
        let state = advanced(start, slope, dt);
        let accelerations = accelerations(&state, dt)?;
        let twist = state.platform.twist;
        let angular = dexp_inverse(&theta, &twist.angular);
        Some(Slope {
            pose: Twist { angular, linear: twist.linear },
            twist: accelerations.platform,
            drives: DriveStates { length_m: state.drives.rate_m_s, rate_m_s: accelerations.drives_m_s2 },
        })
    };
    let rest =
        Slope { pose: Twist::default(), twist: Acceleration::default(), drives: DriveStates::default() };
    let k1 = slope_at(&rest, 0.0)?;
    let k2 = slope_at(&k1, 0.5 * step_s)?;
    let k3 = slope_at(&k2, 0.5 * step_s)?;
    let k4 = slope_at(&k3, step_s)?;
    let mean = |f: fn(&Slope) -> Vector3<f64>| (f(&k1) + (f(&k2) + f(&k3)) * 2.0 + f(&k4)) / 6.0;
    let of_drives = |f: fn(&Slope) -> Vector6<f64>| (f(&k1) + (f(&k2) + f(&k3)) * 2.0 + f(&k4)) / 6.0;
    let slope = Slope {
        pose: Twist { angular: mean(|k| k.pose.angular), linear: mean(|k| k.pose.linear) },
        twist: Acceleration { angular: mean(|k| k.twist.angular), linear: mean(|k| k.twist.linear) },
        drives: DriveStates {
            length_m: of_drives(|k| k.drives.length_m),
            rate_m_s: of_drives(|k| k.drives.rate_m_s),
        },
    };
    Some(advanced(start, &slope, step_s))
}

fn advanced(start: &PlantState, slope: &Slope, dt: f64) -> PlantState {
    let PlantState { platform, drives } = start;
    PlantState {
        platform: BodyState {
            pose: platform
                .pose
                .displaced(&Twist { angular: slope.pose.angular * dt, linear: slope.pose.linear * dt }),
            twist: Twist {
                angular: platform.twist.angular + slope.twist.angular * dt,
                linear: platform.twist.linear + slope.twist.linear * dt,
            },
        },
        drives: DriveStates {
            length_m: drives.length_m + slope.drives.length_m * dt,
            rate_m_s: drives.rate_m_s + slope.drives.rate_m_s * dt,
        },
    }
}

/// `theta'` that gives the angular velocity `omega` at `R = exp(theta~) R_0`, to third order in theta.
fn dexp_inverse(theta: &Vector3<f64>, omega: &Vector3<f64>) -> Vector3<f64> {
    let once = theta.cross(omega);
    omega - once * 0.5 + theta.cross(&once) / 12.0
}
