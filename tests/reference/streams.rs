//! Streams of targets, each by a seed.

use hexad::control::signals::inputs::{Setpoint, SetpointKind};
use hexad::model::random::Random;
use hexad::model::task::TaskState;
use nalgebra::Vector6;

/// Stream of setpoints around home.
pub struct Stream {
    random: Random,
    kind: u32,
    home: Vector6<f64>,
    /// Amplitudes of the six coordinates.
    size: Vector6<f64>,
    phase: Vector6<f64>,
    frequency: f64,
    /// Which coordinates move.
    axes: Vector6<f64>,
    present: TaskState,
    left: u32,
}

/// Kinds of streams.
pub const KINDS: u32 = 12;

impl Stream {
    pub fn new(seed: u64, home: &[f64; 6], size: &Vector6<f64>) -> Self {
        let mut random = Random::new(seed);
        let kind = (random.uniform() * f64::from(KINDS)) as u32;
        let phase = Vector6::from_fn(|_, _| 6.3 * random.uniform());
        let frequency = 0.2 * 20.0_f64.powf(random.uniform());
        let axes = match (random.uniform() * 4.0) as u32 {
            0 => Vector6::new(0.0, 0.0, 0.0, 1.0, 1.0, 1.0),
            1 => Vector6::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
            2 => Vector6::from_fn(|_, _| f64::from(random.uniform() < 0.3)),
            _ => Vector6::repeat(1.0),
        };
        let scale = 0.1 * 30.0_f64.powf(random.uniform());
        let home = Vector6::from(*home);
        let present = TaskState::at_rest(home.into());
        Self { random, kind, home, size: size * scale, phase, frequency, axes, present, left: 0 }
    }

    fn anywhere(&mut self) -> Vector6<f64> {
        let random = Vector6::from_fn(|_, _| 2.0 * self.random.uniform() - 1.0);
        self.home + random.component_mul(&self.size).component_mul(&self.axes)
    }

    fn sine(&self, t: f64) -> TaskState {
        let w = core::f64::consts::TAU * self.frequency;
        let amplitude = self.size.component_mul(&self.axes);
        let angle = self.phase.map(|phase| phase + w * t);
        TaskState {
            x: self.home + amplitude.component_mul(&angle.map(f64::sin)),
            xd: amplitude.component_mul(&angle.map(f64::cos)) * w,
            xdd: amplitude.component_mul(&angle.map(f64::sin)) * (-w * w),
        }
    }

    /// The setpoint of an instant `t` seconds after the start, `dt` after the last; `None` for none.
    pub fn next(&mut self, time_ns: u64, t: f64, dt: f64) -> Option<Setpoint> {
        let sine = self.sine(t);
        let motion = |task| Some(Setpoint::motion(time_ns, task));
        match self.kind {
            // Steps; held, with false rates, as targets.
            0..=3 => {
                if self.left == 0 {
                    self.left = (self.random.uniform() * 0.8 / dt) as u32 + 1;
                    self.present = TaskState::at_rest(self.anywhere().into());
                    if self.kind == 1 {
                        self.present.xd = self.anywhere() - self.home;
                        self.present.xdd = (self.anywhere() - self.home) * 10.0;
                    }
                }
                self.left -= 1;
                let kind = if self.kind == 2 { SetpointKind::Target } else { SetpointKind::Motion };
                Some(Setpoint { kind, ..Setpoint::motion(time_ns, self.present) })
            }
            4 => motion(sine),
            5 => motion(TaskState { xd: Vector6::zeros(), ..sine }),
            6 => motion(TaskState { xdd: Vector6::zeros(), ..sine }),
            7 => motion(TaskState { xd: -sine.xd, xdd: sine.xdd * 3.0, ..sine }),
            // Noise in every number.
            8 => {
                let x = self.anywhere();
                let (xd, xdd) = (self.anywhere() - self.home, self.anywhere() - self.home);
                motion(TaskState { x, xd: xd * 30.0, xdd: xdd * 900.0 })
            }
            // Outward for ever, and back.
            9 => {
                if self.left == 0 {
                    self.left = (self.random.uniform() * 1.5 / dt) as u32 + 1;
                    self.present = TaskState { xd: (self.anywhere() - self.home) * 5.0, ..self.present };
                }
                self.left -= 1;
                self.present = self.present.after(dt);
                motion(self.present)
            }
            // Lost and resumed.
            10 => ((t * 2.0).sin() > -0.3).then(|| Setpoint::motion(time_ns, sine)),
            _ => {
                let noise = (self.anywhere() - self.home) * 0.01;
                motion(TaskState { x: sine.x + noise, ..sine })
            }
        }
    }
}
