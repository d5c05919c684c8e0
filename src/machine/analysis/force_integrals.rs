//! Integrals of commands that are held, and their means over a triangle of three instants.

use nalgebra::Vector6;

use hexad_core::model::LEGS;

/// A force that is sent, and the release of its cycle.
#[derive(Clone, Copy, Debug)]
pub struct SentForce {
    /// \[ns\]
    pub release_ns: u64,
    /// \[N\]
    pub force_n: [f64; LEGS],
}

/// First and second derivative by divided differences: the first at the middle, the second as the mean over the triangle.
pub(super) fn differences(
    [a, b, c]: &[f64; 3],
    [at_a, at_b, at_c]: &[Vector6<f64>; 3],
) -> (Vector6<f64>, Vector6<f64>) {
    let (before, after) = ((at_b - at_a) / (b - a), (at_c - at_b) / (c - b));
    let second = (after - before) * (2.0 / (c - a));
    (before + second * (0.5 * (b - a)), second)
}

/// A force from an instant on, and its integrals until then.
struct HeldForce {
    /// \[s\]
    begin: f64,
    force: Vector6<f64>,
    first: Vector6<f64>,
    second: Vector6<f64>,
}

impl HeldForce {
    /// First and second integral at an instant from its begin on.
    fn at(&self, time: f64) -> [Vector6<f64>; 2] {
        let dt = time - self.begin;
        let Self { force, first, second, .. } = self;
        [first + force * dt, second + (first + force * (0.5 * dt)) * dt]
    }
}

/// First and second integral of the forces, each held until the next.
pub(super) struct ForceIntegrals(Vec<HeldForce>);

impl ForceIntegrals {
    pub fn new(sent: &[SentForce], zero_ns: u64) -> Self {
        let mut held: Vec<HeldForce> = vec![];
        for SentForce { release_ns, force_n } in sent {
            let begin = (release_ns - zero_ns) as f64 * 1e-9;
            let [first, second] = held.last().map_or([Vector6::zeros(); 2], |last| last.at(begin));
            held.push(HeldForce { begin, force: (*force_n).into(), first, second });
        }
        Self(held)
    }

    /// Both integrals at an instant.
    fn at(&self, time: f64) -> [Vector6<f64>; 2] {
        let index = self.0.partition_point(|held| held.begin <= time).saturating_sub(1);
        self.0.get(index).map_or([Vector6::zeros(); 2], |held| held.at(time))
    }

    /// Mean over the triangle of three instants, a delay before, and its rate of change.
    pub fn mean(&self, times: &[f64; 3], delay_s: f64) -> (Vector6<f64>, Vector6<f64>) {
        let [a, b, c] = times.map(|time| self.at(time - delay_s));
        let ([a, a_twice], [b, b_twice], [c, c_twice]) = (a, b, c);
        (differences(times, &[a_twice, b_twice, c_twice]).1, differences(times, &[a, b, c]).1)
    }
}
