//! `[plant]`: the simulated hardware, and its differences from the model.

use nalgebra::Vector3;

use super::{MAX_BRAKE_DECELERATION_M_S2, default_timeout_ms, timeout_s};
use crate::config::bound::Bound;
use crate::config::machine::rounded;
use crate::config::reader::SectionReader;
use hexad_core::model::machine::Machine;
use hexad_core::model::rigid::Wrench;
use hexad_core::plant::hardware::Hardware;
use hexad_core::plant::imperfections::{
    BuildErrors, DriveErrors, ElasticLeg, ExternalWrench, Friction, Imperfections, SensorErrors,
};
use hexad_core::plant::terms::PlantTerms;

/// Bounds of the integration step \[us\]: below, the simulation is slower than real time; above, its drives are unstable.
const MIN_STEP_US: f64 = 10.0;
const MAX_STEP_US: f64 = 1000.0;
/// Default of `tolerance_um`: a tenth of the resolution of a good encoder.
const DEFAULT_TOLERANCE_UM: f64 = 0.1;
/// Longest dead time of a drive \[us\].
const MAX_DEAD_TIME_US: f64 = 10_000.0;

/// Section `[plant]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// Time without a force command after which the brakes close.
    pub force_timeout_s: f64,
    /// Deceleration of each leg by the brakes.
    pub brake_deceleration_m_s2: f64,
    /// Longest step of the integration.
    pub step_s: f64,
    /// Tolerance of positions; decides which imperfections are evaluated, and in what steps.
    pub tolerance_m: f64,
    /// Differences from the model.
    pub imperfections: Imperfections,
}

impl Plant {
    /// Simulated hardware of a machine.
    pub fn hardware(&self, machine: &Machine) -> Hardware {
        let Self { brake_deceleration_m_s2, step_s, tolerance_m, ref imperfections, .. } = *self;
        Hardware::new(machine, brake_deceleration_m_s2, step_s, tolerance_m, imperfections)
    }
}

pub(super) fn read(mut section: SectionReader, rate_hz: f64, machine: &Machine) -> Plant {
    let brake = Bound::PositiveUpTo(MAX_BRAKE_DECELERATION_M_S2);
    let step = Bound::Within(MIN_STEP_US, MAX_STEP_US);
    let plant = Plant {
        force_timeout_s: timeout_s(
            &mut section,
            "force_timeout_ms",
            default_timeout_ms(50.0, rate_hz),
            rate_hz,
        ),
        brake_deceleration_m_s2: section.number_or("brake_deceleration_m_s2", 9.81, brake),
        step_s: section.number_or("step_us", 250.0, step) / 1e6,
        tolerance_m: section.number_or("tolerance_um", DEFAULT_TOLERANCE_UM, Bound::PositiveUpTo(1000.0))
            / 1e6,
        imperfections: Imperfections {
            seed: u64::try_from(section.integer_or("seed", 1, 0, i32::MAX)).unwrap_or_default(),
            drive: drive(section.section("drive")),
            friction: friction(section.section("friction")),
            leg: leg(section.section("leg"), machine),
            sensor: sensor(section.section("sensor")),
            build: build(section.section("build")),
            external: external(section.section("external")),
        },
    };
    let needed_us =
        1e6 * PlantTerms::choose(machine, &plant.imperfections, plant.step_s, plant.tolerance_m).step_s;
    if needed_us < MIN_STEP_US {
        section.reject_as(
            "step_us",
            format!("{} needed by plant.drive, plant.leg and plant.friction", rounded(needed_us)),
            format!("must be at least {MIN_STEP_US}: more tolerance_um, a softer leg, less friction"),
        );
    }
    plant
}

fn drive(mut section: SectionReader) -> DriveErrors {
    let dead_time_us = section.number_or("dead_time_us", 0.0, Bound::Within(0.0, MAX_DEAD_TIME_US));
    DriveErrors {
        bandwidth_hz: section.optional_number("bandwidth_hz", Bound::Positive),
        force_step_n: section.number_or("force_step_n", 0.0, Bound::NotNegative),
        dead_time_ns: (1e3 * dead_time_us).round() as u64,
    }
}

fn friction(mut section: SectionReader) -> Friction {
    Friction {
        viscous_n_s_m: section.number_or("viscous_n_s_m", 0.0, Bound::NotNegative),
        coulomb_n: section.number_or("coulomb_n", 0.0, Bound::NotNegative),
        stiction_n: section.number_or("stiction_n", 0.0, Bound::NotNegative),
        stribeck_speed_m_s: section.number_or(
            "stribeck_speed_m_s",
            Friction::STRIBECK_SPEED_M_S,
            Bound::Positive,
        ),
    }
}

fn leg(mut section: SectionReader, machine: &Machine) -> Option<ElasticLeg> {
    let stiffness = section.optional_number("stiffness_n_m", Bound::Positive);
    let damping_n_s_m = section.number_or("damping_n_s_m", 0.0, Bound::NotNegative);
    let backlash_m = section.number_or("backlash_m", 0.0, Bound::NotNegative);
    if stiffness.is_some() && machine.actuator.reflected_mass_kg == 0.0 {
        section.reject(
            "stiffness_n_m",
            "must not be given with actuator.reflected_mass_kg = 0: a drive behind a spring has mass",
        );
    }
    if stiffness.is_none() && backlash_m > 0.0 {
        section.reject("backlash_m", "must be 0 without stiffness_n_m: the flanks of a backlash are springs");
    }
    stiffness.map(|stiffness_n_per_m| ElasticLeg { stiffness_n_per_m, damping_n_s_m, backlash_m })
}

fn sensor(mut section: SectionReader) -> SensorErrors {
    let mut number = |key| section.number_or(key, 0.0, Bound::NotNegative);
    SensorErrors {
        length_step_m: number("length_step_m"),
        rate_step_m_s: number("rate_step_m_s"),
        length_noise_m: number("length_noise_m"),
        rate_noise_m_s: number("rate_noise_m_s"),
    }
}

fn build(mut section: SectionReader) -> BuildErrors {
    BuildErrors {
        payload_kg: section.number_or("payload_kg", 0.0, Bound::NotNegative),
        payload_at_m: Vector3::from(section.vector_or("payload_position_m", [0.0; 3])),
        joint_deviation_m: section.number_or("joint_error_m", 0.0, Bound::NotNegative),
    }
}

fn external(mut section: SectionReader) -> ExternalWrench {
    ExternalWrench {
        wrench: Wrench {
            force: Vector3::from(section.vector_or("force_n", [0.0; 3])),
            torque: Vector3::from(section.vector_or("torque_n_m", [0.0; 3])),
        },
        frequency_hz: section.number_or("frequency_hz", 0.0, Bound::NotNegative),
    }
}
