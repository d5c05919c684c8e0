//! `[control]`: the control law, its gains, and the conditions to engage.

use core::f64::consts::TAU;

use super::limits::DeploymentLimits;
use super::realtime::Realtime;
use crate::analysis::sampled_loop::{SampledLoop, boundary};
use crate::config::bound::Bound;
use crate::config::machine::rounded;
use crate::config::reader::SectionReader;
use crate::control::law::ControlMode;
use crate::control::leg_masses::LegMasses;
use crate::control::supervisor::AfterStop;
use crate::model::fidelity::Fidelity;
use crate::model::machine::Machine;

/// Default of the bandwidths where the rate carries it \[Hz\]: stiff enough for micrometres, soft enough for
/// a structure that is not quite rigid.
const DEFAULT_BANDWIDTH_HZ: f64 = 10.0;
/// Usual damping ratios; a ratio beyond them is a mistake.
const DAMPING_RATIO_BOUND: Bound = Bound::Within(0.1, 10.0);
/// Gain margin of the default bandwidths and of observers, and the least that is not warned of: the textbook's
/// 6 dB. A platform of half the modelled mass is still stable.
pub const GAIN_MARGIN: f64 = 2.0;
/// Largest bandwidth of the observer, as a multiple of the lesser bandwidth: what is faster only amplifies noise.
const MAX_OBSERVER_RATIO: f64 = 2.0;
/// Largest distances between platform and setpoint to engage; a greater one is a motion and needs a trajectory \[m\], \[rad\].
const MAX_ENGAGE_M: f64 = 0.1;
const MAX_ENGAGE_RAD: f64 = 0.2;
/// Largest following errors that a configuration may allow \[m\], \[rad\].
const MAX_FOLLOWING_M: f64 = 1.0;
const MAX_FOLLOWING_RAD: f64 = 1.0;
/// Default of the largest velocity errors over the velocity limits: far above the noise of rates, and reached by a free
/// fall within hundredths of a second.
const DEFAULT_VELOCITY_ERROR_RATIO: f64 = 0.3;

/// Section `[control]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// Law from errors to forces.
    pub mode: ControlMode,
    /// Natural frequency of the position error.
    pub position_bandwidth_hz: f64,
    /// Damping ratio of the position error.
    pub position_damping_ratio: f64,
    /// Natural frequency of the orientation error.
    pub orientation_bandwidth_hz: f64,
    /// Damping ratio of the orientation error.
    pub orientation_damping_ratio: f64,
    /// Largest distance between platform and setpoint to engage.
    pub engage_position_m: f64,
    /// The same for the angle between them.
    pub engage_orientation_rad: f64,
    /// Largest following error while the platform is controlled.
    pub following_position_m: f64,
    /// The same for the angle between them.
    pub following_orientation_rad: f64,
    /// Largest velocity error while the platform is controlled.
    pub following_velocity_m_s: f64,
    /// The same for the angular velocity.
    pub following_velocity_rad_s: f64,
    /// Terms of the dynamics that the loop evaluates.
    pub fidelity: FidelityChoice,
    /// Frequency below which the observer cancels disturbances; 0 is without observer.
    pub observer_bandwidth_hz: f64,
    /// State after the stop of a platform that lost its setpoint.
    pub on_setpoint_lost: AfterStop,
    /// Largest error [`FidelityChoice::Auto`] may make, as a share of the peak force of the envelope.
    pub fidelity_tolerance: f64,
    /// Effective masses of the legs at home, and the loop gains of their modes.
    pub leg_masses: LegMasses,
}

/// Choice of the model's fidelity, `control.fidelity`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FidelityChoice {
    /// The cheapest fidelity that the envelope allows.
    Auto,
    /// A configured fidelity, which has inertia.
    Fixed(Fidelity),
}

pub(super) fn read(
    mut section: SectionReader,
    realtime: &Realtime,
    machine: &Machine,
    limits: &DeploymentLimits,
) -> Control {
    let modes = ControlMode::ALL.map(|mode| (mode.name(), mode));
    let mode = section.choice_or("mode", ControlMode::default(), &modes);
    let leg_masses = LegMasses::at_home(machine);
    let [softest, stiffest] =
        if mode.acts_on_legs() { [leg_masses.softest, leg_masses.stiffest] } else { [1.0; 2] };
    let [position_bandwidth_hz, position_damping_ratio] =
        gains(&mut section, ["position_bandwidth_hz", "position_damping_ratio"], realtime, stiffest);
    let [orientation_bandwidth_hz, orientation_damping_ratio] =
        gains(&mut section, ["orientation_bandwidth_hz", "orientation_damping_ratio"], realtime, 1.0);
    let bandwidths = [position_bandwidth_hz, orientation_bandwidth_hz];
    let loops = [
        (realtime.sampled_loop(position_bandwidth_hz, position_damping_ratio), [softest, stiffest]),
        (realtime.sampled_loop(orientation_bandwidth_hz, orientation_damping_ratio), [1.0; 2]),
    ];
    let control = Control {
        mode,
        position_bandwidth_hz,
        position_damping_ratio,
        orientation_bandwidth_hz,
        orientation_damping_ratio,
        engage_position_m: section.number_or("engage_position_m", 0.002, Bound::UpTo(MAX_ENGAGE_M)),
        engage_orientation_rad: section.number_or(
            "engage_orientation_rad",
            0.005,
            Bound::UpTo(MAX_ENGAGE_RAD),
        ),
        following_position_m: section.number_or("following_position_m", 0.02, Bound::UpTo(MAX_FOLLOWING_M)),
        following_orientation_rad: section.number_or(
            "following_orientation_rad",
            0.05,
            Bound::UpTo(MAX_FOLLOWING_RAD),
        ),
        following_velocity_m_s: section.number_or(
            "following_velocity_m_s",
            DEFAULT_VELOCITY_ERROR_RATIO * limits.reference.position.velocity,
            Bound::Positive,
        ),
        following_velocity_rad_s: section.number_or(
            "following_velocity_rad_s",
            DEFAULT_VELOCITY_ERROR_RATIO * limits.reference.orientation.velocity,
            Bound::Positive,
        ),
        fidelity: fidelity(&mut section),
        fidelity_tolerance: section.number_or("fidelity_tolerance", 0.001, Bound::UpTo(1.0)),
        observer_bandwidth_hz: observer(&mut section, realtime.rate_hz, &bandwidths, &loops),
        on_setpoint_lost: section.choice_or(
            "on_setpoint_lost",
            AfterStop::Fault,
            &[("fault", AfterStop::Fault), ("park", AfterStop::Park)],
        ),
        leg_masses,
    };
    section.finish();
    control
}

fn fidelity(section: &mut SectionReader) -> FidelityChoice {
    let fidelities = Fidelity::ALL.into_iter().rev().filter(|fidelity| fidelity.has_inertia());
    let options = fidelities
        .map(|fidelity| (fidelity.name(), FidelityChoice::Fixed(fidelity)))
        .chain([("auto", FidelityChoice::Auto)]);
    section.choice_or("fidelity", FidelityChoice::Fixed(Fidelity::Exact), &options.collect::<Vec<_>>())
}

/// Bandwidth of the observer, rejected where a loop would have too little gain margin.
fn observer(
    section: &mut SectionReader,
    rate_hz: f64,
    bandwidths: &[f64; 2],
    loops: &[(SampledLoop, [f64; 2]); 2],
) -> f64 {
    let observer_hz = section.number_or("observer_bandwidth_hz", 0.0, Bound::NotNegative);
    let fastest = MAX_OBSERVER_RATIO * bandwidths.iter().copied().fold(f64::INFINITY, f64::min);
    let largest = boundary(fastest, |hertz| {
        bandwidths.iter().zip(loops).all(|(bandwidth, (sampled, [softest, stiffest]))| {
            let observed = SampledLoop { observer: hertz / bandwidth, ..*sampled };
            observed.gain_margin() >= GAIN_MARGIN * stiffest
                && observed.least_gain() * GAIN_MARGIN <= *softest
        })
    });
    // The search approaches its end from below without reaching it.
    let largest = (largest * (1.0 + 1e-9) * 1e3).floor() / 1e3;
    if observer_hz > largest && bandwidths.iter().all(|hertz| hertz.is_finite()) {
        let bound = if largest > 0.0 {
            format!(
                "must be at most {largest} at realtime.rate_hz = {rate_hz} and these bandwidths (gain margin of \
                 {GAIN_MARGIN}, and {MAX_OBSERVER_RATIO} times the lesser bandwidth)"
            )
        } else {
            format!(
                "must be 0 with these bandwidths: at realtime.rate_hz = {rate_hz} they leave less than the gain margin \
                 of {GAIN_MARGIN} that an observer needs"
            )
        };
        section.reject("observer_bandwidth_hz", bound);
    }
    observer_hz
}

/// Reads bandwidth and damping ratio of a loop, and rejects a bandwidth that is unstable with the longest delay.
/// `stiffest` is the gain of the stiffest mode as a multiple of the gain of the loop.
fn gains(
    section: &mut SectionReader,
    [bandwidth_key, damping_key]: [&'static str; 2],
    realtime: &Realtime,
    stiffest: f64,
) -> [f64; 2] {
    let rate_hz = realtime.rate_hz;
    let damping_ratio = section.number_or(damping_key, 1.0, DAMPING_RATIO_BOUND);
    // Rounded down, so that the number in the message is one that is accepted.
    let largest_hz = |gain: f64| {
        let sampled = realtime.sampled_loop(f64::NAN, damping_ratio);
        let wn_t = SampledLoop { mass_ratio: 1.0 / gain, ..sampled }.largest_wn_t();
        (wn_t * rate_hz / TAU * 1e3).floor() / 1e3
    };
    let default_hz = DEFAULT_BANDWIDTH_HZ.min(largest_hz(GAIN_MARGIN * stiffest));
    let bandwidth_hz = section.number_or(bandwidth_key, default_hz, Bound::Positive);
    let (largest, delay) = (largest_hz(stiffest), realtime.longest_delay());
    if delay.is_finite() && damping_ratio.is_finite() && bandwidth_hz > largest {
        let modes = if stiffest == 1.0 {
            String::new()
        } else {
            format!(" in the stiffest mode of the legs, which has {} times the gain", rounded(stiffest))
        };
        let bound = format!(
            "must be at most {largest} at realtime.rate_hz = {rate_hz} and {damping_key} = {damping_ratio} \
             (stable with {delay:.2} periods from measurement to force{modes})"
        );
        section.reject(bandwidth_key, bound);
        return [f64::NAN, damping_ratio];
    }
    [bandwidth_hz, damping_ratio]
}
