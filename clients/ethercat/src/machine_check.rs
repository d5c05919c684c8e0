//! Contradictions between a drives file and a machine file.

use hexad_client::realtime::cyclic::ReleaseMode;
use hexad_core::model::LEGS;
use hexad_machine::config::Config;

use crate::drives_file::DrivesFile;

/// Everything in which the two files disagree.
pub fn contradictions(file: &DrivesFile, machine: &Config) -> Vec<String> {
    let actuator = &machine.machine.actuator;
    let realtime = &machine.deployment.realtime;
    let mut errors = vec![];
    if machine.name != file.bus.name {
        errors.push(format!("name = {:?}, the machine file has {:?}", file.bus.name, machine.name));
    }
    if realtime.release != ReleaseMode::External {
        errors.push(
            "the machine file needs [realtime] release = \"external\": the drives' clock releases the daemon"
                .into(),
        );
    }
    let period_us = realtime.period_s() * 1e6;
    if (period_us - f64::from(file.bus.period_us)).abs() > 0.5 {
        errors.push(format!("period_us = {}, the daemon's period is {period_us} us", file.bus.period_us));
    }
    for (number, leg) in (1..).zip(&file.legs) {
        let force_n = leg.max_force_n();
        if force_n < actuator.max_force_n {
            errors.push(format!(
                "leg[{number}]: {} thousandths of {} N m are {force_n:.0} N, less than actuator.max_force_n = {} N",
                leg.max_torque_permille, leg.rated_torque_n_m, actuator.max_force_n
            ));
        }
        let (range_m, stroke_m) = (leg.units().range_m(), actuator.max_length_m - actuator.min_length_m);
        if range_m <= stroke_m + 2.0 * STROKE_TOLERANCE_M {
            errors.push(format!(
                "leg[{number}]: position_bits = {}: the range of the encoder is {range_m:.3} m, must exceed the stroke of {stroke_m:.3} m \
                 by 0.01 m",
                leg.position_bits
            ));
        }
    }
    errors
}

/// Legs whose measured length is outside of the stroke. Encoders stop at the ends of the stroke within this tolerance \[m\].
const STROKE_TOLERANCE_M: f64 = 0.005;

/// Lengths outside of the stroke, in words.
pub fn lengths_outside(lengths_m: [Option<f64>; LEGS], machine: &Config) -> Vec<String> {
    let actuator = &machine.machine.actuator;
    let (low, high) =
        (actuator.min_length_m - STROKE_TOLERANCE_M, actuator.max_length_m + STROKE_TOLERANCE_M);
    let found = (1..).zip(lengths_m).filter_map(|(number, length_m)| {
        let length_m = length_m.filter(|length_m| !(low..=high).contains(length_m))?;
        let (low, high) = (actuator.min_length_m, actuator.max_length_m);
        Some(format!(
            "leg {number}: length {length_m:.4} m is outside of the stroke [{low}, {high}] m: measure its offset again (zero), or \
             correct counts_per_rev or position_bits"
        ))
    });
    found.collect()
}
