//! Columns of a CSV table by name, in SI units or in another that the name ends with: `x` or `x_mm`, `t_ms`, `alpha_deg`,
//! `x_rate_mm_s`, `alpha_accel_deg_s2`, `length_1_mm`, `length_rate_1_mm_s`.

use super::excerpt::excerpt;
use super::numbers::AXES;

/// Units of a time, a length and an angle, with their factors to SI.
const TIMES: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
const LENGTHS: [(&str, f64); 3] = [("m", 1.0), ("mm", 1e-3), ("um", 1e-6)];
const ANGLES: [(&str, f64); 3] = [("rad", 1.0), ("mrad", 1e-3), ("deg", core::f64::consts::PI / 180.0)];

/// Column of a file that is one of those to be read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Column {
    /// Place in a row.
    pub index: usize,
    /// Name in the file.
    pub name: String,
    /// Factor from its unit to SI.
    pub factor: f64,
}

/// Every column of the header that is the one of this name, in whatever unit.
pub(super) fn find(header: &[String], name: &str) -> Vec<Column> {
    let units = units(name);
    let factor = |found: &str| {
        let unit = found.strip_prefix(name)?;
        if unit.is_empty() {
            return Some(1.0);
        }
        let unit = unit.strip_prefix('_')?;
        units.iter().find(|(known, _)| known == unit).map(|(_, factor)| *factor)
    };
    let columns = header.iter().enumerate();
    columns
        .filter_map(|(index, found)| Some(Column { index, name: found.clone(), factor: factor(found)? }))
        .collect()
}

/// What a header has in place of a column that is missing: one with another unit. Empty if there is none.
pub(super) fn hint(header: &[String], name: &str) -> String {
    let units: Vec<_> = units(name).into_iter().map(|(unit, _)| unit).collect();
    let is_like = |found: &&String| {
        let rest = found.strip_prefix(name).and_then(|rest| rest.strip_prefix('_'));
        rest.is_some_and(|unit| !["rate", "accel"].iter().any(|part| unit.starts_with(part)))
    };
    match header.iter().find(is_like) {
        Some(found) if !units.is_empty() => {
            format!(" ({}: its units are {})", excerpt(found), units.join(", "))
        }
        _ => String::new(),
    }
}

/// Units of a column by its name, each with the factor to SI; none for a name without known quantity.
fn units(name: &str) -> Vec<(String, f64)> {
    let order = if name.contains("_rate") { 1 } else { usize::from(name.contains("_accel")) * 2 };
    let stem = name.split('_').next().unwrap_or_default();
    let base: &[(&str, f64)] = match (stem, AXES.iter().position(|axis| *axis == stem)) {
        ("t", _) => &TIMES,
        ("length", _) | (_, Some(3..)) => &LENGTHS,
        (_, Some(_)) => &ANGLES,
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
            ("length_1", None),
        ] {
            assert_eq!(factor(name), expected, "{name}");
        }
        assert_eq!(hint(&header, "z"), " (z_cm: its units are m, mm, um)");
        assert_eq!(hint(&header, "gamma"), "");
    }
}
