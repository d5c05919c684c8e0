//! The sections that say how a machine is run: `[realtime]`, `[control]`, `[limits]`, `[timeouts]`,
//! `[plant]`, `[envelope]`.
//!
//! Every key has a default that works at the configured rate: a slow loop gets smaller gains and longer
//! timeouts. What is given is checked against the limits that follow from the rate.

use core::f64::consts::TAU;

pub use self::plant::Plant;
pub use self::realtime::{Realtime, Scheduler};
use super::bound::Bound;
use super::machine::rounded;
use super::reader::Reader;
use crate::analysis::envelope;
use crate::analysis::sampled_loop::{SampledLoop, boundary};
use crate::control::law::ControlMode;
use crate::control::leg_masses::LegMasses;
use crate::control::limits::{AxisLimits, Limits as ReferenceLimits};
use crate::control::supervisor::AfterStop;
use crate::model::fidelity::Fidelity;
use crate::model::kinematic_state::KinematicState;
use crate::model::machine::Machine;
use crate::model::task::TaskState;

mod plant;
mod realtime;

/// Default of the bandwidths where the rate carries it \[Hz\]: stiff enough for micrometres, soft enough for
/// a structure that is not quite rigid.
const BANDWIDTH_HZ: f64 = 10.0;
/// Defaults of the timeouts are no shorter than this many periods: one message late is not a peer lost.
const LEAST_DEFAULT_PERIODS: f64 = 4.0;
/// Longest a peer may be silent \[ms\]. After a second, nobody knows where the platform is.
const LONGEST_TIMEOUT_MS: f64 = 1000.0;
/// Damping ratios that a control engineer would write down; beyond, it is a slip.
const DAMPING_RATIO: Bound = Bound::Within(0.1, 10.0);
/// Gain margin of the default bandwidths and of observers, and the least that is not warned of: the textbook's
/// 6 dB. A platform of half the modelled mass is still stable.
pub const GAIN_MARGIN: f64 = 2.0;
/// Largest bandwidth of the observer, as a multiple of the lesser bandwidth: what is faster only amplifies noise.
const FASTEST_OBSERVER: f64 = 2.0;
/// The default of the force rate takes this long from no force to the largest \[s\]: slower than any noise
/// worth following, faster than any motion.
const FORCE_RISE_S: f64 = 0.01;
/// Default of the largest condition: an error of a length is up to a hundred times as large at the platform, and
/// a load asks for up to a hundred times its size of the legs.
const CONDITION: f64 = 100.0;
/// Engaging further away than this is a motion, and needs a trajectory \[m\], \[rad\].
const FURTHEST_ENGAGE_M: f64 = 0.1;
const FURTHEST_ENGAGE_RAD: f64 = 0.2;
/// Following further away than this is not following \[m\], \[rad\].
const FURTHEST_FOLLOWING_M: f64 = 1.0;
const FURTHEST_FOLLOWING_RAD: f64 = 1.0;
/// Strongest brake \[m/s^2\]: a hundred times gravity is an impact.
const STRONGEST_BRAKE_M_S2: f64 = 1000.0;
/// Largest angle of an envelope \[rad\], just over half a turn: beyond, it is a slip of the unit.
const HALF_TURN: f64 = 3.2;

/// How a machine is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Deployment {
    /// The cycle and its threads.
    pub realtime: Realtime,
    /// The control law.
    pub control: Control,
    /// What no reference may exceed.
    pub limits: Limits,
    /// Ages of messages.
    pub timeouts: Timeouts,
    /// The simulated hardware.
    pub plant: Plant,
    /// What the platform will be asked to do; `None` if nobody has said.
    pub envelope: Option<envelope::EnvelopeBounds>,
}

/// `[control]`: the law's error dynamics, and how near the set point must be to engage.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// From errors to forces.
    pub mode: ControlMode,
    /// Natural frequency of the position error.
    pub position_bandwidth_hz: f64,
    /// Damping ratio of the position error.
    pub position_damping_ratio: f64,
    /// Natural frequency of the orientation error.
    pub orientation_bandwidth_hz: f64,
    /// Damping ratio of the orientation error.
    pub orientation_damping_ratio: f64,
    /// Furthest the set point may be from the platform to engage.
    pub engage_position_m: f64,
    /// The same for the angle between them.
    pub engage_orientation_rad: f64,
    /// Furthest the platform may be from the set point while it is controlled.
    pub following_position_m: f64,
    /// The same for the angle between them.
    pub following_orientation_rad: f64,
    /// Which terms of the dynamics are evaluated.
    pub fidelity: FidelityChoice,
    /// Below this frequency disturbances are cancelled; 0 is without.
    pub observer_bandwidth_hz: f64,
    /// What follows the stop of a platform that lost its setpoint.
    pub on_setpoint_lost: AfterStop,
    /// Largest error [`FidelityChoice::Auto`] may make, as a share of the peak force of the envelope.
    pub fidelity_tolerance: f64,
}

/// `[limits]`: what no reference and no force may exceed.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Of setpoints and of the motions that the daemon makes by itself.
    pub reference: ReferenceLimits,
    /// Largest change of a force.
    pub force_rate_n_s: f64,
    /// Largest Frobenius condition of the legs' wrenches under control.
    pub condition: f64,
}

/// `control.fidelity`: which terms of the dynamics are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FidelityChoice {
    /// As many as the envelope needs.
    Auto,
    /// Those of one fidelity, which has inertia.
    Fixed(Fidelity),
}

/// `[timeouts]`: how old the newest message may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeouts {
    /// Of the set point.
    pub setpoint_s: f64,
    /// Of the measured lengths and rates.
    pub measured_s: f64,
}

/// Reads and checks the six sections; some defaults follow from the machine. Where a number was refused it is NaN.
pub(super) fn read(root: &mut Reader, machine: &Machine) -> Deployment {
    let realtime = realtime::read(root.section("realtime"));
    let rate_hz = realtime.rate_hz;
    Deployment {
        control: control(root.section("control"), &realtime, machine),
        limits: limits(root.section("limits"), machine),
        timeouts: timeouts(root.section("timeouts"), rate_hz),
        plant: plant::read(root.section("plant"), rate_hz, machine),
        envelope: envelope(root.section("envelope")),
        realtime,
    }
}

fn control(mut section: Reader, realtime: &Realtime, machine: &Machine) -> Control {
    let modes = ControlMode::ALL.map(|mode| (mode.name(), mode));
    let mode = section.choice_or("mode", ControlMode::default(), &modes);
    let legs = mode.acts_on_legs().then(|| LegMasses::at_home(machine));
    let [softest, stiffest] = legs.map_or([1.0; 2], |legs| [legs.softest, legs.stiffest]);
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
        engage_position_m: section.number_or("engage_position_m", 0.002, Bound::UpTo(FURTHEST_ENGAGE_M)),
        engage_orientation_rad: section.number_or(
            "engage_orientation_rad",
            0.005,
            Bound::UpTo(FURTHEST_ENGAGE_RAD),
        ),
        following_position_m: section.number_or(
            "following_position_m",
            0.02,
            Bound::UpTo(FURTHEST_FOLLOWING_M),
        ),
        following_orientation_rad: section.number_or(
            "following_orientation_rad",
            0.05,
            Bound::UpTo(FURTHEST_FOLLOWING_RAD),
        ),
        fidelity: fidelity(&mut section),
        fidelity_tolerance: section.number_or("fidelity_tolerance", 0.001, Bound::UpTo(1.0)),
        observer_bandwidth_hz: observer(&mut section, realtime.rate_hz, &bandwidths, &loops),
        on_setpoint_lost: section.choice_or(
            "on_setpoint_lost",
            AfterStop::Fault,
            &[("fault", AfterStop::Fault), ("park", AfterStop::Park)],
        ),
    };
    section.finish();
    control
}

fn fidelity(section: &mut Reader) -> FidelityChoice {
    let fidelities = Fidelity::ALL.into_iter().rev().filter(|fidelity| fidelity.has_inertia());
    let options = fidelities
        .map(|fidelity| (fidelity.name(), FidelityChoice::Fixed(fidelity)))
        .chain([("auto", FidelityChoice::Auto)]);
    section.choice_or("fidelity", FidelityChoice::Fixed(Fidelity::Exact), &options.collect::<Vec<_>>())
}

/// As fast as both loops carry it.
fn observer(
    section: &mut Reader,
    rate_hz: f64,
    bandwidths: &[f64; 2],
    loops: &[(SampledLoop, [f64; 2]); 2],
) -> f64 {
    let observer_hz = section.number_or("observer_bandwidth_hz", 0.0, Bound::NotNegative);
    let fastest = FASTEST_OBSERVER * bandwidths.iter().copied().fold(f64::INFINITY, f64::min);
    let largest = boundary(fastest, |hertz| {
        bandwidths.iter().zip(loops).all(|(bandwidth, (sampled, [softest, stiffest]))| {
            let observed = SampledLoop { observer: hertz / bandwidth, ..*sampled };
            observed.gain_margin() >= GAIN_MARGIN * stiffest
                && observed.least_gain() * GAIN_MARGIN <= *softest
        })
    });
    // What halving never reaches is meant too.
    let largest = (largest * (1.0 + 1e-9) * 1e3).floor() / 1e3;
    if observer_hz > largest && bandwidths.iter().all(|hertz| hertz.is_finite()) {
        let bound = if largest > 0.0 {
            format!(
                "must be at most {largest} at realtime.rate_hz = {rate_hz} and these bandwidths (gain margin of \
                 {GAIN_MARGIN}, and {FASTEST_OBSERVER} times the lesser bandwidth)"
            )
        } else {
            format!(
                "must be 0 with these bandwidths: at realtime.rate_hz = {rate_hz} they leave less than the gain margin \
                 of {GAIN_MARGIN} that an observer needs"
            )
        };
        section.refuse("observer_bandwidth_hz", bound);
    }
    observer_hz
}

/// Bandwidth and damping ratio of one loop, the stiffest of whose modes has so many times its gain; refused where
/// that is unstable with the longest delay.
fn gains(
    section: &mut Reader,
    [bandwidth_key, damping_key]: [&'static str; 2],
    realtime: &Realtime,
    stiffest: f64,
) -> [f64; 2] {
    let rate_hz = realtime.rate_hz;
    let damping_ratio = section.number_or(damping_key, 1.0, DAMPING_RATIO);
    // Rounded down, so that the number in the message is one that is accepted.
    let largest_hz = |gain: f64| {
        let sampled = realtime.sampled_loop(f64::NAN, damping_ratio);
        let wn_t = SampledLoop { mass_ratio: 1.0 / gain, ..sampled }.largest_wn_t();
        (wn_t * rate_hz / TAU * 1e3).floor() / 1e3
    };
    let default_hz = BANDWIDTH_HZ.min(largest_hz(GAIN_MARGIN * stiffest));
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
        section.refuse(bandwidth_key, bound);
        return [f64::NAN, damping_ratio];
    }
    [bandwidth_hz, damping_ratio]
}

/// Defaults are what a standing person stands: half of gravity, a tenth of a second to build it up. By itself
/// the daemon moves at a fifth of that.
fn limits(mut section: Reader, machine: &Machine) -> Limits {
    let mut positive = |key, default| section.number_or(key, default, Bound::Positive);
    let position = AxisLimits {
        velocity: positive("velocity_m_s", 1.0),
        acceleration: positive("acceleration_m_s2", 5.0),
        jerk: positive("jerk_m_s3", 500.0),
    };
    let orientation = AxisLimits {
        velocity: positive("velocity_rad_s", 2.0),
        acceleration: positive("acceleration_rad_s2", 20.0),
        jerk: positive("jerk_rad_s3", 2000.0),
    };
    let autonomous_scale = section.number_or("autonomous_scale", 0.2, Bound::UpTo(1.0));
    let force_rate_n_s =
        section.number_or("force_rate_n_s", machine.actuator.max_force / FORCE_RISE_S, Bound::Positive);
    let condition = condition(&mut section, machine);
    section.finish();
    Limits {
        reference: ReferenceLimits { position, orientation, autonomous_scale },
        force_rate_n_s,
        condition,
    }
}

/// The default leaves room around a home that is badly conditioned itself; at home it must be kept.
fn condition(section: &mut Reader, machine: &Machine) -> f64 {
    let home = TaskState::at_rest(machine.home).motion().pose;
    let at_home = KinematicState::new(machine, home).sensitivity().condition;
    let limit = section.number_or("condition", CONDITION.max(2.0 * at_home), Bound::Positive);
    if limit < at_home {
        let bound = format!("must be at least {} (that of home)", rounded(at_home));
        section.refuse("condition", bound);
    }
    limit
}

fn timeouts(mut section: Reader, rate_hz: f64) -> Timeouts {
    let timeouts = Timeouts {
        setpoint_s: timeout_s(&mut section, "setpoint_ms", 50.0, rate_hz),
        measured_s: timeout_s(&mut section, "measured_ms", 20.0, rate_hz),
    };
    section.finish();
    timeouts
}

/// All four keys, or none.
fn envelope(mut section: Reader) -> Option<envelope::EnvelopeBounds> {
    let pose = |angle: Bound, position: Bound| [angle, angle, angle, position, position, position];
    let keys = [
        ("pose_min", pose(Bound::Within(-HALF_TURN, 0.0), Bound::NotPositive)),
        ("pose_max", pose(Bound::Within(0.0, HALF_TURN), Bound::NotNegative)),
        ("velocity", [Bound::NotNegative; 6]),
        ("acceleration", [Bound::NotNegative; 6]),
    ];
    let found = keys.map(|(key, bounds)| section.vector_within(key, &bounds));
    for ((key, _), value) in keys.iter().zip(&found) {
        if value.is_none() && found.iter().any(Option::is_some) {
            section.refuse(key, "missing, must be given with the other keys of the section");
        }
    }
    section.finish();
    let [Some(pose_min), Some(pose_max), Some(velocity), Some(acceleration)] = found else { return None };
    Some(envelope::EnvelopeBounds { pose_min, pose_max, velocity, acceleration })
}

/// A peer that sends once a cycle is silent for one period: a timeout must be longer.
fn timeout_s(section: &mut Reader, key: &'static str, default_ms: f64, rate_hz: f64) -> f64 {
    let period_ms = 1e3 / rate_hz;
    let default_ms = default_ms.max(LEAST_DEFAULT_PERIODS * period_ms);
    let timeout_ms = section.number_or(key, default_ms, Bound::UpTo(LONGEST_TIMEOUT_MS));
    if timeout_ms <= period_ms {
        let bound = format!(
            "must be greater than {} (one period of realtime.rate_hz = {rate_hz})",
            rounded(period_ms)
        );
        section.refuse(key, bound);
    }
    timeout_ms / 1e3
}
