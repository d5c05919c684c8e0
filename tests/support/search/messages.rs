//! How setpoints and measurements travel: kinds, rates, delays, jitter and losses.

use hexad::control::signals::inputs::{Measurement, Setpoint, SetpointKind};
use hexad::model::random::Random;
use hexad::model::task::TaskState;
use nalgebra::Vector6;

use super::genome::Reader;

/// Longest delay of a setpoint, and largest jitter of its stamp \[s\].
const LONGEST_DELAY_S: f64 = 0.048;
const LARGEST_JITTER_S: f64 = 0.01;
/// Longest delay of a measurement, as a ratio of the period: the loop is stable with two periods from the measurement to the
/// force.
const LONGEST_MEASUREMENT_DELAY_RATIO: f64 = 1.0;
/// Longest silence of the source \[s\].
const LONGEST_SILENCE_S: f64 = 0.25;
/// Farthest from where it fell silent that a source comes back \[m\], \[rad\].
const FARTHEST_RETURN: f64 = 0.05;

/// What happens to messages on their way.
#[derive(Clone, Debug)]
pub struct Messages {
    kind: SetpointKind,
    /// From one setpoint to the next; each cycle if shorter \[s\].
    interval_s: f64,
    delay_s: f64,
    jitter_s: f64,
    loss: f64,
    /// Begin and duration of two silences of the source \[s\].
    silences: [[f64; 2]; 2],
    /// Displacement of the source after the silences.
    returns: [Vector6<f64>; 2],
    measurement_delay_s: f64,
    measurement_loss: f64,
    seed: u64,
}

/// What is on its way, and what arrived.
#[derive(Clone, Debug)]
pub struct Channel {
    random: Random,
    newest: Option<Setpoint>,
    next_s: f64,
    /// Earlier measurements, the newest last.
    measured: Vec<Measurement>,
    arrived: Option<Measurement>,
}

impl Messages {
    pub fn read(genes: &mut Reader<'_>, is_limited: bool, [duration_s, period_s]: [f64; 2]) -> Self {
        use SetpointKind::{Motion, Pose, Target};
        let kinds: &[SetpointKind] = if is_limited {
            &[Motion, Motion, Pose, Pose, Target]
        } else {
            &[Motion, Motion, Motion, Motion, Target]
        };
        let kind = genes.choice("kind", kinds);
        let interval_s = match kind {
            Pose => 1.0 / genes.logarithmic("rate", 30.0, 200.0),
            _ => genes.sometimes("interval", 0.75, 0.0, 0.04),
        };
        let silences = ["silence", "other_silence"].map(|name| {
            genes.part(name, |genes| {
                [duration_s * genes.within("at", 0.1, 4.0), LONGEST_SILENCE_S * genes.share("length").powi(2)]
            })
        });
        let returns = ["return", "other_return"].map(|name| {
            genes.part(name, |genes| {
                let size = genes.sometimes("size", 0.5, 0.0, FARTHEST_RETURN);
                let mut shift = Vector6::zeros();
                shift[genes.index("axis", 6)] = size * genes.choice("side", &[-1.0, 1.0]);
                shift
            })
        });
        Self {
            kind,
            interval_s,
            delay_s: genes.sometimes("delay", 0.75, 0.0, LONGEST_DELAY_S),
            jitter_s: genes.sometimes("jitter", 0.75, 0.0, LARGEST_JITTER_S),
            loss: genes.sometimes("loss", 0.75, 0.0, 0.9),
            silences,
            returns,
            measurement_delay_s: period_s
                * genes.sometimes("measurement_delay", 0.8, 0.0, LONGEST_MEASUREMENT_DELAY_RATIO),
            measurement_loss: genes.sometimes("measurement_loss", 0.8, 0.0, 0.2),
            seed: (genes.share("seed") * 65_536.0) as u64,
        }
    }

    pub fn channel(&self) -> Channel {
        Channel {
            random: Random::new(self.seed),
            newest: None,
            next_s: 0.0,
            measured: Vec::new(),
            arrived: None,
        }
    }
}

impl Channel {
    /// The newest setpoint that has arrived. `at` is the source's motion at an instant \[s\]; `is_ideal` while the platform
    /// is to be engaged, for which nothing is lost.
    pub fn setpoint(
        &mut self,
        messages: &Messages,
        [start_ns, now_ns]: [u64; 2],
        is_ideal: bool,
        at: impl Fn(f64) -> TaskState,
    ) -> Option<Setpoint> {
        let now_s = (now_ns - start_ns) as f64 * 1e-9;
        let is_silent = messages.silences.iter().any(|[from, time]| (*from..from + time).contains(&now_s));
        let is_lost = !is_ideal && (is_silent || self.random.uniform() < messages.loss);
        if now_s < self.next_s || is_lost {
            return self.newest;
        }
        self.next_s = now_s + messages.interval_s;
        let jitter_s = messages.jitter_s * self.random.uniform();
        let delay_s = if is_ideal { 0.0 } else { messages.delay_s + jitter_s };
        let delay_ns = (delay_s * 1e9) as u64;
        // No stamp goes backwards: that would be another fault than the one that is looked for.
        let least_ns = self.newest.map_or(0, |newest| newest.time_ns + 1);
        let time_ns = (now_ns - delay_ns).max(least_ns);
        let mut task = at((time_ns - start_ns.min(time_ns)) as f64 * 1e-9);
        for ([from, time], shift) in messages.silences.iter().zip(&messages.returns) {
            if now_s >= from + time && !is_ideal {
                task.x += shift;
            }
        }
        if messages.kind != SetpointKind::Motion {
            task = TaskState::at_rest(task.x.into());
        }
        self.newest = Some(Setpoint { kind: messages.kind, ..Setpoint::motion(time_ns, task) });
        self.newest
    }

    /// The newest measurement that has arrived.
    pub fn measurement(&mut self, messages: &Messages, new: Measurement) -> Option<Measurement> {
        self.measured.push(new);
        let delay_ns = (messages.measurement_delay_s * 1e9) as u64;
        let arrived = self.measured.iter().rposition(|old| old.time_ns + delay_ns <= new.time_ns);
        let is_lost = self.random.uniform() < messages.measurement_loss;
        if let Some(index) = arrived.filter(|_| !is_lost) {
            self.arrived = Some(self.measured[index]);
            self.measured.drain(..index);
        }
        self.arrived
    }
}
