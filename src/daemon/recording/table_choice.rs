//! Columns and rows of a recording's table, as a person chooses them.

use super::RecordingError;
use hexad_client::messages::CycleMessage;
use hexad_machine::text::nearest::nearest;

/// Most columns that are named as similar to one that does not exist.
const MAX_SIMILAR: usize = 5;

/// Choice of columns and rows.
#[derive(Clone, Debug)]
pub struct TableChoice {
    /// Columns or groups by name; empty for every column that has a number in any cycle.
    pub columns: Vec<String>,
    /// Cycles with a row.
    pub every: Every,
}

/// Cycles with a row: the first of each interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Every {
    /// Intervals of so many cycles.
    Cycles(u64),
    /// Intervals of this time \[ns\].
    Time(u64),
}

impl Every {
    /// Number of the interval in which a cycle is, counted from the first cycle. Missing cycles do not shift the intervals.
    pub(super) fn interval(self, first: &CycleMessage, cycle: &CycleMessage) -> u64 {
        let (passed, length) = match self {
            Self::Cycles(count) => (cycle.cycle.saturating_sub(first.cycle), count),
            Self::Time(time_ns) => (cycle.release_ns.saturating_sub(first.release_ns), time_ns),
        };
        passed / length.max(1)
    }
}

impl TableChoice {
    /// Which of these columns are written. Of a group, and without a choice, those are that have a number.
    pub(super) fn kept(&self, names: &[String], has_number: &[bool]) -> Result<Vec<bool>, RecordingError> {
        if self.columns.is_empty() {
            return Ok(has_number.to_vec());
        }
        let (mut kept, mut errors) = (vec![false; names.len()], vec![]);
        for wanted in self.columns.iter().map(|name| name.trim()) {
            let is_in = columns_of(wanted, names);
            let found = names
                .iter()
                .zip(has_number)
                .map(|(name, has_number)| is_in(name) && (*has_number || name == wanted));
            let found: Vec<_> = found.collect();
            kept.iter_mut().zip(&found).for_each(|(kept, found)| *kept |= found);
            if !names.iter().any(|name| is_in(name)) {
                errors.push(format!("{wanted}: no such column or group{}", similar(wanted, names)));
            } else if !found.contains(&true) {
                errors.push(format!("{wanted}: no cycle of the recording has a number in it"));
            }
        }
        if errors.is_empty() {
            return Ok(kept);
        }
        let with_number = names.iter().zip(has_number).filter(|(_, has_number)| **has_number);
        let all = stems(with_number.map(|(name, _)| name.as_str())).join(", ");
        Err(RecordingError::Columns(format!("{}; the recording has {all}", errors.join("; "))))
    }
}

/// Whether a column is the one of this name; without such a column, one of six of this name, else of this group.
fn columns_of<'a>(wanted: &'a str, names: &[String]) -> impl Fn(&str) -> bool + use<'a> {
    let has_name = names.iter().any(|name| name == wanted);
    let has_six = names.iter().any(|name| stem(name) == wanted);
    move |name| match (has_name, has_six) {
        (true, _) => name == wanted,
        (false, true) => stem(name) == wanted,
        (false, false) => name.strip_prefix(wanted).is_some_and(|rest| rest.starts_with('_')),
    }
}

/// Name without the number at its end.
fn stem(name: &str) -> &str {
    name.rsplit_once('_').filter(|(_, end)| end.parse::<u8>().is_ok()).map_or(name, |(stem, _)| stem)
}

/// Names, of which those that differ in their number appear once.
fn stems<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut stems: Vec<_> = names.map(stem).collect();
    stems.dedup();
    stems
}

/// Clause with the names that are probably meant: the nearest, or those with the nearest word.
fn similar(wanted: &str, names: &[String]) -> String {
    let stems = stems(names.iter().map(String::as_str));
    let words: Vec<_> = stems.iter().flat_map(|name| name.split('_')).collect();
    let near = nearest(wanted, &stems).or_else(|| nearest(wanted, &words)).unwrap_or(wanted);
    let is_choice = names.iter().any(|name| columns_of(near, names)(name));
    let mut found: Vec<_> = is_choice.then_some(near).into_iter().collect();
    found.extend(stems.iter().filter(|name| **name != near && name.contains(near)));
    found.truncate(MAX_SIMILAR);
    if found.is_empty() { String::new() } else { format!(", probably {}", found.join(" or ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of a table in which the target has no number, chosen by a list of names.
    fn kept(columns: &str) -> Result<String, String> {
        const NAMES: &str = "t setpoint_t setpoint_x setpoint_x_rate measured_length_1 measured_length_2 measured_length_rate_1 \
                             target_x target_y state";
        let names: Vec<_> = NAMES.split(' ').map(String::from).collect();
        let has_number: Vec<_> = names.iter().map(|name| !name.starts_with("target")).collect();
        let columns = columns.split(',').filter(|name| !name.is_empty()).map(String::from).collect();
        let kept = TableChoice { columns, every: Every::Cycles(1) }.kept(&names, &has_number);
        let kept = kept.map_err(|error| error.to_string())?;
        let names = names.into_iter().zip(kept).filter(|(_, is_kept)| *is_kept).map(|(name, _)| name);
        Ok(names.collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn columns_are_chosen_by_name_by_their_six_or_by_group() {
        const SETPOINT: &str = "setpoint_t setpoint_x setpoint_x_rate";
        const LENGTHS: &str = "measured_length_1 measured_length_2";
        for (columns, wanted) in [
            ("", format!("t {SETPOINT} {LENGTHS} measured_length_rate_1 state")),
            ("state,t, t", "t state".into()),
            ("setpoint_x", "setpoint_x".into()),
            ("setpoint", SETPOINT.into()),
            ("measured_length", LENGTHS.into()),
            ("measured", format!("{LENGTHS} measured_length_rate_1")),
            ("target_x", "target_x".into()),
        ] {
            assert_eq!(kept(columns), Ok(wanted), "{columns}");
        }
    }

    #[test]
    fn a_name_that_fits_nothing_is_refused_with_what_is_probably_meant() {
        let list = "; the recording has t, setpoint_t, setpoint_x, setpoint_x_rate, measured_length, measured_length_rate, state";
        for (columns, words) in [
            ("stat", "stat: no such column or group, probably state"),
            ("t,lenght", "lenght: no such column or group, probably measured_length or measured_length_rate"),
            (
                "setpoin",
                "setpoin: no such column or group, probably setpoint or setpoint_t or setpoint_x or setpoint_x_rate",
            ),
            (
                "speed,target",
                "speed: no such column or group; target: no cycle of the recording has a number in it",
            ),
        ] {
            assert_eq!(kept(columns), Err(format!("--columns: {words}{list}")), "{columns}");
        }
    }

    /// A cycle that is missing makes no interval longer.
    #[test]
    fn rows_are_the_first_of_each_interval() {
        let cycle =
            |number: u64| CycleMessage { cycle: number, release_ns: 1000 * number, ..Default::default() };
        for (every, rows) in [(Every::Cycles(3), [7, 10, 15]), (Every::Time(4000), [7, 12, 15])] {
            let mut numbers = vec![7, 8, 9, 10, 12, 15];
            numbers.dedup_by_key(|number| every.interval(&cycle(7), &cycle(*number)));
            assert_eq!(numbers, rows, "{every:?}");
        }
    }
}
