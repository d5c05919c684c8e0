//! Table of poses: six lengths and what a tracker has measured, row by row.

use std::io::Read;
use std::path::Path;

use nalgebra::{Vector3, Vector6};

use super::{length_columns, vector};
use crate::commands::failure::Failure;
use crate::commands::orientation::OrientationFormat;
use hexad_core::model::rigid::Pose;
use hexad_machine::analysis::calibration::model::{Row, Seen};
use hexad_machine::text::csv_table::{NumberTable, TableErrors};
use hexad_machine::text::files::{FileError, name_of, open};

/// Reads the rows and the lines that they begin in.
pub(super) fn read_rows(
    path: &Path,
    tracker: Option<&Path>,
    format: OrientationFormat,
) -> Result<(Vec<Row>, Vec<u64>), Failure> {
    let text = read(path)?;
    let lengths = NumberTable::from_reader(&text[..], name_of(path), &length_columns(), &[])?;
    let seen = match tracker {
        Some(path) => read_seen(&read(path)?, path, format)?,
        None => read_seen(&text, path, format)?,
    };
    let (count, of_tracker) = (lengths.rows().len(), seen.len());
    if let Some(other) = tracker
        && count != of_tracker
    {
        return Err(Failure::before_start(format_args!(
            "{}: {of_tracker} rows, must be {count} as in {}: a row for each pose, in the same order",
            other.display(),
            path.display()
        )));
    }
    let rows = lengths.rows().iter().zip(seen);
    let rows = rows.map(|(lengths, seen)| Row { lengths_m: vector(lengths), seen }).collect();
    Ok((rows, lengths.lines().to_vec()))
}

/// Lengths and poses in the base frame.
pub(super) fn poses_in_base(rows: &[Row]) -> Result<Vec<(Vector6<f64>, Pose)>, Failure> {
    let pose = |row: &Row| match &row.seen {
        Seen::Probe(pose) => Ok((row.lengths_m, *pose)),
        Seen::Reflectors(_) => Err(Failure::before_start(
            "--offsets-only takes poses in the base frame: columns x, y, z and alpha, beta, gamma, not reflectors",
        )),
    };
    rows.iter().map(pose).collect()
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    let mut text = vec![];
    open(path)
        .and_then(|mut file| file.read_to_end(&mut text).map_err(FileError::on(path)))
        .map_err(Failure::before_start)?;
    Ok(text)
}

fn read_seen(text: &[u8], path: &Path, format: OrientationFormat) -> Result<Vec<Seen>, Failure> {
    let place = name_of(path);
    let columns = |names: &[String]| NumberTable::from_reader(text, place, names, &[]);
    let of_point = |k: usize| ["x", "y", "z"].map(|axis| format!("point_{k}_{axis}"));
    let points = (1..).take_while(|k| columns(&of_point(*k)).is_ok()).count();
    if points > 0 {
        if points < 3 {
            return Err(Failure::before_start(format_args!(
                "{}: {points} reflectors (point_1_x ...), must be 3 at least: fewer do not show a pose",
                place.display()
            )));
        }
        let table = columns(&(1..=points).flat_map(of_point).collect::<Vec<_>>())?;
        let reflectors = |row: &Vec<f64>| {
            let (places, _) = row.as_chunks::<3>();
            let seen = places.iter().map(|place| Vector3::from(*place));
            Seen::Reflectors(seen.map(|place| place.iter().all(|x| x.is_finite()).then_some(place)).collect())
        };
        return Ok(table.rows().iter().map(reflectors).collect());
    }
    let names: Vec<_> = format.pose_columns().into_iter().skip(1).collect();
    if names.iter().all(|name| columns(core::slice::from_ref(name)).is_err())
        && columns(&of_point(1)[..1]).is_err()
    {
        return Err(Failure::before_start(format_args!(
            "{}: lengths alone. Whatever the joints are, some pose has these six lengths, so they show nothing; measure each pose with a \
             tracker, and add x, y, z, {}, or point_1_x, point_1_y, point_1_z and so on",
            place.display(),
            names.iter().take(names.len() - 3).map(String::as_str).collect::<Vec<_>>().join(", ")
        )));
    }
    let table = columns(&names)?;
    let (mut errors, mut seen) = (TableErrors::new(place), vec![]);
    for (row, line) in table.rows().iter().zip(table.lines()) {
        let row = [&[0.0], &row[..]].concat();
        match format.state(&row, false, &[0.0; 6]) {
            Ok(state) => seen.push(Seen::Probe(state.motion().pose)),
            Err(error) => errors.add(format!("line {line}: {error}")),
        }
    }
    errors.into_result()?;
    Ok(seen)
}
