//! Delay of the drives from a recorded motion: the time from the release of a cycle to the instant at which its force acts.
//!
//! Over a few milliseconds around an instant t the second divided difference of the measured lengths is the mean of their
//! acceleration, with a triangle as its weight. The same triangle, moved back by the delay D, gives the mean of the forces that were sent,
//! each held until the next: both means are exact, whatever the instants of the samples. For each leg i
//!
//! ```text
//! mean of Gamma_i(t - D_i) = model_i + Y_i p + viscous_i L'_i + (coulomb_i + load_i |model_i|) sign(L'_i) + offset_i
//! ```
//!
//! model: inverse dynamics of the measured motion, without friction; Y p: forces of a payload, by the
//! [regressor](hexad_core::model::regressor) of mass, first moments and inertia of the platform. The unknowns beside the six delays keep payload
//! and friction from passing for a delay. Feedback sends the noise of the sensors, so least squares would be biased. The equations are
//! multiplied by the same terms of the *reference* instead, which has no noise (instrumental variables: Söderström, Stoica,
//! "Instrumental Variable Methods for System Identification", 1983), and solved for the delays by Newton's method.
//!
//! A lag of the drives counts as a delay, as it does in the estimator; so do sensors whose stamps are late. Stiction is not
//! modelled, but legs that nearly stand do not count. A wrong mass of the legs is not modelled, and matters less the faster the
//! motion.

use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector6};

use super::force_integrals::{ForceIntegrals, SentForce, differences};
use hexad_core::model::LEGS;
use hexad_core::model::active_forces::InverseDynamics;
use hexad_core::model::fidelity::Exact;
use hexad_core::model::inverse_geometry::leg_motion;
use hexad_core::model::kinematic_state::KinematicState;
use hexad_core::model::machine::Machine;
use hexad_core::model::regressor::regressor;
use hexad_core::model::rigid::{Acceleration, Motion, Pose};

/// A measurement under control.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredMotion {
    /// Instant of the measurement, on the clock of the releases \[ns\].
    pub time_ns: u64,
    /// \[m\]
    pub length_m: [f64; LEGS],
    /// By forward kinematics.
    pub pose: Pose,
    /// Reference of the cycle; its instant may be another one, as long as the difference is constant.
    pub reference: Motion,
}

/// Consecutive cycles under control.
#[derive(Clone, Debug, Default)]
pub struct RecordedStretch {
    /// All forces of the stretch.
    pub sent: Vec<SentForce>,
    /// Its measurements, each once.
    pub measured: Vec<MeasuredMotion>,
}

/// A delay and its standard deviation \[s\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// \[s\]
    pub delay_s: f64,
    /// \[s\]
    pub deviation_s: f64,
}

/// Delay of the drives, all together and one by one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveDelay {
    /// Of all, each by its precision.
    pub mean: Estimate,
    /// Of each.
    pub legs: [Estimate; LEGS],
    /// Duration of the motion that was used \[s\].
    pub duration_s: f64,
}

/// Half of the width of the triangle \[s\]: noise of a micrometre is 0.02 m/s^2 there, and motions of 10 Hz pass.
const HALF_WIDTH_S: f64 = 0.01;
/// Longest delay that is found \[s\]: twice the longest that a configuration may have.
const MAX_DELAY_S: f64 = 0.03;
/// Instants within half of the width: more are no news.
const INSTANTS_PER_HALF_WIDTH: usize = 4;
/// Parts of the recording that are left out in turn, for the deviation; and least number of instants in each.
const PARTS: usize = 12;
const MIN_INSTANTS_PER_PART: usize = 50;
/// Newton steps: three suffice.
const MAX_STEPS: u32 = 20;
const CONVERGED_S: f64 = 1e-7;
/// Rate below which a leg nearly stands \[m/s\]: three times the Stribeck speed of a usual drive, or this ratio of
/// the largest rate, if that is less.
const STANDING_M_S: f64 = 0.03;
const STANDING_RATIO: f64 = 0.05;
/// Rate at which Coulomb friction has its whole force \[m/s\].
const FRICTION_SMOOTHING_M_S: f64 = 1e-3;

/// Unknowns of all legs: mass, first moments and inertia of the platform.
const COMMON: usize = 10;
/// Unknowns of a leg: delay, viscous, Coulomb and load friction, offset.
const OWN: usize = 5;
const TERMS: usize = COMMON + OWN;
const UNKNOWNS: usize = COMMON + LEGS * OWN;
/// What the unknowns in the equation of a leg are multiplied by: the common ones, then its own.
type Terms = SVector<f64, TERMS>;

/// Delay of the drives of a machine from a recorded motion; `None` if too little was recorded, or it does not move enough.
pub fn drive_delay(machine: &Machine, stretches: &[RecordedStretch]) -> Option<DriveDelay> {
    let mut frictionless = machine.clone();
    (frictionless.actuator.coulomb_friction_n, frictionless.actuator.viscous_friction_n_s_m) =
        ([0.0; LEGS], [0.0; LEGS]);
    let model = InverseDynamics::new(&frictionless);
    let recorded: Vec<_> = stretches.iter().map(|stretch| Instants::new(&model, stretch)).collect();
    let count = recorded.iter().map(|recorded| recorded.instants.len()).sum::<usize>();
    if count < PARTS * MIN_INSTANTS_PER_PART {
        return None;
    }
    let mut delay_s = Vector6::<f64>::zeros();
    for _ in 0..MAX_STEPS {
        let steps = Sums::new(&recorded, count, &delay_s).steps(None)?;
        delay_s = (delay_s + steps).map(|delay| delay.clamp(-MAX_DELAY_S, MAX_DELAY_S));
        if steps.amax() < CONVERGED_S {
            break;
        }
    }
    let sums = Sums::new(&recorded, count, &delay_s);
    let without: Option<Vec<_>> = (0..PARTS).map(|part| sums.steps(Some(part))).collect();
    let duration_s =
        recorded.iter().map(|recorded| recorded.spacing_s * recorded.instants.len() as f64).sum();
    Some(combined(&delay_s, &without?, duration_s))
}

/// The jackknife: deviations by what leaving out each part changes (Efron, Stein, 1981).
fn combined(delay_s: &Vector6<f64>, without: &[Vector6<f64>], duration_s: f64) -> DriveDelay {
    let deviation = |value: &dyn Fn(&Vector6<f64>) -> f64| {
        let mean = without.iter().map(value).sum::<f64>() / PARTS as f64;
        let squares: f64 = without.iter().map(|part| (value(part) - mean).powi(2)).sum();
        (squares * (PARTS - 1) as f64 / PARTS as f64).sqrt()
    };
    let legs: [Estimate; LEGS] = core::array::from_fn(|leg| Estimate {
        delay_s: delay_s[leg],
        deviation_s: deviation(&|part| part[leg]),
    });
    let weight = Vector6::from(legs.map(|leg| 1.0 / leg.deviation_s.powi(2).max(f64::MIN_POSITIVE)));
    let mean = |values: &Vector6<f64>| values.dot(&weight) / weight.sum();
    DriveDelay { mean: Estimate { delay_s: mean(delay_s), deviation_s: deviation(&mean) }, legs, duration_s }
}

/// One instant of the equations, in seconds from the first release of its stretch.
struct Instant {
    /// Three samples, by the middle one of which it is named \[s\].
    times: [f64; 3],
    model: Vector6<f64>,
    /// Of the measured motion, but for the rate of change of the forces.
    measured: [Terms; LEGS],
    /// Of the reference.
    instruments: [Terms; LEGS],
}

/// The instants of a stretch, and its forces.
struct Instants {
    sent: ForceIntegrals,
    instants: Vec<Instant>,
    spacing_s: f64,
}

impl Instants {
    fn new(model: &InverseDynamics, stretch: &RecordedStretch) -> Self {
        let RecordedStretch { sent, measured } = stretch;
        let zero_ns = sent.first().map_or(0, |sent| sent.release_ns);
        let seconds = |time_ns: u64| time_ns as i64 as f64 * 1e-9 - zero_ns as i64 as f64 * 1e-9;
        let sent = ForceIntegrals::new(sent, zero_ns);
        let ends = measured.first().zip(measured.last());
        let span_s = ends.map_or(0.0, |(first, last)| seconds(last.time_ns) - seconds(first.time_ns));
        let period_s = span_s / measured.len().saturating_sub(1).max(1) as f64;
        let half = ((HALF_WIDTH_S / period_s).round() as usize).clamp(2, 1000);
        let (stride, mut instants) = ((half / INSTANTS_PER_HALF_WIDTH).max(1), vec![]);
        for window in measured.windows(2 * half + 1).step_by(stride) {
            let (Some(first), Some(middle), Some(last)) = (window.first(), window.get(half), window.last())
            else {
                continue;
            };
            let samples = [first, middle, last];
            let times @ [begin, _, end] = samples.map(|sample| seconds(sample.time_ns));
            if begin > MAX_DELAY_S && end - begin < 3.0 * half as f64 * period_s {
                instants.extend(Instant::new(model, times, samples));
            }
        }
        Self { sent, instants, spacing_s: stride as f64 * period_s }
    }
}

impl Instant {
    fn new(model: &InverseDynamics, times: [f64; 3], samples: [&MeasuredMotion; 3]) -> Option<Self> {
        let machine = model.machine();
        let length = samples.map(|sample| Vector6::from(sample.length_m));
        let [first, middle, last] = samples;
        let (rate, second) = differences(&times, &length);
        let kinematics = KinematicState::new(machine, middle.pose);
        let twist = kinematics.twist(machine, &rate.into())?;
        // L'' = N^T X'' + what the velocity alone gives.
        let coasting = Motion { pose: middle.pose, twist, acceleration: Acceleration::default() };
        let by_velocity = Vector6::from(leg_motion(machine, &coasting).accel_m_s2);
        let acceleration = kinematics.twist(machine, &(second - by_velocity).into())?.vector();
        let motion = Motion { acceleration: Acceleration::from_vector(&acceleration), ..coasting };
        let force = |sample: &MeasuredMotion| model.forces::<Exact>(&sample.reference).map(Vector6::from);
        let force_rate = (force(last)? - force(first)?) / (last.time_ns - first.time_ns) as f64 * 1e9;
        let modelled = model.forces::<Exact>(&motion)?.into();
        let mut instruments = terms(machine, &middle.reference, (&force(middle)?, &force_rate))?;
        // A leg that nearly stands has stiction, which would pass for a delay.
        let standing = STANDING_M_S.min(STANDING_RATIO * machine.actuator.max_rate_m_s);
        for (instruments, rate) in instruments.iter_mut().zip(&rate) {
            if rate.abs() < standing {
                *instruments = Terms::zeros();
            }
        }
        let measured = terms(machine, &motion, (&modelled, &Vector6::zeros()))?;
        Some(Self { times, model: modelled, measured, instruments })
    }
}

/// The terms of each leg in a motion with these forces and their rates of change.
fn terms(
    machine: &Machine,
    motion: &Motion,
    (force, force_rate): (&Vector6<f64>, &Vector6<f64>),
) -> Option<[Terms; LEGS]> {
    let regressor = regressor(machine, motion)?;
    let rates = Vector6::from(leg_motion(machine, motion).rate_m_s);
    Some(core::array::from_fn(|leg| {
        let (mut terms, rate) = (Terms::zeros(), value(&rates, leg));
        terms.fixed_rows_mut::<COMMON>(0).copy_from(&regressor.fixed_view::<1, COMMON>(leg, 0).transpose());
        let sign = (rate / FRICTION_SMOOTHING_M_S).clamp(-1.0, 1.0);
        terms.fixed_rows_mut::<OWN>(COMMON).copy_from(&SVector::from([
            value(force_rate, leg),
            rate,
            sign,
            value(force, leg).abs() * sign,
            1.0,
        ]));
        terms
    }))
}

fn value(values: &Vector6<f64>, leg: usize) -> f64 {
    values.get(leg).copied().unwrap_or_default()
}

/// Sums of the equations times their instruments, of each leg and part.
struct Sums {
    legs: Vec<[(SMatrix<f64, TERMS, TERMS>, Terms); PARTS]>,
}

impl Sums {
    fn new(recorded: &[Instants], count: usize, delay_s: &Vector6<f64>) -> Self {
        let mut legs = vec![[(SMatrix::zeros(), Terms::zeros()); PARTS]; LEGS];
        let all = recorded.iter().flat_map(|part| part.instants.iter().map(|instant| (&part.sent, instant)));
        for (index, (sent, instant)) in all.enumerate() {
            let part = index * PARTS / count;
            let terms = instant.measured.iter().zip(&instant.instruments);
            for (leg, (sums, (measured, instruments))) in legs.iter_mut().zip(terms).enumerate() {
                let (mean, force_rate) = sent.mean(&instant.times, value(delay_s, leg));
                let mut measured = *measured;
                measured.fixed_rows_mut::<1>(COMMON).fill(value(&force_rate, leg));
                if let Some((normal, right)) = sums.get_mut(part) {
                    *normal += instruments * measured.transpose();
                    *right += instruments * (value(&mean, leg) - value(&instant.model, leg));
                }
            }
        }
        Self { legs }
    }

    /// Steps of the delays that solve the equations, of all parts but one. `None` if the motion does not determine them.
    fn steps(&self, left_out: Option<usize>) -> Option<Vector6<f64>> {
        let mut normal = DMatrix::<f64>::zeros(UNKNOWNS, UNKNOWNS);
        let mut right = DVector::<f64>::zeros(UNKNOWNS);
        for (leg, parts) in self.legs.iter().enumerate() {
            let place = |term: usize| if term < COMMON { term } else { term + leg * OWN };
            for (_, sums) in parts.iter().enumerate().filter(|(part, _)| Some(*part) != left_out) {
                for (row, sum) in sums.1.iter().enumerate() {
                    right.row_mut(place(row)).add_scalar_mut(*sum);
                }
                for (column, part) in sums.0.column_iter().enumerate() {
                    let mut column = normal.column_mut(place(column));
                    for (row, sum) in part.iter().enumerate() {
                        column.row_mut(place(row)).add_scalar_mut(*sum);
                    }
                }
            }
        }
        // Scaled, as the terms differ by many powers of ten.
        let largest = |values: &mut dyn Iterator<Item = f64>| {
            1.0 / values.fold(f64::MIN_POSITIVE, |most, value| most.max(value.abs()))
        };
        for row in 0..UNKNOWNS {
            let scale = largest(&mut normal.row(row).iter().copied());
            normal.row_mut(row).scale_mut(scale);
            right.row_mut(row).scale_mut(scale);
        }
        let mut scales = DVector::<f64>::zeros(UNKNOWNS);
        for (mut column, scale) in normal.column_iter_mut().zip(scales.iter_mut()) {
            *scale = largest(&mut column.iter().copied());
            column.scale_mut(*scale);
        }
        let solution = normal.full_piv_lu().solve(&right)?.component_mul(&scales);
        let steps = Vector6::from_fn(|leg, _| solution.get(COMMON + leg * OWN).copied().unwrap_or(f64::NAN));
        steps.iter().all(|step| step.is_finite()).then_some(steps)
    }
}
