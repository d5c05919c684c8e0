//! The machines that the adversary drives, with other rates and limits.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock};

use hexad::config::Config;
use hexad::config::control_loops::loops;

use crate::edited::{deployed_table, set, table};
use crate::{MACHINES as WITH_VECTORS, data};

/// The machines of `tests/data`, and the one that explains every key.
pub const MACHINES: [&str; 11] = {
    let mut names = ["reference"; 11];
    let mut index = 0;
    while index < WITH_VECTORS.len() {
        names[index] = WITH_VECTORS[index];
        index += 1;
    }
    names
};

/// Cycles per second \[Hz\].
pub const RATES_HZ: [f64; 10] =
    [100.0, 250.0, 500.0, 1000.0, 1000.0, 1000.0, 2000.0, 5000.0, 10_000.0, 20_000.0];
/// Factors on the default limits of velocity, acceleration and jerk.
pub const LIMIT_FACTORS: [[f64; 3]; 8] = [
    [1.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
    [0.2, 1.0, 1.0],
    [1.0, 1.0, 0.1],
    [1.0, 0.2, 0.1],
    [1.0, 1.0, 10.0],
    [0.5, 2.0, 1.0],
    [0.3, 0.1, 0.02],
];
/// Defaults of velocity, acceleration and jerk: of the position \[m\], of the orientation \[rad\].
const DEFAULTS: [[f64; 3]; 2] = [[1.0, 5.0, 500.0], [2.0, 20.0, 2000.0]];
/// `autonomous_scale`.
pub const AUTONOMOUS: [f64; 3] = [0.2, 1.0, 0.05];

/// Factor on the drives' forces, and with them on the rate of the forces.
pub const STRONGER: f64 = 10.0;

/// Factor on the default rate of the forces, which rise in this time \[s\].
const FASTER: f64 = 10.0;
const FORCE_RISE_S: f64 = 0.01;

/// Which of the values above.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    pub machine: usize,
    pub rate: usize,
    pub limits: usize,
    pub autonomous: usize,
}

/// The configuration of a variant, validated once.
pub fn variant(variant: Variant) -> Arc<Config> {
    static CACHE: OnceLock<Mutex<HashMap<Variant, Arc<Config>>>> = OnceLock::new();
    let cache = CACHE.get_or_init(Mutex::default);
    if let Some(config) = cache.lock().unwrap().get(&variant) {
        return config.clone();
    }
    let config = Arc::new(edited(variant));
    cache.lock().unwrap().insert(variant, config.clone());
    config
}

/// With the rate, or the next one with which the control loops are stable and the limits can be kept: `check` refuses slower ones.
fn edited(variant: Variant) -> Config {
    let mut configs = RATES_HZ.iter().skip(variant.rate).filter_map(|rate_hz| at_rate(variant, *rate_hz));
    let is_stable = |config: &Config| loops(&config.deployment).iter().all(|each| each.sampled.is_stable());
    configs.find(is_stable).expect("a rate that is fast enough")
}

fn at_rate(Variant { machine, limits, autonomous, .. }: Variant, rate_hz: f64) -> Option<Config> {
    let name = MACHINES[machine];
    let mut table = if name == "reference" { deployed_table(name) } else { table(&data(name, "toml")) };
    // The deployment's defaults for every machine: they depend on the rate and on the limits.
    for section in ["realtime", "control", "limits", "setpoint", "timeouts", "plant", "envelope"] {
        table.remove(section);
    }
    // The plant smooths dry friction more than the model does: it would not be the exact plant.
    set(&mut table, "actuator", "coulomb_friction_n", 0.0);
    // Forces are no limit of a reference: a drive too weak for the limits leaves it, whatever the controller does.
    let max_force_n = table["actuator"]["max_force_n"].as_float().unwrap();
    set(&mut table, "actuator", "max_force_n", STRONGER * max_force_n);
    // Nor is their rate: with the jerk limits of some variants the forces change faster than drives.
    set(&mut table, "limits", "force_rate_n_s", FASTER * STRONGER * max_force_n / FORCE_RISE_S);
    set(&mut table, "realtime", "rate_hz", rate_hz);
    let keys = [
        ["velocity_m_s", "acceleration_m_s2", "jerk_m_s3"],
        ["velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3"],
    ];
    for (keys, defaults) in keys.iter().zip(DEFAULTS) {
        let [velocity, acceleration, jerk]: [f64; 3] =
            core::array::from_fn(|order| defaults[order] * LIMIT_FACTORS[limits][order]);
        // With more, the whole acceleration could change within the time for which a force is held.
        let jerk = jerk.min(acceleration * rate_hz);
        for (key, limit) in keys.iter().zip([velocity, acceleration, jerk]) {
            set(&mut table, "limits", key, limit);
        }
    }
    set(&mut table, "limits", "autonomous_scale", AUTONOMOUS[autonomous]);
    match Config::parse(&table.to_string(), "edited") {
        Ok(config) => Some(config),
        Err(error) => {
            assert!(error.to_string().contains("turn with the legs"), "{error}");
            None
        }
    }
}
