//! No limit is exceeded, whatever the targets, and each is approached.

use hexad::config::Config;
use hexad::control::constants::Constants;
use hexad::control::parameters::{Envelope, Parameters};
use hexad::control::reference::ReferenceGenerator;
use hexad::control::setpoint::motion::SetpointMotion;
use hexad::control::setpoint::target::Target;
use hexad::control::signals::limits::DerivativeLimits;
use hexad::model::random::Random;
use nalgebra::Vector6;
use rayon::prelude::*;

use super::observer::{Largest, examine};
use super::streams::Stream;
use hexad_support::certificate::Certificate;
use hexad_support::rig::parameters;
use hexad_support::{MACHINES, data};

const RATES_HZ: [u64; 6] = [100, 250, 1000, 1000, 4000, 20000];
const SECONDS: f64 = 3.0;
/// Runs of each machine.
const RUNS: u64 = 5;
const LONG_RUNS: u64 = 400;

/// Bounds of what [`examine`] finds.
pub const BOUNDS: [(&str, f64); 13] = [
    ("velocity", 1.0 + 1e-9),
    ("angular velocity", 1.0 + 1e-9),
    ("acceleration", 1.0 + 1e-9),
    ("angular acceleration", 1.0 + 1e-9),
    ("jerk", 1.0 + 1e-6),
    ("angular jerk", 1.0 + 1e-6),
    ("leg rate", 1.0),
    ("stroke", 2e-5),
    ("envelope angle", 1e-4),
    ("envelope position", 1e-8),
    ("condition", 1.0),
    ("determinant", 0.0),
    ("derivative", 1.0),
];

/// Limits, envelope and rate of a run by its seed.
fn setup(name: &str, seed: u64) -> (Constants, Vector6<f64>, f64) {
    let config = Config::load(&data(name, "toml")).unwrap();
    let mut random = Random::new(seed);
    let mut parameters: Parameters = parameters(&config);
    parameters.period_ns = 1_000_000_000 / RATES_HZ[(random.uniform() * RATES_HZ.len() as f64) as usize];
    let spread = |random: &mut Random, limits: &DerivativeLimits| {
        let mut factor = || 10.0_f64.powf(random.uniform() - 0.5);
        let velocity = limits.velocity * factor();
        DerivativeLimits {
            velocity,
            acceleration: limits.acceleration * factor(),
            jerk: limits.jerk * factor(),
        }
    };
    if random.uniform() < 0.6 {
        parameters.limits.position = spread(&mut random, &parameters.limits.position);
        parameters.limits.orientation = spread(&mut random, &parameters.limits.orientation);
    }
    let stroke = config.machine.actuator.stroke();
    let size = Vector6::new(0.6, 0.6, 0.8, 0.4 * stroke, 0.4 * stroke, 0.5 * stroke);
    if random.uniform() < 0.5 {
        let half = size.map(|size| size * 0.3 * random.uniform());
        let home = Vector6::from(config.machine.home);
        parameters.envelope = Some(Envelope { lowest: (home - half).into(), highest: (home + half).into() });
    }
    if random.uniform() < 0.3 {
        let at_home =
            hexad::model::kinematic_state::KinematicState::new(&config.machine, config.machine.home_pose());
        parameters.max_condition = at_home.sensitivity().condition * (1.1 + random.uniform());
    }
    let constants = Constants::new(&config.machine, parameters);
    (constants, size, parameters.period_ns as f64 * 1e-9)
}

fn run(name: &str, seed: u64) -> (Largest, u64) {
    let (constants, size, period_s) = setup(name, seed);
    let machine = constants.machine().clone();
    let mut stream = Stream::new(seed, &machine.home, &size);
    let mut reference = ReferenceGenerator::new(&constants);
    let home = *reference.motion();
    reference.verify_start(&constants, &home).ok();
    reference.begin_placed_motion(0);
    let samples = Default::default();
    let mut largest = Largest::default();
    let cycles = (SECONDS / period_s) as u64;
    for k in 0..cycles {
        let now_ns = k * constants.parameters.period_ns;
        let before = *reference.motion();
        let setpoint = stream.next(now_ns, k as f64 * period_s, period_s).map(SetpointMotion::new);
        let target = setpoint.as_ref().map(|setpoint| Target::of_setpoint(setpoint, &samples));
        let end_ns = now_ns + constants.parameters.period_ns;
        reference.advance(&constants, end_ns, target.as_ref());
        examine(&constants, &reference, &before, [now_ns, end_ns], &mut largest);
    }
    (largest, cycles)
}

/// Setpoints whose velocity is below the limit at the end of each cycle, and beyond it between.
#[test]
fn a_velocity_between_cycles_keeps_its_limit() {
    for name in ["fried2008", "scattered"] {
        let (largest, _) = run(name, 1_795_730_443 * 7919);
        let velocity = largest.0["velocity"];
        assert!((0.9999..1.0 + 1e-9).contains(&velocity), "{name}: {velocity:e}");
    }
}

#[test]
#[ignore = "second tier: takes long"]
fn certificate_every_limit_is_kept() {
    let machines = MACHINES.len() as u64;
    let certificate = Certificate::new("limits of the reference", machines * RUNS, machines * LONG_RUNS);
    let (runs, first) = (certificate.total() / machines, certificate.seed());
    let (mut all, mut cycles, mut failures) = (Largest::default(), 0, Vec::new());
    for name in MACHINES {
        let results: Vec<_> =
            (first..first + runs).into_par_iter().map(|seed| (seed, run(name, seed * 7919))).collect();
        let mut of_machine = Largest::default();
        for (seed, (largest, count)) in results {
            for (quantity, bound) in BOUNDS {
                let value = largest.0.get(quantity).copied().unwrap_or(f64::NEG_INFINITY);
                if value > bound {
                    let (constants, _, period_s) = setup(name, seed * 7919);
                    let limits = constants.parameters.limits;
                    failures.push(format!(
                        "{name} seed {seed}, period {period_s} s: {quantity} {value:e} > {bound}; {limits:?}"
                    ));
                }
            }
            of_machine.merge(&largest);
            cycles += count;
        }
        println!("{name}: {:.4?}", of_machine.0);
        all.merge(&of_machine);
        certificate.advance(runs);
    }
    println!("{:.6?}", all.0);
    certificate
        .finish(format_args!("{runs} runs of each machine, {cycles} cycles, {} failures", failures.len()));
    failures.sort();
    assert!(
        failures.is_empty(),
        "{} failures:\n{}",
        failures.len(),
        failures[..failures.len().min(40)].join("\n")
    );
}
