//! Failures of sensors, drives and messages: what each does to what the controller reads, or to the forces that act.

use hexad::control::signals::inputs::DriveStatus;
use hexad::control::signals::inputs::Measurement;
use hexad::model::LEGS;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Exact;
use hexad::model::machine::Machine;
use hexad::model::random::Random;
use hexad::model::rigid::{Acceleration, Motion};
use hexad::model::task::TaskState;

/// What a failure can know.
pub struct Context<'a> {
    pub machine: &'a Machine,
    /// Since the failure began \[s\].
    pub since_s: f64,
    /// Measured when it began, and what was measured before it began and since, the newest last.
    pub first: Measurement,
    pub measured: &'a [Measurement],
    /// True pose X.
    pub x: [f64; 6],
    /// Forces of the cycles so far, the newest last \[N\].
    pub sent: &'a [[f64; LEGS]],
    pub random: &'a mut Random,
}

impl Context<'_> {
    /// So many cycles ago.
    fn measured_before(&self, cycles: usize) -> Measurement {
        self.measured[self.measured.len().saturating_sub(1 + cycles)]
    }

    fn sent_before(&self, cycles: usize) -> [f64; LEGS] {
        self.sent[self.sent.len().saturating_sub(1 + cycles)]
    }

    /// Forces of rest, with this acceleration of a platform of so many times its mass.
    fn forces(&self, mass_ratio: f64, acceleration: [f64; 6]) -> [f64; LEGS] {
        let mut machine = self.machine.clone();
        machine.platform.mass_kg *= mass_ratio;
        let motion = TaskState::at_rest(self.x).motion();
        let acceleration = Acceleration::from_vector(&acceleration.into());
        InverseDynamics::new(&machine).forces::<Exact>(&Motion { acceleration, ..motion }).unwrap()
    }

    /// The platform carries so many times its mass more than before.
    fn loads(&self, force: &mut [f64; LEGS], ratio: f64) {
        let [loaded, usual] = [1.0 + ratio, 1.0].map(|ratio| self.forces(ratio, [0.0; 6]));
        *force = core::array::from_fn(|leg| force[leg] - loaded[leg] + usual[leg]);
    }

    /// Something pushes the platform with this acceleration.
    fn pushes(&self, force: &mut [f64; LEGS], acceleration: [f64; 6]) {
        let [pushed, usual] = [acceleration, [0.0; 6]].map(|acceleration| self.forces(1.0, acceleration));
        *force = core::array::from_fn(|leg| force[leg] + pushed[leg] - usual[leg]);
    }

    fn most(&self) -> f64 {
        self.machine.actuator.max_force_n
    }
}

/// Where a failure acts.
pub enum Part {
    Sensor(fn(&mut Measurement, &mut Context<'_>)),
    Drive(fn(&mut [f64; LEGS], &mut Context<'_>)),
    /// On the force, and on what the driver reports.
    Reported(fn(&mut [f64; LEGS], &mut Context<'_>), fn(&mut DriveStatus, &Context<'_>)),
    /// Lengths of two legs, and of a whole exchange their forces, are exchanged from the first cycle on.
    Exchanged(Exchange, [usize; 2]),
}

/// What is exchanged between two legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchange {
    Lengths,
    LengthsAndDrives,
    /// The same, and another sensor sends the true pose.
    WithExternalPose,
}

/// The leg that fails.
const LEG: usize = 1;
const ALL: u32 = (1 << LEGS) - 1;
/// Cycles in a millisecond.
const PER_MS: usize = 1;

const fn sensor(name: &'static str, fail: fn(&mut Measurement, &mut Context<'_>)) -> (&'static str, Part) {
    (name, Part::Sensor(fail))
}

const fn drive(name: &'static str, fail: fn(&mut [f64; LEGS], &mut Context<'_>)) -> (&'static str, Part) {
    (name, Part::Drive(fail))
}

/// What fails, by its name in the table.
pub type Failure = (&'static str, Part);

/// Lengths that freeze.
pub const FROZEN: &[Failure] = &[
    sensor("one", |m, c| freezes::<1>(m, c)),
    sensor("two", |m, c| freezes::<2>(m, c)),
    sensor("three", |m, c| freezes::<3>(m, c)),
    sensor("four", |m, c| freezes::<4>(m, c)),
    sensor("five", |m, c| freezes::<5>(m, c)),
    sensor("all six", |m, c| freezes::<6>(m, c)),
];

fn freezes<const COUNT: usize>(measurement: &mut Measurement, context: &Context<'_>) {
    measurement.length_m[..COUNT].copy_from_slice(&context.first.length_m[..COUNT]);
}

/// Failures of which the worst leg or pair of legs is searched, on these machines; the legs here are examples.
pub const WORST: &[(Failure, &[&str])] = &[
    (("two lengths exchanged", Part::Exchanged(Exchange::Lengths, [0, 1])), MACHINES),
    (("lengths and drives exchanged, `motion_base`", AS_WHOLE), &["motion_base"]),
    (("lengths and drives exchanged, other machines", AS_WHOLE), &["reference", "fried2008", "tsai2000"]),
    (sensor("one quiet length frozen", |_, _| {}), MACHINES),
];
const MACHINES: &[&str] = &["motion_base", "reference", "fried2008", "tsai2000"];
const AS_WHOLE: Part = Part::Exchanged(Exchange::LengthsAndDrives, [0, 1]);

/// A quiet length that freezes, of each leg.
pub fn freezes_one() -> [Part; LEGS] {
    [freezes_at::<0>, freezes_at::<1>, freezes_at::<2>, freezes_at::<3>, freezes_at::<4>, freezes_at::<5>]
        .map(Part::Sensor)
}

fn freezes_at<const LEG: usize>(measurement: &mut Measurement, context: &mut Context<'_>) {
    measurement.length_m[LEG] = context.first.length_m[LEG];
}

/// Every failure with its name.
pub const FAILURES: &[Failure] = &[
    sensor("all lengths frozen, stamps fresh", |m, c| m.length_m = c.first.length_m),
    sensor("one length frozen", |m, c| m.length_m[LEG] = c.first.length_m[LEG]),
    sensor("two lengths frozen", |m, c| {
        m.length_m[LEG] = c.first.length_m[LEG];
        m.length_m[4] = c.first.length_m[4];
    }),
    sensor("one length jumps by 1 mm", |m, _| m.length_m[LEG] += 1e-3),
    sensor("one length jumps by 0.1 mm", |m, _| m.length_m[LEG] += 1e-4),
    sensor("one length drifts by 1 mm/s", |m, c| m.length_m[LEG] += 1e-3 * c.since_s),
    sensor("one length drifts by 10 mm/s", |m, c| m.length_m[LEG] += 1e-2 * c.since_s),
    sensor("one scale 1 % too large", |m, c| {
        m.length_m[LEG] += 0.01 * (m.length_m[LEG] - c.first.length_m[LEG])
    }),
    sensor("one scale 10 % too large", |m, c| {
        m.length_m[LEG] += 0.1 * (m.length_m[LEG] - c.first.length_m[LEG])
    }),
    sensor("one length counts backwards", |m, c| {
        m.length_m[LEG] = 2.0 * c.first.length_m[LEG] - m.length_m[LEG]
    }),
    ("two lengths exchanged", Part::Exchanged(Exchange::Lengths, [LEG, LEG + 1])),
    ("two legs exchanged, lengths and drives", Part::Exchanged(Exchange::LengthsAndDrives, [LEG, LEG + 1])),
    ("two legs exchanged, external pose", Part::Exchanged(Exchange::WithExternalPose, [LEG, LEG + 1])),
    sensor("one length reads zero", |m, _| m.length_m[LEG] = 0.0),
    sensor("one length is not a number", |m, _| m.length_m[LEG] = f64::NAN),
    sensor("noise of 0.1 mm on one length", |m, c| m.length_m[LEG] += 1e-4 * c.random.near_gaussian()),
    sensor("noise of 1 mm on one length", |m, c| m.length_m[LEG] += 1e-3 * c.random.near_gaussian()),
    sensor("one length in steps of 0.5 mm", |m, _| m.length_m[LEG] = (m.length_m[LEG] / 5e-4).round() * 5e-4),
    sensor("no measurements", |m, c| *m = c.first),
    sensor("every second measurement missing", |m, c| {
        if c.measured.len() % 2 == 0 {
            *m = c.measured_before(1);
        }
    }),
    sensor("stamps frozen, lengths fresh", |m, c| m.time_ns = c.first.time_ns),
    sensor("measurements 5 ms late", |m, c| *m = c.measured_before(5 * PER_MS)),
    sensor("measurements 30 ms late", |m, c| *m = c.measured_before(30 * PER_MS)),
    sensor("lengths 5 ms late, stamps fresh", |m, c| m.length_m = c.measured_before(5 * PER_MS).length_m),
    sensor("lengths 20 ms late, stamps fresh", |m, c| m.length_m = c.measured_before(20 * PER_MS).length_m),
    sensor("stamps 5 ms ahead", |m, _| m.time_ns += 5_000_000),
    sensor("one length frozen, external pose", |m, c| {
        m.length_m[LEG] = c.first.length_m[LEG];
        m.pose = Some(c.x);
    }),
    sensor("one length drifts by 10 mm/s, external pose", |m, c| {
        m.length_m[LEG] += 1e-2 * c.since_s;
        m.pose = Some(c.x);
    }),
    sensor("one scale 10 % too large, external pose", |m, c| {
        m.length_m[LEG] += 0.1 * (m.length_m[LEG] - c.first.length_m[LEG]);
        m.pose = Some(c.x);
    }),
    drive("one drive without force", |f, _| f[LEG] = 0.0),
    drive("one drive with half of its force", |f, _| f[LEG] *= 0.5),
    drive("one drive with 10 % less", |f, _| f[LEG] *= 0.9),
    drive("one drive with its largest force", |f, c| f[LEG] = c.most()),
    drive("one drive pushes the wrong way", |f, _| f[LEG] = -f[LEG]),
    drive("one drive holds its last force", |f, c| f[LEG] = c.sent_before((1e3 * c.since_s) as usize)[LEG]),
    drive("one drive oscillates by 10 % at 30 Hz", |f, c| {
        f[LEG] += 0.1 * c.most() * (30.0 * core::f64::consts::TAU * c.since_s).sin();
    }),
    drive("all drives without force", |f, _| *f = [0.0; LEGS]),
    drive("all drives with 20 % less", |f, _| *f = f.map(|force| 0.8 * force)),
    drive("all drives hold their last forces", |f, c| *f = c.sent_before((1e3 * c.since_s) as usize)),
    drive("forces 5 ms late", |f, c| *f = c.sent_before(5 * PER_MS)),
    drive("forces 4 ms late: the loop oscillates", |f, c| *f = c.sent_before(4 * PER_MS)),
    drive("forces 20 ms late", |f, c| *f = c.sent_before(20 * PER_MS)),
    drive("a load of 20 % of the platform falls off", |f, c| c.loads(f, -0.2)),
    drive("a load of 20 % of the platform comes on", |f, c| c.loads(f, 0.2)),
    drive("a load of 5 % of the platform comes on", |f, c| c.loads(f, 0.05)),
    drive("an impact of 1 g for 10 ms, sideways", |f, c| {
        if c.since_s < 0.0095 {
            c.pushes(f, [0.0, 0.0, 0.0, 9.81, 0.0, 0.0]);
        }
    }),
    drive("an impact of 1 g for 10 ms, from below", |f, c| {
        if c.since_s < 0.0095 {
            c.pushes(f, [0.0, 0.0, 0.0, 0.0, 0.0, 9.81]);
        }
    }),
    ("one drive reports a fault", Part::Reported(|_, _| {}, |d, _| d.fault = Some(1 << LEG))),
    (
        "one drive disabled, reported",
        Part::Reported(|f, _| f[LEG] = 0.0, |d, _| d.enabled = Some(ALL & !(1 << LEG))),
    ),
    (
        "one drive with half of its force, reported",
        Part::Reported(
            |f, _| f[LEG] *= 0.5,
            |d, c| {
                d.force_n = Some(c.sent_before(0));
                d.force_n.as_mut().unwrap()[LEG] *= 0.5;
            },
        ),
    ),
];
