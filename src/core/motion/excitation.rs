//! Excitation: a periodic motion about home that shows inertial parameters and friction, then a fast motion that shows
//! the delay of the drives.
//!
//! ```text
//! X(t) = X_home + s(t) sum_k ( a_k cos(k w u) + b_k sin(k w u) ),   u = t - 2 s,  w = 2 pi / 10 s,  k = 1 to 5
//!
//! blend in, 2 s | counted periods, n x 10 s | blend out, 2 s | sines that show the delay of the drives
//! ```
//!
//! s is the minimum-jerk window, 1 during the counted periods: they repeat exactly, so a recording can be averaged over
//! them. Source: Swevers, Ganseman, Tükel, De Schutter, Van Brussel (1997), "Optimal robot excitation and
//! identification". `analysis::excitation_design` chooses the coefficients.

use core::f64::consts::TAU;

use nalgebra::{SMatrix, Vector6};

use super::built_in::FittedMotion;
use super::minimum_jerk::{scaled_by_profile, window};
use crate::model::machine::Machine;
use crate::model::task::TaskState;

/// Period \[s\].
pub const PERIOD_S: f64 = 10.0;
/// Number of harmonics of the period.
pub const HARMONICS: usize = 5;
/// Time in which the periodic motion blends in, and out again \[s\].
pub const BLEND_S: f64 = 2.0;

/// Coefficients of a Fourier series: a row per task coordinate; a column per harmonic for `a`, then for `b`
/// \[rad\], \[m\].
pub type Coefficients = SMatrix<f64, 6, { 2 * HARMONICS }>;

/// Periodic displacement of X from home, `sum_k ( a_k cos(k w t) + b_k sin(k w t) )`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FourierSeries(pub Coefficients);

impl FourierSeries {
    /// The displacement and its two derivatives at a time \[s\].
    pub fn at(&self, t_s: f64) -> TaskState {
        let [cosine, sine] = [0, HARMONICS].map(|first| self.0.fixed_columns::<HARMONICS>(first));
        let mut state = TaskState::default();
        for ((k, a), b) in (1_u32..).zip(cosine.column_iter()).zip(sine.column_iter()) {
            let omega = f64::from(k) * TAU / PERIOD_S;
            let (sin, cos) = libm::sincos(omega * t_s);
            let displacement = a * cos + b * sin;
            state.x += displacement;
            state.xd += (b * cos - a * sin) * omega;
            state.xdd -= displacement * (omega * omega);
        }
        state
    }

    /// The same series with a share of its amplitude.
    pub fn scaled(&self, share: f64) -> Self {
        Self(self.0 * share)
    }
}

/// Excitation of a machine: periods of a Fourier series, then a motion that shows the delay of the drives.
///
/// ```
/// use hexad_core::motion::{built_in::{BuiltInMotion, fit}, excitation::{Excitation, FourierSeries}};
/// # let machine = hexad_machine::config::Config::load("../../config/tsai2000.toml".as_ref()).unwrap().machine;
/// let mut series = FourierSeries::default();
/// series.0[(5, 5)] = 0.1;
/// let excitation = Excitation::new(&machine, series, 3, fit(&machine, BuiltInMotion::Sines, 10.0));
/// assert_eq!((excitation.counted_interval_s(), excitation.duration()), ([2.0, 32.0], 44.0));
/// assert_eq!(excitation.at(0.0).x, nalgebra::Vector6::from(machine.home));
/// assert!((excitation.at(5.0).x - excitation.at(25.0).x).norm() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Excitation {
    home: Vector6<f64>,
    series: FourierSeries,
    periods: u32,
    delay_motion: FittedMotion,
}

impl Excitation {
    /// Excitation about the home pose of a machine. `delay_motion` begins and ends at rest at home.
    pub fn new(machine: &Machine, series: FourierSeries, periods: u32, delay_motion: FittedMotion) -> Self {
        Self { home: machine.home.into(), series, periods, delay_motion }
    }

    /// Its periodic displacement from home.
    pub fn series(&self) -> &FourierSeries {
        &self.series
    }

    /// Number of counted periods.
    pub fn periods(&self) -> u32 {
        self.periods
    }

    /// Beginning and end of the counted periods \[s\].
    pub fn counted_interval_s(&self) -> [f64; 2] {
        [BLEND_S, BLEND_S + f64::from(self.periods) * PERIOD_S]
    }

    /// Duration \[s\].
    pub fn duration(&self) -> f64 {
        self.blended_out() + self.delay_motion.duration_s
    }

    /// X, X', X'' at `t_s` seconds after the start; at rest at home outside \[0, duration\].
    pub fn at(&self, t_s: f64) -> TaskState {
        let end = self.blended_out();
        if t_s >= end {
            return self.delay_motion.at(t_s - end);
        }
        let mut state = scaled_by_profile(&self.series.at(t_s - BLEND_S), &window(t_s, end, BLEND_S));
        state.x += self.home;
        state
    }

    /// The same motion with a share of the amplitude of its periodic part.
    pub fn smaller(&self, share: f64) -> Self {
        Self { series: self.series.scaled(share), ..*self }
    }

    /// End of the periodic part \[s\].
    fn blended_out(&self) -> f64 {
        let [_, end] = self.counted_interval_s();
        end + BLEND_S
    }
}
