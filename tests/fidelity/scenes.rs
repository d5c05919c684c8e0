//! Machines and what they are asked to do.

use super::*;

/// A motion base of the one-tonne class: Moog 6DOF2000E, at most 22 deg in yaw, upward heave acceleration.
pub fn moog() -> EnvelopeBounds {
    const G: f64 = 9.81;
    let deg = |degrees: [f64; 3]| degrees.map(f64::to_radians);
    let (low, high) = (deg([-21.0, -22.0, -22.0]), deg([21.0, 22.0, 22.0]));
    let (rate, accel) = (deg([30.0, 30.0, 40.0]), deg([500.0, 500.0, 400.0]));
    EnvelopeBounds {
        pose_min: with(low, [-0.241, -0.259, -0.178]),
        pose_max: with(high, [0.259, 0.259, 0.178]),
        velocity: with(rate, [0.5, 0.5, 0.3]),
        acceleration: with(accel, [0.6 * G, 0.6 * G, 0.7 * G]),
    }
}

/// A camera hexapod of a telescope, three tonnes: 0.5 mm/s at the legs, hardly any acceleration.
pub fn camera() -> EnvelopeBounds {
    let pose_max = with([0.36_f64.to_radians(); 3], [0.0114, 0.0114, 0.0131]);
    EnvelopeBounds {
        pose_min: pose_max.map(|x| -x),
        pose_max,
        velocity: with([7e-4; 3], [5e-4; 3]),
        acceleration: [1e-3; 6],
    }
}

fn with(angles: [f64; 3], positions: [f64; 3]) -> [f64; 6] {
    let [a, b, c] = angles;
    let [x, y, z] = positions;
    [a, b, c, x, y, z]
}

/// A scene with a name for messages.
pub struct Scene {
    pub name: String,
    pub model: InverseDynamics,
    pub envelope: MotionEnvelope,
}

/// Each machine's own envelope, a fast and a slow one, one that it can only partly reach, and what such
/// machines are sold for.
pub fn scenes() -> Vec<Scene> {
    let mut scenes = vec![];
    for name in ["fried2008", "motion_base", "tsai2000", "telescope"] {
        let machine = machine(name);
        let model = InverseDynamics::new(&machine);
        let own = *reachable_envelope::reachable_envelope(&model).bounds();
        let faster = |share: f64| EnvelopeBounds {
            velocity: own.velocity.map(|v| v * share),
            acceleration: own.acceleration.map(|a| a * share * share),
            ..own
        };
        let double = |limits: [f64; 6]| limits.map(|x| 2.0 * x);
        let wide = EnvelopeBounds { pose_min: double(own.pose_min), pose_max: double(own.pose_max), ..own };
        let mut envelopes = vec![("own", own), ("fast", faster(4.0)), ("slow", faster(0.01)), ("wide", wide)];
        match name {
            "motion_base" => envelopes.push(("moog", moog())),
            "telescope" => envelopes.push(("camera", camera())),
            _ => {}
        }
        scenes.extend(envelopes.into_iter().map(|(kind, limits)| Scene {
            name: format!("{name} {kind}"),
            model: model.clone(),
            envelope: MotionEnvelope::new(&machine.home, limits),
        }));
    }
    scenes
}
