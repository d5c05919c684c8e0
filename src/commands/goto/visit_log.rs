//! Output of `hexad goto --table`: a row for each target that was visited, each on the disk before the next motion.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use crate::commands::failure::Failure;
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::task::pose_of;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::log::utc_now;
use hexad_machine::text::csv_table::{
    NumberTable, TableError, TableErrors, coordinates as axes, in_group, legs, six,
};
use hexad_machine::text::csv_writer::CsvWriter;
use hexad_machine::text::files::{FileError, is_standard};

/// Largest difference between the same number of two files \[rad\], \[m\]: rounding of its unit.
const SAME: f64 = 1e-12;

/// The same between lengths and those of the pose that was computed from them \[m\].
const SAME_LENGTH_M: f64 = 1e-9;

/// File of the visits.
pub struct VisitLog {
    file: File,
    path: PathBuf,
    rows: CsvWriter,
    /// Bytes of `rows` that the file has.
    written: usize,
    count: usize,
    not_in_position: usize,
}

/// Columns with numbers; the time comes after them.
fn number_columns() -> Vec<String> {
    let poses = ["target", "reached"].map(|group| in_group(group, &axes(""))).concat();
    let names =
        [vec!["index".into()], poses, vec!["in_position".into()], legs("length"), legs("length_deviation")];
    names.concat()
}

impl VisitLog {
    /// Creates the file, or with `is_to_resume` goes on after its complete rows, which must be those of the first targets, with these
    /// frames of this machine.
    pub fn open(
        path: &Path,
        is_to_resume: bool,
        config: &Config,
        coordinates: &Coordinates,
        targets: &NumberTable,
    ) -> Result<Self, Failure> {
        let failed = |cause| Failure::before_start(FileError::on(path)(cause));
        let other = |text: &str| failed(io::Error::other(text));
        // Others cannot be resumed, and may be read without end.
        if is_standard(path) || fs::metadata(path).is_ok_and(|found| !found.is_file()) {
            return Err(other("--output must be a regular file, which --resume can read"));
        }
        let mut options = File::options();
        options.read(true).append(true).create(true).create_new(!is_to_resume);
        let mut file = options.open(path).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => {
                other("exists; --resume goes on after its rows, else name another --output")
            }
            _ => failed(error),
        })?;
        let mut text = vec![];
        file.try_lock().map_err(|_| other("another hexad goto --table writes it; end that first"))?;
        file.read_to_end(&mut text).map_err(failed)?;
        // A row that was not written to its end.
        text.truncate(text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1));
        let mut rows = CsvWriter::new(&[number_columns(), vec!["time".into()]].concat());
        let header = rows.text();
        let written = text.len().min(header.len());
        if !text.starts_with(header.get(..written).unwrap_or_default()) {
            return Err(other(
                "line 1: must be the header that hexad goto --table writes; name another --output",
            ));
        }
        let [mut count, mut not_in_position] = [0, 0];
        if text.len() > written {
            let table = visited(path, &text, config, coordinates, targets)?;
            count = table.rows().len();
            not_in_position = table.rows().iter().filter(|row| row.get(13) == Some(&0.0)).count();
        }
        file.set_len(text.len() as u64).map_err(failed)?;
        let mut log = Self { file, path: path.into(), rows, written, count, not_in_position };
        log.write().map_err(Failure::before_start)?;
        Ok(log)
    }

    /// Number of rows.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Adds a row: target and reached pose of the tool in the work frame \[rad\], \[m\], mean and standard deviation of each length \[m\].
    pub fn append(
        &mut self,
        poses: [[f64; 6]; 2],
        is_in_position: bool,
        lengths: [[f64; 6]; 2],
    ) -> Result<(), FileError> {
        let index = [(self.count + 1) as f64];
        let numbers = index.into_iter().chain(poses.into_iter().flatten());
        let numbers = numbers.chain([f64::from(u8::from(is_in_position))]);
        self.rows.row_with_names(numbers.chain(lengths.into_iter().flatten()), [utc_now().as_str()]);
        self.write()?;
        self.count += 1;
        self.not_in_position += usize::from(!is_in_position);
        Ok(())
    }

    fn write(&mut self) -> Result<(), FileError> {
        let text = self.rows.text();
        let new = text.get(self.written..).unwrap_or_default();
        let result = self.file.write_all(new).and_then(|()| self.file.sync_data());
        self.written = text.len();
        result.map_err(FileError::on(&self.path))
    }

    /// Numbers of rows, and of those not in position. Removes a file without rows.
    pub fn close(self) -> [usize; 2] {
        if self.count == 0 {
            // What remains is a header, which --resume reads.
            let _ = fs::remove_file(&self.path);
        }
        [self.count, self.not_in_position]
    }
}

/// The rows of a file. Names each that is not of the targets, of these frames or of this machine.
fn visited(
    path: &Path,
    text: &[u8],
    config: &Config,
    coordinates: &Coordinates,
    targets: &NumberTable,
) -> Result<NumberTable, TableError> {
    let table = NumberTable::from_reader(text, path, &number_columns(), &[])?;
    let mut errors = TableErrors::new(path);
    let is_same = |a: &[f64; 6], b: &[f64; 6], most| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= most);
    for (number, (row, line)) in table.rows().iter().zip(table.lines()).enumerate() {
        let reached = pose_of(&coordinates.platform_x(&six(row, 7)));
        match targets.rows().get(number) {
            None => {
                errors.add(format!("line {line}: row {} of a table of {}", number + 1, targets.rows().len()))
            }
            Some(target) if !is_same(&six(row, 1), &six(target, 1), SAME) => errors.add(format!(
                "line {line}: target {:?}, must be that of row {} of the table, {:?}; name another --output",
                six(row, 1),
                number + 1,
                six(target, 1)
            )),
            _ if !is_same(&leg_lengths(&config.machine, &reached), &six(row, 14), SAME_LENGTH_M) => {
                errors.add(format!(
                    "line {line}: the lengths are not those of the reached pose; --tool, --work and geometry must be as before"
                ));
            }
            _ => {}
        }
    }
    errors.into_result().map(|()| table)
}
