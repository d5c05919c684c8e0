//! Imperfections of hardware beyond the model. All are off by default: the plant is then the model.
//!
//! | imperfection | where it acts |
//! | --- | --- |
//! | force step, dead time, bandwidth | between the force message and the drive, in this order |
//! | friction with stiction | on the drive, beyond that of `actuator` |
//! | stiffness, damping, backlash | between drive and rod; reflected mass and friction stay with the drive |
//! | steps and noise of sensors | on the lengths and rates that are published |
//! | payload, joints | on the machine, once |
//! | external wrench | on the platform, at C |
//!
//! Random numbers come from one seed: the same seed and the same forces give the same run, bit for bit.

#[cfg(not(feature = "std"))]
use nalgebra::ComplexField as _;
use nalgebra::Vector3;

use crate::model::LEGS;
use crate::model::machine::{Joints, Machine};
use crate::model::random::Random;
use crate::model::rigid::Wrench;

/// All imperfections of a plant; by default there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Imperfections {
    /// Seed of the random numbers.
    pub seed: u64,
    /// Force step, dead time, bandwidth.
    pub drive: DriveErrors,
    /// Friction beyond that of the machine.
    pub friction: Friction,
    /// Elastic legs; `None` if they are rigid.
    pub leg: Option<ElasticLeg>,
    /// Noise and resolution.
    pub sensor: SensorErrors,
    /// Payload and joints that differ from the configuration.
    pub build: BuildErrors,
    /// Disturbance on the platform.
    pub external: ExternalWrench,
}

/// Errors of the drives between the commanded and the applied force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveErrors {
    /// Corner frequency of the first-order lag of the force \[Hz\]; `None` if it follows at once.
    pub bandwidth_hz: Option<f64>,
    /// Smallest difference of forces \[N\]; 0 if there is none.
    pub force_step_n: f64,
    /// From the command to the drive \[ns\].
    pub dead_time_ns: u64,
}

/// Friction of a leg against the rate v: `viscous_n_s_m v + (coulomb_n + stiction_n exp(-(v / stribeck_speed_m_s)^2)) sign(v)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// \[N s/m\]
    pub viscous_n_s_m: f64,
    /// \[N\]
    pub coulomb_n: f64,
    /// Excess of the breakaway force over sliding friction \[N\].
    pub stiction_n: f64,
    /// Speed at which most of the stiction is gone \[m/s\].
    pub stribeck_speed_m_s: f64,
}

/// Elastic leg: a spring with play between drive and rod.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElasticLeg {
    /// \[N/m\]
    pub stiffness_n_per_m: f64,
    /// \[N s/m\]
    pub damping_n_s_m: f64,
    /// Play from one flank to the other \[m\].
    pub backlash_m: f64,
}

/// Errors of the sensors of lengths and rates. Noise is Gaussian and added before the value is rounded to a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorErrors {
    /// Resolution of lengths \[m\]; 0 if they are not rounded.
    pub length_step_m: f64,
    /// Resolution of rates \[m/s\]; 0 if they are not rounded.
    pub rate_step_m_s: f64,
    /// Standard deviation of lengths \[m\].
    pub length_noise_m: f64,
    /// Standard deviation of rates \[m/s\].
    pub rate_noise_m_s: f64,
}

/// Differences of the machine as built from the machine as configured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildErrors {
    /// Point mass on the platform \[kg\]; negative where the machine lacks what its configuration has.
    pub payload_kg: f64,
    /// Its place, platform axes \[m\].
    pub payload_at_m: Vector3<f64>,
    /// Standard deviation of each coordinate of the twelve joint centres \[m\].
    pub joint_deviation_m: f64,
}

/// External wrench on the platform: `wrench cos(2 pi frequency t)`, t from the start of the plant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExternalWrench {
    /// About C, base axes.
    pub wrench: Wrench,
    /// \[Hz\]; 0 if it is constant.
    pub frequency_hz: f64,
}

impl Friction {
    /// Stribeck speed of a usual drive with greased bearings \[m/s\].
    pub const STRIBECK_SPEED_M_S: f64 = 0.01;

    /// The force against `rate_m_s`. Its sign is proportional below the speed `smoothing_m_s`.
    pub fn force(&self, rate_m_s: f64, smoothing_m_s: f64) -> f64 {
        let sign = (rate_m_s / smoothing_m_s).clamp(-1.0, 1.0);
        let share = rate_m_s / self.stribeck_speed_m_s;
        self.viscous_n_s_m * rate_m_s + (self.coulomb_n + self.stiction_n * (-share * share).exp()) * sign
    }

    /// Coulomb friction and stiction together \[N\].
    pub fn dry(&self) -> f64 {
        self.coulomb_n + self.stiction_n
    }

    /// Whether there is any friction.
    pub fn any(&self) -> bool {
        self.viscous_n_s_m != 0.0 || self.dry() != 0.0
    }
}

impl ElasticLeg {
    /// Force \[N\] that pushes drive and rod apart when the drive is `pressed_m` beyond the leg's length \[m\], at
    /// this rate \[m/s\]. None within the play.
    pub fn force(&self, pressed_m: f64, rate_m_s: f64) -> f64 {
        let half = 0.5 * self.backlash_m;
        let beyond = pressed_m - pressed_m.clamp(-half, half);
        if beyond == 0.0 { 0.0 } else { self.stiffness_n_per_m * beyond + self.damping_n_s_m * rate_m_s }
    }

    /// How far a drive is pressed beyond the leg's length at rest under this force \[m\].
    pub fn deflection(&self, force_n: f64) -> f64 {
        force_n / self.stiffness_n_per_m
            + if force_n == 0.0 { 0.0 } else { (0.5 * self.backlash_m).copysign(force_n) }
    }
}

impl ExternalWrench {
    /// The wrench `time_s` after the start of the plant.
    pub fn at(&self, time_s: f64) -> Wrench {
        let phase = core::f64::consts::TAU * self.frequency_hz * time_s;
        let Wrench { torque, force } = self.wrench;
        Wrench { torque: torque * phase.cos(), force: force * phase.cos() }
    }
}

impl Default for Friction {
    fn default() -> Self {
        Self {
            viscous_n_s_m: 0.0,
            coulomb_n: 0.0,
            stiction_n: 0.0,
            stribeck_speed_m_s: Self::STRIBECK_SPEED_M_S,
        }
    }
}

impl BuildErrors {
    /// The machine as built, its joints displaced by random numbers.
    pub fn built(&self, machine: &Machine, random: &mut Random) -> Machine {
        let mut built = machine.clone();
        if self.payload_kg != 0.0 {
            self.load(&mut built);
        }
        if self.joint_deviation_m > 0.0 {
            self.displace(&mut built, random);
        }
        built
    }

    /// Adds the payload to the platform: common centre of mass, parallel-axis theorem.
    fn load(&self, machine: &mut Machine) {
        let body = &mut machine.platform;
        let arm = self.payload_at_m - body.center_of_mass_m;
        let mass = body.mass_kg + self.payload_kg;
        let reduced = body.mass_kg * self.payload_kg / mass;
        body.center_of_mass_m += arm * (self.payload_kg / mass);
        body.inertia -= arm.cross_matrix() * arm.cross_matrix() * reduced;
        body.mass_kg = mass;
    }

    fn displace(&self, machine: &mut Machine, random: &mut Random) {
        let joints = &machine.joints;
        let mut displaced = |points: [Vector3<f64>; LEGS]| {
            points
                .map(|point| point + Vector3::from_fn(|_, _| self.joint_deviation_m * random.near_gaussian()))
        };
        let base = displaced(joints.triples.unpack_vectors(&joints.base));
        let platform = displaced(joints.triples.unpack_vectors(&joints.platform));
        let axes = joints.triples.unpack_vectors(&joints.universal_axis);
        machine.joints = Joints::new(&base, &platform, &axes, &machine.home_pose());
    }
}
