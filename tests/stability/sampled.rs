//! The sampled loop: what the theory says of gains, delays, masses and sensors, and what controller and plant do.

use hexad::control::sampled::SampledLoop;
use hexad::control::state::Cause;
use hexad::host::config::Config;

use super::common::deployed;
use super::delayed::{Delayed, Setup, fastest};
use super::transition::Transition;

const LOOP: SampledLoop =
    SampledLoop { wn_t: f64::NAN, damping_ratio: 1.0, integral: 0.0, delay: 1.0, mass_ratio: 1.0 };

/// No gravity: nothing but the push moves the platform.
fn in_space() -> Config {
    let mut config = deployed("fried2008");
    config.machine.gravity.fill(0.0);
    config
}

#[test]
fn probe() {
    let config = in_space();
    for delay in [0.0, 0.5, 1.0, 1.6, 2.0] {
        let each = SampledLoop { delay, ..LOOP };
        let limit = each.largest_wn_t();
        for share in [0.2, 0.9, 0.98, 1.02, 1.1, 2.0] {
            let at = SampledLoop { wn_t: share * limit, ..each };
            let (cycles, cause) = Delayed::new(&config, &Setup::of(at)).run(2000);
            let rho = Transition::new(&at).spectral_radius();
            let n = cycles.len();
            let window = (n / 10).clamp(1, 50);
            let grow = |a: usize, b: usize| {
                (fastest(&cycles[b..b + window]) / fastest(&cycles[a..a + window])).powf(1.0 / (b - a) as f64)
            };
            println!("delay {delay} share {share} limit {limit:.4} rho {rho:.5}: {n} cycles {cause:?} {:?} first {:e} last {:e}", [
                grow(n / 8, n / 4), grow(n / 4, n / 2)], fastest(&cycles[..window]), fastest(&cycles[n - window..]));
        }
    }
}
