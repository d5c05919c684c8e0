//! Gimbal lock of the Bryan angles at speed: the same motion of the same machine, once as it stands and once turned
//! by 90 degrees about y with everything around it, so that beta passes 90 degrees. The forces cannot tell.

use super::*;

/// The platform turns so far to either side of the lock \[rad\].
const TURN: f64 = 0.15;

/// From one side to the other \[s\]: at up to 0.28 and 1.9 rad/s.
const TIMES_S: [f64; 2] = [2.0, 0.3];

/// Angles beside the lock at which it is passed \[rad\].
const BESIDE: [f64; 9] = [0.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];

/// Between the two machines forces differ by rounding, amplified by the estimator, as a share of the largest force.
const ROUNDING: f64 = 5e-9;

/// A rotation about y, then by `d` about x, then the rest of it.
#[derive(Clone, Copy)]
struct Turn {
    /// Sine and cosine of the angle about y: near a quarter turn the angle itself has lost its digits.
    sin: f64,
    cos: f64,
    rate: f64,
    accel: f64,
}

impl Turn {
    /// Bryan angles of `Ry(b) Rx(d)` with their derivatives, `R = Rx(alpha) Ry(beta) Rz(gamma)`:
    ///
    /// ```text
    /// alpha = atan2(sin d, cos d cos b)      sin beta = cos d sin b      gamma = atan2(-sin d sin b, cos b)
    /// cos^2 beta = D = sin^2 d sin^2 b + cos^2 b
    /// ```
    fn angles(self, d: f64) -> [Vector3<f64>; 3] {
        let Self { sin, cos, rate, accel } = self;
        if d == 0.0 {
            return [Vector3::y() * sin.atan2(cos), Vector3::y() * rate, Vector3::y() * accel];
        }
        let (s, c) = d.sin_cos();
        let q = s * s * sin * sin + cos * cos;
        let root = q.sqrt();
        let angles = Vector3::new(s.atan2(c * cos), (c * sin).atan2(root), (-s * sin).atan2(cos));
        let first = Vector3::new(s * c * sin / q, c * cos / root, -s / q);
        let second = Vector3::new(
            s * c * cos / q + 2.0 * s * c.powi(3) * sin * sin * cos / (q * q),
            -c * sin / root + c.powi(3) * sin * cos * cos / (q * root),
            -2.0 * s * c * c * sin * cos / (q * q),
        );
        [angles, first * rate, second * (rate * rate) + first * accel]
    }

    /// The same with the machine turned by a quarter about y.
    fn quarter(self) -> Self {
        Self { sin: self.cos, cos: -self.sin, ..self }
    }
}

/// Setpoints of a machine as it stands, and of the turned one.
fn tasks(t: f64, time_s: f64, d: f64, height: f64) -> [TaskState; 2] {
    let s = rise(t, time_s);
    let (sin, cos) = (TURN * (2.0 * s.value_share - 1.0)).sin_cos();
    let turn = Turn { sin, cos, rate: 2.0 * TURN * s.rate_per_s, accel: 2.0 * TURN * s.accel_per_s2 };
    let task = |turn: Turn, place: Vector3<f64>| {
        let [x, xd, xdd] = turn.angles(d).map(|a| Vector6::new(a.x, a.y, a.z, 0.0, 0.0, 0.0));
        TaskState { x: x + Vector6::new(0.0, 0.0, 0.0, place.x, place.y, place.z), xd, xdd }
    };
    [task(turn, Vector3::z() * height), task(turn.quarter(), Vector3::x() * height)]
}

/// By a quarter turn about y: z becomes x.
fn quarter() -> Matrix3<f64> {
    Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0)
}

/// The motion base with other homes, and with the world turned or not.
fn configured(home: &TaskState, world: &Matrix3<f64>) -> Config {
    let mut config = deployed("motion_base");
    config.deployment.limits.reference.orientation =
        DerivativeLimits { velocity: 2.0, acceleration: 20.0, jerk: 2000.0 };
    let machine = &mut config.machine;
    // The reference bounds the forces, which is not the subject.
    machine.actuator.max_force_n *= 10.0;
    machine.home = home.x.into();
    let legs = Legs::of(machine);
    machine.joints = Legs {
        base: legs.base.map(|a| world * a),
        platform: legs.platform,
        universal_axis: legs.universal_axis.map(|u| world * u),
    }
    .joints(&machine.home);
    machine.gravity_m_s2 = world * machine.gravity_m_s2;
    config
}

/// Forces of both machines, cycle by cycle.
fn forces(time_s: f64, d: f64) -> [Vec<[f64; 6]>; 2] {
    let height = deployed("motion_base").machine.home[5];
    let home = tasks(0.0, time_s, d, height);
    let worlds = [Matrix3::identity(), quarter()];
    core::array::from_fn(|which| {
        let config = configured(&home[which], &worlds[which]);
        let mut rig = Rig::new(&config, &config.machine);
        rig.engage(&home[which]);
        let cycle = |k: u32| {
            let task = tasks(f64::from(k) * 1e-3, time_s, d, height)[which];
            let Output { state, diagnostic, command_n, .. } = rig.cycle(&rig.input(&task));
            assert_eq!((state, diagnostic.code), (State::Active, DiagnosticCode::None), "{d} rad, cycle {k}");
            command_n
        };
        (0..(time_s * 1e3) as u32 + 300).map(cycle).collect()
    })
}

/// Where doubles end: X'' near the lock is as large as `(omega / d)^2`, and its rounding is an acceleration of
/// some `epsilon (omega / d)^2` \[rad/s^2\].
fn rounding_of_messages(speed: f64, d: f64) -> f64 {
    if d == 0.0 { 0.0 } else { f64::EPSILON * (speed / d).powi(2) }
}

/// A radian/s^2 is less than a tenth of the largest force; setpoints are continued by two periods with a jerk, which is a difference
/// of two X'' over a period: five times their rounding.
const SHARE: f64 = 0.5;

#[test]
fn gimbal_lock_is_passed_without_a_trace_in_the_forces() {
    for time_s in TIMES_S {
        for d in BESIDE {
            let [plain, turned] = forces(time_s, d);
            let most = plain.iter().map(|force| largest(force)).fold(0.0, f64::max);
            let apart =
                |(a, b): (&[f64; 6], &[f64; 6])| largest(&core::array::from_fn::<_, 6, _>(|i| a[i] - b[i]));
            let apart = plain.iter().zip(&turned).map(apart).fold(0.0, f64::max);
            let speed = 1.875 * 2.0 * TURN / time_s;
            let bound = ROUNDING + SHARE * rounding_of_messages(speed, d);
            assert!(apart / most < bound, "{time_s} s, {d:e} rad beside: {apart} N of {most} N");
        }
    }
}
