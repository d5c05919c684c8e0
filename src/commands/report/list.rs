//! List of a run's events: a row each, and one row for a kind of event that repeats, so that it hides nothing else.

use std::collections::BTreeMap;

use serde::Serialize;

use super::history::History;
use super::track::{Interval, Track};
use hexad_core::control::signals::state::State;

/// Number of intervals of one kind up to which each has a row of its own.
const MAX_ROWS_OF_A_KIND: usize = 3;

/// Row of the list.
#[derive(Debug, PartialEq, Serialize)]
pub struct Row {
    /// First instant \[s\].
    pub from: f64,
    /// Last instant \[s\].
    pub to: f64,
    /// Name of the track.
    pub name: &'static str,
    /// What happened.
    pub text: String,
}

/// All rows in the order of time. States, configurations and requests have a row each, whatever their number.
pub fn rows(history: &History) -> Vec<Row> {
    let mut rows = vec![];
    for track in history.tracks() {
        let mut kinds: BTreeMap<u32, Vec<&Interval>> = BTreeMap::new();
        track.intervals.iter().for_each(|interval| kinds.entry(interval.key).or_default().push(interval));
        for intervals in kinds.values() {
            match intervals[..] {
                [first, .., last] if !track.is_whole() && intervals.len() > MAX_ROWS_OF_A_KIND => {
                    // Missed deadlines as the summary counts them.
                    let is_counted = track.group == "missed deadlines";
                    let count = if is_counted { track.count } else { intervals.len() as u64 };
                    let unit = if is_counted { "times" } else { "intervals" };
                    let text = format!("{count} {unit}; the first: {}", first.text);
                    rows.push(Row { from: first.from, to: last.to, name: track.name, text });
                }
                _ => rows.extend(intervals.iter().map(|interval| row(history, track, interval))),
            }
        }
    }
    rows.sort_by(|a, b| a.from.total_cmp(&b.from));
    rows
}

/// The row of a fault has its sentence.
fn row(history: &History, track: &Track, interval: &Interval) -> Row {
    let Interval { from, to, key, ref text } = *interval;
    let is_fault = track.group == "state" && key == State::Fault as u32;
    let fault = history.faults.iter().find(|fault| is_fault && fault.t == from);
    let text = fault.map_or_else(|| text.clone(), |fault| format!("{text}: {}", fault.text));
    Row { from, to, name: track.name, text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_client::messages::CycleMessage;
    use hexad_core::control::controller::Output;
    use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
    use hexad_core::control::signals::inputs::Input;
    use hexad_core::control::signals::state::Request;
    use hexad_machine::config::Config;

    /// A flood of late inputs, with a request every 10 cycles and a fault every 100.
    #[test]
    fn late_inputs_are_one_row_and_hide_no_state_no_fault_and_no_request() {
        let text = include_str!("../../../config/fried2008.toml");
        let mut history = History::new(&Config::parse(text, "a test").unwrap());
        let lost = Diagnostic::new(DiagnosticCode::MeasurementLost, 0.25, 0.2);
        let cycles = 300_000;
        for number in 1..=cycles {
            let is_fault = number % 100 == 99;
            let (state, diagnostic) =
                if is_fault { (State::Fault, lost) } else { (State::Active, Diagnostic::default()) };
            let input = Input { release_ns: number * 1_000_000, ..Input::default() };
            let cycle = CycleMessage::new(&input, &Output { state, diagnostic, ..Output::default() });
            let (request, request_sequence) = (Request::Clear as u32, number / 10);
            let io_late = u32::from(number % 3 == 0);
            let is_added = history.add(&CycleMessage {
                cycle: number,
                io_late,
                has_request: u32::from(number % 10 == 0),
                request,
                request_sequence,
                ..cycle
            });
            assert!(is_added);
        }
        let rows = rows(&history);
        let count = |name, beginning| {
            rows.iter().filter(|row| row.name == name && row.text.starts_with(beginning)).count() as u64
        };
        assert_eq!(count("request", "clear"), cycles / 10);
        let sentence = "fault: measurement lost: age 0.25 s exceeds timeouts.measured_ms 0.2 s";
        assert_eq!([count("state", "active"), count("state", sentence)], [cycles / 100 + 1, cycles / 100]);
        let late: Vec<_> = rows.iter().filter(|row| row.name == "inputs late").collect();
        let text = "100000 times; the first: cycle 3 used the inputs of the cycle before".into();
        assert_eq!(late, [&Row { from: 0.002, to: 299.999, name: "inputs late", text }]);
        // What is left is the diagnostic of the faults.
        assert_eq!(rows.len() as u64, cycles / 10 + 2 * (cycles / 100) + 1 + 1 + 1);
        assert!(rows.is_sorted_by(|a, b| a.from <= b.from));
    }
}
