//! Mistakes of a table that no joints within their tolerance explain, each tried against the drawn machine.

use nalgebra::{Matrix3, Vector3};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use super::model::{Geometry, Noise, Row, Seen, Unknowns};
use super::solve::{Problem, median};
use super::start::start;
use hexad_core::model::LEGS;
use hexad_core::model::machine::Machine;

/// Tolerance at which the joints stay as drawn, as a share of the radius.
const FIXED_RATIO: f64 = 1e-9;
/// Noise with which the frames are fitted, as a share of the radius: all residuals count alike.
const COARSE_RATIO: f64 = 1e-3;
/// Decrease of the cost, over it, that ends the fit of the frames.
const COARSE_PRECISION: f64 = 1e-4;
/// Misfit that a mistake must leave at most, as a share of the misfit without it.
const EXPLAINED_RATIO: f64 = 0.4;

/// Mistake of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mistake {
    /// The lengths of two legs, counted from 0, are exchanged.
    ExchangedLegs(usize, usize),
    /// An axis of positions, counted from 0, has the wrong sign, but orientations are right.
    MirroredAxis(usize),
    /// The tracker's frame is left-handed.
    LeftHanded,
    /// Lengths of legs must be multiplied by a factor.
    LengthUnit(f64),
    /// Positions of the tracker must be multiplied by a factor.
    TrackerUnit(f64),
}

/// Frames that suit the drawn machine best, and the median residual with them \[m\].
pub fn drawn_fit(machine: &Machine, rows: &[Row]) -> Option<(Unknowns, f64)> {
    let (nominal, radius) = (Geometry::of(machine), machine.joints.radius_m);
    let noise = Noise { length_m: radius, position_m: radius, angle_rad: 1.0 }.scaled(COARSE_RATIO);
    let tolerance_m = FIXED_RATIO * radius;
    let problem = Problem { rows, nominal: &nominal, tolerance_m, noise, precision: COARSE_PRECISION };
    let fit = problem.minimum(start(machine, rows)?)?;
    let square = median(fit.rows.iter().map(|(terms, _)| terms.residual.norm_squared()));
    Some((fit.unknowns, noise.length_m * square.sqrt()))
}

/// The mistake that explains a misfit \[m\] best, if one does.
pub fn likely_mistake(machine: &Machine, rows: &[Row], misfit_m: f64) -> Option<Mistake> {
    let has_reflectors = rows.iter().any(|row| matches!(row.seen, Seen::Reflectors(_)));
    let misfit = |mistake: Mistake| {
        let corrected: Vec<_> = rows.iter().map(|row| mistake.corrected(row)).collect();
        Some((mistake, drawn_fit(machine, &corrected)?.1))
    };
    // Reflectors do not show which axis is mirrored: the tracker's frame may have any orientation.
    let all: Vec<_> =
        all().filter(|it| !(has_reflectors && matches!(it, Mistake::MirroredAxis(_)))).collect();
    let found: Vec<_> = all.into_par_iter().filter_map(misfit).collect();
    let found = found.into_iter().filter(|(_, misfit)| *misfit < EXPLAINED_RATIO * misfit_m);
    found.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(mistake, _)| mistake)
}

fn all() -> impl Iterator<Item = Mistake> {
    let pairs = (0..LEGS).flat_map(|a| (a + 1..LEGS).map(move |b| Mistake::ExchangedLegs(a, b)));
    let units =
        [1e3, 1e-3].into_iter().flat_map(|unit| [Mistake::LengthUnit(unit), Mistake::TrackerUnit(unit)]);
    pairs.chain((0..3).map(Mistake::MirroredAxis)).chain([Mistake::LeftHanded]).chain(units)
}

impl Mistake {
    /// A row without the mistake.
    fn corrected(self, row: &Row) -> Row {
        let mut row = row.clone();
        match self {
            Self::ExchangedLegs(a, b) => row.lengths_m.swap_rows(a, b),
            Self::LengthUnit(factor) => row.lengths_m *= factor,
            Self::TrackerUnit(factor) => row.seen.for_each_place(|place| *place *= factor),
            Self::MirroredAxis(axis) => {
                let mut signs = Vector3::repeat(1.0);
                signs.iter_mut().skip(axis).take(1).for_each(|sign| *sign = -1.0);
                row.seen.for_each_place(|place| place.component_mul_assign(&signs));
            }
            Self::LeftHanded => {
                let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
                row.seen.for_each_place(|place| *place = mirror * *place);
                if let Seen::Probe(pose) = &mut row.seen {
                    pose.rotation = mirror * pose.rotation * mirror;
                }
            }
        }
        row
    }
}

impl Seen {
    fn for_each_place(&mut self, change: impl FnMut(&mut Vector3<f64>)) {
        match self {
            Self::Probe(pose) => [&mut pose.position].into_iter().for_each(change),
            Self::Reflectors(places) => places.iter_mut().flatten().for_each(change),
        }
    }
}
