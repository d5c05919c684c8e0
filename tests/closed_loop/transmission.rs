//! Drives whose legs get another force than the drives are told: stated in the file, they cost no accuracy.

use hexad::config::Config;
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Gravity;
use hexad::model::task::TaskState;
use hexad::motion::built_in::BuiltInMotion;

use hexad_support::deployed;
use hexad_support::rig::{Tracking, track};

/// From an eighth too weak to an eighth too strong; screws that lose up to 4 % of their force.
const FORCE_SCALE: [f64; 6] = [0.88, 1.12, 0.95, 1.04, 1.0, 0.91];
const LOAD_FRICTION: [f64; 6] = [0.01, 0.04, 0.005, 0.02, 0.03, 0.015];
/// Length of a motion \[s\].
const SECONDS: f64 = 4.0;

fn tracked(config: &Config, platform: &Config) -> Tracking {
    track(config, &platform.machine, BuiltInMotion::Circle, SECONDS)
}

#[test]
fn stated_drives_cost_no_accuracy() {
    for name in ["fried2008", "motion_base", "tsai2000"] {
        let ideal = deployed(name);
        let [mut scaled, mut screws, mut dry] = [ideal.clone(), ideal.clone(), ideal.clone()];
        scaled.machine.actuator.force_scale = FORCE_SCALE;
        screws.machine.actuator.load_friction_share = LOAD_FRICTION;
        // Friction of the same size that does not depend on the load, which is smoothed alike where a leg turns around.
        let home = TaskState::at_rest(ideal.machine.home).motion();
        let held = inverse_dynamics::<Gravity>(&ideal.machine, &home).unwrap();
        dry.machine.actuator.coulomb_friction_n =
            core::array::from_fn(|leg| LOAD_FRICTION[leg] * held[leg].abs());
        let [by_ideal, by_scaled, by_screws, by_dry] =
            [&ideal, &scaled, &screws, &dry].map(|config| tracked(config, config).position.rms());
        let [off_scaled, off_screws] = [&scaled, &screws].map(|platform| {
            let mut slightly = ideal.clone();
            let (to, from) = (&mut slightly.machine.actuator, &platform.machine.actuator);
            to.force_scale = from.force_scale.map(|scale| 1.0 + 0.1 * (scale - 1.0));
            to.load_friction_share = from.load_friction_share.map(|friction| 0.3 * friction);
            tracked(&ideal, &slightly).position.rms()
        });
        println!(
            "{name}, RMS: ideal {by_ideal:.1e} m, scaled {by_scaled:.1e} m, screws {by_screws:.1e} m, dry {by_dry:.1e} m; \
             unstated: a tenth of the scale {off_scaled:.1e} m, a third of the screws {off_screws:.1e} m"
        );
        assert!(by_scaled < 1.1 * by_ideal, "{name}");
        assert!(by_screws < 1.5 * by_dry, "{name}");
        // The comparison sees them.
        assert!(off_scaled > 3.0 * by_scaled && off_screws > 1.5 * by_screws, "{name}");
    }
}
