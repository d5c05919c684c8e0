//! What hardware has and a model leaves out. Everything is off by default: the plant is then the model.
//!
//! | what | where it acts |
//! | --- | --- |
//! | force step, dead time, bandwidth | on the way from the force message to the drive, in this order |
//! | friction with stiction | on the drive, beyond what `actuator` has |
//! | stiffness, damping, backlash | between drive and rod; reflected mass and friction stay with the drive |
//! | steps and noise of sensors | on the lengths and rates that are published |
//! | payload, joints | on the machine, once |
//! | external wrench | on the platform, at C |
//!
//! Random numbers come from one seed: the same seed and the same forces give the same run, bit for bit.

#[cfg(not(feature = "client"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector3;

use crate::model::machine::{Joints, LEGS, Machine};
use crate::model::rigid::Wrench;
use crate::model::task::TaskState;

use super::random::Random;

/// All of it; the default is none of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Imperfections {
    /// What random numbers start from.
    pub seed: u64,
    pub drive: DriveErrors,
    pub friction: Friction,
    /// Legs that give way; `None` if they are rigid.
    pub leg: Option<ElasticLeg>,
    pub sensor: SensorErrors,
    pub build: BuildErrors,
    pub external: ExternalWrench,
}

/// What a drive makes of a commanded force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveErrors {
    /// Corner frequency of the first-order lag of the force \[Hz\]; `None` if it follows at once.
    pub bandwidth_hz: Option<f64>,
    /// Smallest difference of forces \[N\]; 0 if there is none.
    pub force_step: f64,
    /// From the command to the drive \[ns\].
    pub dead_time_ns: u64,
}

/// Friction of a leg against the rate v: `viscous v + (coulomb + stiction exp(-(v / stribeck_speed)^2)) sign(v)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// \[N s/m\]
    pub viscous: f64,
    /// \[N\]
    pub coulomb: f64,
    /// By how much breaking loose takes more than sliding \[N\].
    pub stiction: f64,
    /// Speed at which most of the stiction is gone \[m/s\].
    pub stribeck_speed: f64,
}

/// A leg that is a spring between drive and rod, with play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElasticLeg {
    /// \[N/m\]
    pub stiffness: f64,
    /// \[N s/m\]
    pub damping: f64,
    /// From one flank to the other \[m\].
    pub backlash: f64,
}

/// What sensors make of lengths and rates. Noise is Gaussian and added before the value is rounded to a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorErrors {
    /// \[m\], \[m/s\]; 0 if the value is not rounded.
    pub length_step: f64,
    pub rate_step: f64,
    /// Standard deviations \[m\], \[m/s\].
    pub length_noise: f64,
    pub rate_noise: f64,
}

/// How the machine that was built differs from the one that is configured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildErrors {
    /// A point mass on the platform \[kg\], and where, platform axes \[m\].
    pub payload: f64,
    pub payload_at: Vector3<f64>,
    /// Standard deviation of each coordinate of the twelve joint centres \[m\].
    pub joints: f64,
}

/// What else pushes the platform: `wrench cos(2 pi frequency t)`, t since the plant was started.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExternalWrench {
    /// About C, base axes.
    pub wrench: Wrench,
    /// \[Hz\]; 0 if it is constant.
    pub frequency_hz: f64,
}

impl Friction {
    /// The usual speed for a drive with greased bearings \[m/s\].
    pub const STRIBECK_SPEED_M_S: f64 = 0.01;

    /// The force against `rate`. Its sign is proportional below the speed `smoothing`.
    pub fn force(&self, rate: f64, smoothing: f64) -> f64 {
        let sign = (rate / smoothing).clamp(-1.0, 1.0);
        let share = rate / self.stribeck_speed;
        self.viscous * rate + (self.coulomb + self.stiction * (-share * share).exp()) * sign
    }

    /// Force at the end of the range where the sign is proportional, at most \[N\].
    pub fn dry(&self) -> f64 {
        self.coulomb + self.stiction
    }

    /// Whether there is any.
    pub fn any(&self) -> bool {
        self.viscous != 0.0 || self.dry() != 0.0
    }
}

impl ElasticLeg {
    /// The force that pushes drive and rod apart when the drive is `pressed` beyond the leg's length \[m\], at
    /// this rate \[m/s\]. None within the play.
    pub fn force(&self, pressed: f64, rate: f64) -> f64 {
        let half = 0.5 * self.backlash;
        let beyond = pressed - pressed.clamp(-half, half);
        if beyond == 0.0 { 0.0 } else { self.stiffness * beyond + self.damping * rate }
    }

    /// How far a drive is pressed beyond the leg's length at rest under this force \[m\].
    pub fn deflection(&self, force: f64) -> f64 {
        force / self.stiffness + if force == 0.0 { 0.0 } else { (0.5 * self.backlash).copysign(force) }
    }
}

impl ExternalWrench {
    /// The wrench `time` after the start of the plant.
    pub fn at(&self, time: f64) -> Wrench {
        let phase = core::f64::consts::TAU * self.frequency_hz * time;
        let Wrench { torque, force } = self.wrench;
        Wrench { torque: torque * phase.cos(), force: force * phase.cos() }
    }
}

impl Default for Friction {
    fn default() -> Self {
        Self { viscous: 0.0, coulomb: 0.0, stiction: 0.0, stribeck_speed: Self::STRIBECK_SPEED_M_S }
    }
}

impl BuildErrors {
    /// The machine as built.
    pub fn built(&self, machine: &Machine, random: &mut Random) -> Machine {
        let mut built = machine.clone();
        if self.payload > 0.0 {
            self.load(&mut built);
        }
        if self.joints > 0.0 {
            self.displace(&mut built, random);
        }
        built
    }

    /// Two bodies become one: common centre, parallel axes.
    fn load(&self, machine: &mut Machine) {
        let body = &mut machine.platform;
        let arm = self.payload_at - body.center_of_mass;
        let mass = body.mass + self.payload;
        let reduced = body.mass * self.payload / mass;
        body.center_of_mass += arm * (self.payload / mass);
        body.inertia -= arm.cross_matrix() * arm.cross_matrix() * reduced;
        body.mass = mass;
    }

    fn displace(&self, machine: &mut Machine, random: &mut Random) {
        let joints = &machine.joints;
        let mut displaced = |points: [Vector3<f64>; LEGS]| {
            points.map(|point| point + Vector3::from_fn(|_, _| self.joints * random.gaussian()))
        };
        let base = displaced(joints.triples.unpack_vectors(&joints.base));
        let platform = displaced(joints.triples.unpack_vectors(&joints.platform));
        let axes = joints.triples.unpack_vectors(&joints.universal_axis);
        let home = TaskState::at_rest(machine.home).motion().pose;
        machine.joints = Joints::new(&base, &platform, &axes, &home);
    }
}
