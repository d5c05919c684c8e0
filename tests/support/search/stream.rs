//! Motions that a setpoint source asks for, as functions of time.

use core::f64::consts::TAU;

use hexad::control::parameters::Parameters;
use hexad::control::signals::limits::DerivativeLimits;
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::machine::Machine;
use hexad::model::random::Random;
use hexad::model::task::TaskState;
use hexad::motion::minimum_jerk::{Profile, rise, shortest_duration};
use nalgebra::{Vector3, Vector6};

use super::genome::Reader;

/// Farthest way to a wall that is looked for \[m\].
const FARTHEST_M: f64 = 2.0;
/// Part of the sources that send wrong derivatives.
const WRONG: f64 = 0.2;
/// Parts of it.
const STEPS: u32 = 200;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    Still,
    Sines,
    Circle,
    /// A circle that grows beyond the walls.
    Spiral,
    /// At a constant velocity beyond a wall, from rest at the acceleration's limit.
    Outward,
    /// From rest to rest, one after the other.
    Moves,
    /// Full acceleration one way and the other, without any limit of jerk.
    BangBang,
    /// Steps of a pose, without derivatives.
    Steps,
    /// A random pose in each message.
    Noise,
}

const SHAPES: [Shape; 9] = [
    Shape::Still,
    Shape::Sines,
    Shape::Circle,
    Shape::Spiral,
    Shape::Outward,
    Shape::Moves,
    Shape::BangBang,
    Shape::Steps,
    Shape::Noise,
];

/// A motion in the plane of two directions of X through a centre.
#[derive(Clone, Debug)]
pub struct Stream {
    shape: Shape,
    seed: u64,
    center: Vector6<f64>,
    directions: [Vector6<f64>; 2],
    /// Amplitude \[m\], or \[rad\] for directions of rotation.
    amplitude: f64,
    omega: f64,
    phase: f64,
    /// Velocity and acceleration that are as large as the limits times a factor.
    velocity: f64,
    acceleration: f64,
    /// Factors on the derivatives that are sent.
    sent: [f64; 2],
}

impl Stream {
    pub fn read(genes: &mut Reader<'_>, machine: &Machine, parameters: &Parameters) -> Self {
        let shape = genes.choice("shape", &SHAPES);
        let seed = (genes.share("seed") * 65_536.0) as u64;
        let directions = ["direction", "other_direction"].map(|name| genes.part(name, direction));
        // Most sources keep the limits, as nearly as they can.
        let factor =
            genes.choice("factor", &[0.6, 0.9, 0.99, 1.3]) * genes.within("part_of_factor", 0.8, 1.0);
        let omega = genes.logarithmic("omega", 0.8, 120.0);
        let phase = TAU * genes.share("phase");
        let side = genes.choice("side", &[-1.0, 1.0]);
        let near_wall = genes.sometimes("near_wall", 0.4, 0.0, 1.1);
        let wrong = ["sent_rate", "sent_accel"].map(|name| genes.choice(name, &[1.0, 0.0, 0.5, -1.0, 2.0]));
        let sent = if genes.share("is_sent_wrong") > 1.0 - WRONG { wrong } else { [1.0; 2] };
        let limits = &parameters.limits;
        let [angular, linear] = [0, 3].map(|row| directions[0].fixed_rows::<3>(row).norm());
        let lesser = |of_angle: f64, of_position: f64| (of_angle / angular).min(of_position / linear);
        let velocity = factor * lesser(limits.orientation.velocity, limits.position.velocity);
        let acceleration = factor * lesser(limits.orientation.acceleration, limits.position.acceleration);
        let jerk = factor * lesser(limits.orientation.jerk, limits.position.jerk);
        let reach = reach(machine, parameters, &(directions[0] * side));
        let amplitude = match shape {
            Shape::Steps | Shape::Noise | Shape::Moves => reach * genes.logarithmic("reach", 0.002, 1.5),
            _ => (velocity / omega)
                .min(acceleration / (omega * omega))
                .min(jerk / omega.powi(3))
                .min(genes.within("reach", 0.5, 2.0) * reach),
        };
        // The amplitude's end comes as near to the wall as the centre is shifted.
        let center = directions[0] * (side * near_wall * (reach - amplitude).max(0.0));
        Self {
            shape,
            seed,
            center: Vector6::from(machine.home) + center,
            directions,
            amplitude,
            omega,
            phase,
            velocity,
            acceleration,
            sent,
        }
    }

    /// Time in which the way from home to the farthest point of the stream can be gone within the limits \[s\].
    pub fn approach_s(&self, machine: &Machine, parameters: &Parameters) -> f64 {
        let way = self.center - Vector6::from(machine.home) + self.directions[0] * self.amplitude;
        let limits = &parameters.limits;
        let time_s = |distance: f64, limits: &DerivativeLimits| {
            shortest_duration(distance, [limits.velocity, limits.acceleration, limits.jerk])
        };
        let [angular, linear] = [0, 3].map(|row| way.fixed_rows::<3>(row).norm());
        time_s(angular, &limits.orientation).max(time_s(linear, &limits.position))
    }

    /// X, X', X'' at an instant; the derivatives as they are sent.
    pub fn at(&self, t: f64) -> TaskState {
        let [p, q] = self.plane(t);
        let [u, w] = &self.directions;
        TaskState {
            x: self.center + u * p[0] + w * q[0],
            xd: (u * p[1] + w * q[1]) * self.sent[0],
            xdd: (u * p[2] + w * q[2]) * self.sent[1],
        }
    }

    /// Both coordinates with their derivatives.
    fn plane(&self, t: f64) -> [[f64; 3]; 2] {
        const STILL: [f64; 3] = [0.0; 3];
        let Self { amplitude, omega, phase, velocity, acceleration, .. } = *self;
        let sine = |a: f64, w: f64, phase: f64| {
            let (sin, cos) = (w * t + phase).sin_cos();
            [a * sin, a * w * cos, -a * w * w * sin]
        };
        match self.shape {
            Shape::Still => [STILL; 2],
            Shape::Sines => [sine(amplitude, omega, phase), sine(0.3 * amplitude, 1.7 * omega, 0.0)],
            Shape::Circle => [sine(amplitude, omega, phase), sine(amplitude, omega, phase + 0.25 * TAU)],
            Shape::Spiral => {
                let Profile { value_share, rate_per_s, accel_per_s2 } = rise(t, 4.0 * TAU / omega);
                [phase, phase + 0.25 * TAU].map(|phase| {
                    let [x, v, a] = sine(3.0 * amplitude, omega, phase);
                    [
                        value_share * x,
                        value_share * v + rate_per_s * x,
                        value_share * a + 2.0 * rate_per_s * v + accel_per_s2 * x,
                    ]
                })
            }
            Shape::Outward => {
                let t = t.rem_euclid(3.0 * velocity / acceleration + 0.6);
                let start_s = velocity / acceleration;
                let p = if t < start_s {
                    [0.5 * acceleration * t * t, acceleration * t, acceleration]
                } else {
                    [velocity * (t - 0.5 * start_s), velocity, 0.0]
                };
                [p, STILL]
            }
            Shape::Moves => {
                let step_s = self.move_s();
                let index = (t / step_s).floor();
                let Profile { value_share, rate_per_s, accel_per_s2 } = rise(t - index * step_s, step_s);
                [0, 1].map(|axis| {
                    let [from, to] = [0.0, 1.0].map(|next| self.level(index + next, axis));
                    [from + (to - from) * value_share, (to - from) * rate_per_s, (to - from) * accel_per_s2]
                })
            }
            Shape::BangBang => {
                // Acceleration +, -, -, + over a quarter each.
                let quarter_s = (0.25 * TAU / omega).min(velocity / acceleration);
                let u = (t / quarter_s + phase).rem_euclid(4.0);
                let a = acceleration;
                let (x, v, sign) = match u {
                    u if u < 1.0 => (0.5 * u * u, u, 1.0),
                    u if u < 3.0 => {
                        let r = 2.0 - u;
                        (1.0 - 0.5 * r * r, r, -1.0)
                    }
                    u => (0.5 * (4.0 - u).powi(2), u - 4.0, 1.0),
                };
                [[a * quarter_s * quarter_s * x, a * quarter_s * v, a * sign], STILL]
            }
            Shape::Steps => {
                let index = (t * omega / TAU + phase).floor();
                [0, 1].map(|axis| [self.level(index, axis), 0.0, 0.0])
            }
            Shape::Noise => [0, 1].map(|axis| [self.level((t * 1e6).floor(), axis), 0.0, 0.0]),
        }
    }

    /// Duration of a move whose largest velocity and acceleration are those of the stream.
    fn move_s(&self) -> f64 {
        let distance = 2.0 * self.amplitude;
        (1.875 * distance / self.velocity).max((5.774 * distance / self.acceleration).sqrt()).max(0.02)
    }

    /// A random number within the amplitude for each index.
    fn level(&self, index: f64, axis: u64) -> f64 {
        let seed = self.seed ^ (index as i64 as u64).wrapping_mul(0x5851_f42d_4c95_7f2d) ^ axis << 60;
        let mut random = Random::new(seed);
        random.uniform();
        self.amplitude * (2.0 * random.uniform() - 1.0) * if axis == 0 { 1.0 } else { 0.3 }
    }
}

/// A direction of X: of the position, of the orientation, or of both.
fn direction(genes: &mut Reader<'_>) -> Vector6<f64> {
    let unit = |genes: &mut Reader<'_>| {
        let (z, phi) = (genes.within("z", -1.0, 1.0), TAU * genes.share("phi"));
        let across = (1.0 - z * z).sqrt();
        Vector3::new(across * phi.cos(), across * phi.sin(), z)
    };
    let (angular, linear) = (genes.part("angular", unit), genes.part("linear", unit));
    let [angular_share, linear_share] =
        genes.choice("parts", &[[0.0, 1.0], [0.0, 1.0], [2.0, 1.0], [4.0, 1.0], [1.0, 0.0]]);
    let mut direction = Vector6::zeros();
    direction.fixed_rows_mut::<3>(0).copy_from(&(angular * angular_share));
    direction.fixed_rows_mut::<3>(3).copy_from(&(linear * linear_share));
    direction
}

/// Way from home to the first end of a stroke, or to the envelope.
fn reach(machine: &Machine, parameters: &Parameters, direction: &Vector6<f64>) -> f64 {
    let step = FARTHEST_M / f64::from(STEPS);
    let is_inside = |x: &Vector6<f64>| {
        let pose = TaskState { x: *x, ..TaskState::default() }.motion().pose;
        let lengths = leg_lengths(machine, &pose);
        lengths.iter().all(|length| machine.actuator.margin(*length) > parameters.stroke_margin_m)
            && parameters.envelope.is_none_or(|envelope| {
                let ranges = envelope.lowest.iter().zip(&envelope.highest);
                x.iter().zip(ranges).all(|(x, (low, high))| (low..=high).contains(&x))
            })
    };
    let home = Vector6::from(machine.home);
    let scale = machine.actuator.stroke().min(1.0);
    let steps = (1..=STEPS).take_while(|k| is_inside(&(home + direction * (scale * step * f64::from(*k)))));
    scale * step * (steps.count() as f64).max(0.5)
}
