//! Columns of a CSV table by name, in SI units or in another that the name ends with: `x` or `x_um`, `t_ms`, `alpha_arcsec`,
//! `x_rate_mm_s`, `alpha_accel_deg_s2`, `length_1_mm`, `length_rate_1_mm_s`; or in brackets: `x [mm]`, `x_rate (mm/s)`.

use super::excerpt::excerpt;
use super::numbers::AXES;
use super::units::{ANGLES, LENGTHS, TIMES, in_letters};

/// What units of quotients are written with, and the text in the place of it.
const QUOTIENTS: [(&str, &str); 3] = [("/", "_"), ("^", ""), ("²", "2")];

/// Other words for columns, only to show a header: angles of other names may be of another order of rotations.
const WORDS: [(&str, &str); 4] = [("t", "time"), ("alpha", "roll"), ("beta", "pitch"), ("gamma", "yaw")];

/// What names of columns with coordinates of reflectors begin with: `point_1_x`. Their cells are empty where one was not seen.
const POINT: &str = "point";

/// Column of a file that is one of those to be read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Column {
    /// Place in a row.
    pub index: usize,
    /// Name in the file.
    pub name: String,
    /// Name without unit.
    pub quantity: String,
    /// Factor from its unit to SI.
    pub factor: f64,
}

impl Column {
    /// Whether cells may be empty, which is read as NaN.
    pub fn may_be_empty(&self) -> bool {
        self.quantity.split('_').next() == Some(POINT)
    }
}

/// Every column of the header that is the one of this name, in whatever unit.
pub(super) fn find(header: &[String], name: &str) -> Vec<Column> {
    let factor = |found: &str| match found.strip_prefix(name)? {
        "" => Some(1.0),
        rest => factor(name, rest.strip_prefix('_').or_else(|| in_brackets(rest))?),
    };
    let column = |(index, found): (usize, &String)| {
        Some(Column { index, name: found.clone(), quantity: name.into(), factor: factor(found)? })
    };
    header.iter().enumerate().filter_map(column).collect()
}

/// Factor from a unit of a column to SI; none if it is not one of its units.
pub(super) fn factor(name: &str, unit: &str) -> Option<f64> {
    let unit = in_brackets(unit).unwrap_or(unit);
    let unit = QUOTIENTS.iter().fold(in_letters(unit), |unit, (from, to)| unit.replace(from, to));
    units(name).into_iter().find(|(known, _)| *known == unit).map(|(_, factor)| factor)
}

/// What is in brackets or parentheses.
fn in_brackets(text: &str) -> Option<&str> {
    let within = |(open, close)| text.trim().strip_prefix(open)?.strip_suffix(close);
    [('[', ']'), ('(', ')')].into_iter().find_map(within).map(str::trim)
}

/// Whether what follows a name is meant as its unit.
fn is_unit(rest: &str) -> bool {
    rest.trim_start().starts_with(['_', '[', '('])
        && !["_rate", "_accel"].iter().any(|part| rest.starts_with(part))
}

/// What a header has in place of a column that is missing: one with another unit.
pub(super) fn hint(header: &[String], name: &str) -> Option<String> {
    let is_like = |found: &&String| found.strip_prefix(name).is_some_and(is_unit);
    let (found, units) = (header.iter().find(is_like)?, unit_names(name));
    (!units.is_empty()).then(|| format!(" ({}: its units are {units})", excerpt(found)))
}

/// Units of a column, for people.
pub(super) fn unit_names(name: &str) -> String {
    units(name).into_iter().map(|(unit, _)| unit).collect::<Vec<_>>().join(", ")
}

/// The right header nearest to one that lacks columns: names of other words, case or unit are replaced, others added.
pub(super) fn nearest_header(header: &[String], required: &[String]) -> Vec<String> {
    let mut absent: Vec<_> = required.iter().filter(|name| find(header, name).is_empty()).collect();
    let is_unknown = absent.len() == required.len();
    let mut nearest: Vec<String> = header.to_vec();
    for found in &mut nearest {
        let right = absent.iter().enumerate().find_map(|(k, name)| Some((k, respelled(found, name)?)));
        if let Some((k, right)) = right {
            *found = right;
            absent.remove(k);
        }
    }
    if is_unknown && absent.len() == required.len() {
        nearest.clear();
    }
    nearest.extend(absent.into_iter().cloned());
    nearest
}

/// Column that a header names by a synonym or in another case, with the unit of the header or the SI unit.
fn respelled(found: &str, name: &str) -> Option<String> {
    let found = found.to_lowercase();
    let words = WORDS.into_iter().filter(|(known, _)| *known == name).map(|(_, word)| word);
    let rest = words
        .chain([name])
        .find_map(|word| found.strip_prefix(word).filter(|rest| rest.is_empty() || is_unit(rest)))?;
    let right = format!("{name}{rest}");
    let (unit, _) = units(name).into_iter().next()?;
    Some(if find(core::slice::from_ref(&right), name).is_empty() { format!("{name}_{unit}") } else { right })
}

/// Units of a column by its name, each with the factor to SI; none for a name without known quantity.
fn units(name: &str) -> Vec<(String, f64)> {
    let order = if name.contains("_rate") { 1 } else { usize::from(name.contains("_accel")) * 2 };
    let stem = name.split('_').next().unwrap_or_default();
    let base = match (stem, AXES.iter().position(|axis| *axis == stem)) {
        ("t", _) => TIMES,
        ("length" | POINT, _) | (_, Some(3..)) => LENGTHS,
        (_, Some(_)) => ANGLES,
        _ => &[],
    };
    let per = ["", "_s", "_s2"].get(order).copied().unwrap_or_default();
    base.iter().map(|(unit, factor)| (format!("{unit}{per}"), *factor)).collect()
}

/// Names of six columns, `stem_1 ... stem_6`.
pub fn legs(stem: &str) -> Vec<String> {
    (1..=6).map(|leg| format!("{stem}_{leg}")).collect()
}

/// Names of the columns of X or a derivative, `alpha<suffix> ... z<suffix>`.
pub fn coordinates(suffix: &str) -> Vec<String> {
    AXES.iter().map(|name| format!("{name}{suffix}")).collect()
}

/// Names of the columns of poses: `t` and X.
pub fn pose_columns() -> Vec<String> {
    ["t".into()].into_iter().chain(coordinates("")).collect()
}

/// Names of the columns of X' and X''.
pub fn derivative_columns() -> Vec<String> {
    coordinates("_rate").into_iter().chain(coordinates("_accel")).collect()
}

/// Names of the columns of a trajectory: `t`, X, X', X''.
pub fn trajectory_columns() -> Vec<String> {
    pose_columns().into_iter().chain(derivative_columns()).collect()
}

/// Names of the columns that forward kinematics needs: `t` and lengths.
pub fn length_columns() -> Vec<String> {
    ["t".into()].into_iter().chain(legs("length")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_belongs_to_the_quantity() {
        let header: Vec<String> = [
            "t_ms",
            "x_mm",
            "y",
            "alpha_deg",
            "beta_mm",
            "x_rate_mm_s",
            "gamma_accel_deg_s2",
            "length_3_mm",
            "length_rate_3_mm_s",
            "length_4_nm",
            "y_rate [µm/s]",
            "beta_rate_arcsec_s",
            "beta_accel (urad/s²)",
            "z_cm",
        ]
        .map(Into::into)
        .into();
        let factor = |name: &str| match find(&header, name).as_slice() {
            [] => None,
            [column] => Some(column.factor),
            more => panic!("{name}: {more:?}"),
        };
        let degree = 1.0_f64.to_radians();
        for (name, expected) in [
            ("t", Some(1e-3)),
            ("x", Some(1e-3)),
            ("y", Some(1.0)),
            ("z", None),
            ("alpha", Some(degree)),
            ("beta", None),
            ("x_rate", Some(1e-3)),
            ("x_accel", None),
            ("gamma_accel", Some(degree)),
            ("gamma", None),
            ("length_3", Some(1e-3)),
            ("length_rate_3", Some(1e-3)),
            ("length_4", Some(1e-9)),
            ("y_rate", Some(1e-6)),
            ("beta_rate", Some(degree / 3600.0)),
            ("beta_accel", Some(1e-6)),
            ("length_1", None),
        ] {
            assert_eq!(factor(name), expected, "{name}");
        }
        assert_eq!(hint(&header, "z").as_deref(), Some(" (z_cm: its units are m, mm, um, nm)"));
        assert_eq!(hint(&header, "gamma"), None);
    }
}
