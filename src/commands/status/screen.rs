//! Status as text for a terminal of 80 columns; of 24 lines, unless something is long.

use core::fmt;

use hexad_client::operator::protocol::AnswerLine;
use hexad_client::operator::status_report::{ConfigurationReport, LegReport, SourceReport, StatusReport};
use hexad_core::control::signals::state::State;
use hexad_machine::text::coordinate_rows::CoordinateFormat;
use hexad_machine::text::numbers::{MotionDigits, fixed, readable, significant};
use hexad_machine::text::text_table::paragraph;
use hexad_machine::text::units::{ANGLES, LENGTHS, MotionUnits};

/// Columns of the screen.
const WIDTH: usize = 80;
/// Lines of a diagnostic, and more if it is longer, so that the others seldom move.
const DIAGNOSTIC_LINES: usize = 2;
/// Number of digits of a hash that are shown, enough to distinguish two files.
const SHA1_DIGITS: usize = 10;
/// Length of a bar \[characters\].
const BAR: usize = 26;
/// Longest time to a singular pose that is shown \[s\]. The motion will change within a longer one.
const MAX_TIME_TO_SINGULARITY_S: f64 = 100.0;

/// Status as text for the screen, with a label of the coordinates and their units.
pub struct Screen<'a>(pub &'a AnswerLine, pub &'a str, pub MotionUnits);

impl fmt::Display for Screen<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(answer, label, units) = self;
        let Some(report) = &answer.status else { return writeln!(f, "{}", answer.text) };
        let age = report
            .age_s
            .map_or_else(|| "no cycle yet".into(), |age_s| format!("cycle {} ago", age_text(age_s)));
        let right = format!("process {}, {age}", report.process_id);
        let left = format!("{}   {}", report.machine, answer.state.to_uppercase());
        writeln!(f, "{left}{right:>width$}", width = WIDTH.saturating_sub(left.chars().count()))?;
        let code = answer.diagnostic.code;
        let head = if code == 0 { String::new() } else { format!("{code} ") };
        let text = if code == 0 { progress(answer, report) } else { answer.diagnostic.text.clone() };
        let lines = paragraph(&head, &text, WIDTH);
        write!(f, "{lines}{}", "\n".repeat(DIAGNOSTIC_LINES.saturating_sub(lines.lines().count())))?;
        report
            .warnings
            .iter()
            .try_for_each(|warning| write!(f, "{}", paragraph("warning: ", warning, WIDTH)))?;
        timing(f, report)?;
        poses(f, report, label, *units)?;
        legs(f, report)?;
        singularity(f, report)?;
        report.sources.iter().try_for_each(|source| write!(f, "{}", source_lines(source)))?;
        let inputs =
            report.sources.iter().flat_map(|source| &source.processes).filter_map(|it| it.input.as_ref());
        inputs.map(|input| paragraph("input     ", input, WIDTH)).try_for_each(|text| write!(f, "{text}"))?;
        let mut rides = report.sources.iter().flat_map(|source| &source.processes).filter_map(|it| it.ride);
        rides.try_for_each(|phase| writeln!(f, "ride      {}", phase.name()))?;
        writeln!(f, "{}", file_line(&report.configuration))
    }
}

/// Without a diagnostic: whether the platform has arrived, and while it engages how far the setpoint is.
fn progress(answer: &AnswerLine, report: &StatusReport) -> String {
    match report.setpoint_distance {
        _ if report.in_position => "in position".into(),
        Some(distance) if answer.state == State::Engaging.name() => {
            let [length, angle] = distance;
            format!("the setpoint is {} and {} away", readable(length, LENGTHS), readable(angle, ANGLES))
        }
        _ => "no diagnostic".into(),
    }
}

/// Line with the machine file in force; of a long path only the end.
fn file_line(configuration: &ConfigurationReport) -> String {
    let ConfigurationReport { file, sha1, reloads, .. } = configuration;
    let tail = format!(", sha1 {}, reloads {reloads}", sha1.get(..SHA1_DIGITS).unwrap_or(sha1));
    let room = WIDTH.saturating_sub("file      ".len() + tail.chars().count());
    let hidden = file.chars().count().saturating_sub(room);
    let shown: String = file.chars().skip(hidden).collect();
    format!("file      {shown}{tail}")
}

fn timing(f: &mut fmt::Formatter<'_>, report: &StatusReport) -> fmt::Result {
    let timing = &report.timing;
    let limits =
        if report.active_limits.is_empty() { "none".into() } else { report.active_limits.join(", ") };
    let scale = format!("scale {}, reached or near: ", report.limits_scale);
    write!(f, "{}", paragraph("limits    ", &format!("{scale}{limits}"), WIDTH))?;
    writeln!(
        f,
        "cycles    {} at {} Hz; late {}, overruns {}, skipped {}",
        timing.cycles, timing.rate_hz, timing.late_wakeups, timing.overruns, timing.skipped
    )?;
    let [wake_99, wake_max] = timing.wakeup_ns.map(microseconds);
    let [compute_99, compute_max] = timing.compute_ns.map(microseconds);
    writeln!(
        f,
        "last s    wake-up p99 {wake_99} us, max {wake_max} us; compute p99 {compute_99} us, max {compute_max} us"
    )
}

/// Poses and their error in units, with a label of the coordinates.
pub(in crate::commands) fn poses(
    f: &mut fmt::Formatter<'_>,
    report: &StatusReport,
    label: &str,
    units: MotionUnits,
) -> fmt::Result {
    let error = report.orientation_error_rad.zip(report.position_error_m);
    let error = error.map(|([a, b, c], [x, y, z])| [a, b, c, x, y, z]);
    let rows = [("pose", report.pose, 0), ("setpoint", report.setpoint, 0), ("error", error, 1)];
    let table = CoordinateFormat::new(units, report.resolution).table("", &rows);
    writeln!(f, "{label}\n{table}")
}

pub(in crate::commands) fn legs(f: &mut fmt::Formatter<'_>, report: &StatusReport) -> fmt::Result {
    let digits = MotionDigits::new(report.resolution).mm;
    let coarse = digits - 2;
    let [shortest, longest] = report.stroke_m.map(|length_m| length_m * 1e3);
    let [left, right] = [shortest, longest].map(|end| fixed(end, coarse));
    let strokes = format!("{left}{right:>width$}", width = (BAR + 2).saturating_sub(left.len()));
    writeln!(f, "leg  length mm  {strokes}     mm/s  force N")?;
    if report.legs.is_empty() {
        return writeln!(f, "{}no measurement{}", " ".repeat(5), "\n".repeat(5));
    }
    for (k, leg) in report.legs.iter().enumerate() {
        let LegReport { length_m, rate_m_s, force_n } = leg;
        let share = (length_m * 1e3 - shortest) / (longest - shortest);
        writeln!(
            f,
            "{:>3}{:>11}  {}{:>9}{:>9}  {}",
            k + 1,
            fixed(length_m * 1e3, digits),
            bar(share, BAR, '#'),
            rate_m_s.map_or_else(|| "-".to_owned(), |rate| fixed(rate * 1e3, coarse)),
            fixed(*force_n, 1),
            bar(force_n.abs() / report.max_force_n, BAR / 2, if *force_n < 0.0 { '-' } else { '+' }),
        )?;
    }
    Ok(())
}

/// A bar filled up to a share of its width.
fn bar(share: f64, width: usize, full: char) -> String {
    let filled = (share.clamp(0.0, 1.0) * width as f64).round() as usize;
    let bar: String = (0..width).map(|k| if k < filled { full } else { '.' }).collect();
    format!("[{bar}]")
}

fn singularity(f: &mut fmt::Formatter<'_>, report: &StatusReport) -> fmt::Result {
    let condition = report.condition.map_or_else(|| "unknown".into(), significant);
    let ahead = match report.time_to_singularity_s {
        Some(time_s) if time_s < MAX_TIME_TO_SINGULARITY_S => format!("in {} s", significant(time_s)),
        _ => "none ahead".into(),
    };
    writeln!(
        f,
        "\ncondition {condition} (6 is best), limit {}; singular pose {ahead}",
        significant(report.condition_limit)
    )
}

fn source_lines(source: &SourceReport) -> String {
    let age = source.age_s.map_or_else(|| "never".into(), |age_s| format!("{} old", age_text(age_s)));
    let processes: Vec<_> = source
        .processes
        .iter()
        .map(|process| match process.command.as_str() {
            "" => format!("{} (ended)", process.process_id),
            command if process.is_ignored => format!("ignored: {command} {}", process.process_id),
            command => {
                let stopped = if process.is_stopped { " (STOPPED by SIGSTOP or a debugger)" } else { "" };
                format!("{command} {} of {}{stopped}", process.process_id, process.user)
            }
        })
        .collect();
    let from = if processes.is_empty() { "no process".into() } else { processes.join(", ") };
    let rejected = source.rejected.as_ref().map(|why| format!("REJECTED: {why}"));
    let text = rejected.unwrap_or_else(|| format!("{age}, from {from}"));
    paragraph(&format!("{:10}", source.topic), &text, WIDTH)
}

fn microseconds(time_ns: u64) -> String {
    significant(time_ns as f64 * 1e-3)
}

fn age_text(age_s: f64) -> String {
    match age_s {
        _ if age_s < 1.0 => format!("{:.1} ms", age_s * 1e3),
        _ if age_s < 600.0 => format!("{age_s:.1} s"),
        _ => format!("{:.0} min", age_s / 60.0),
    }
}

#[cfg(test)]
pub(in crate::commands) mod tests {
    use super::*;
    use hexad_client::operator::protocol::{DiagnosticReport, RequestResult, VERSION};
    use hexad_client::operator::status_report::{ProcessReport, TimingReport};
    use hexad_core::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
    use hexad_core::control::signals::limits::Limit;

    /// Answer in which every field has its greatest length.
    pub fn answer() -> AnswerLine {
        let process = ProcessReport {
            process_id: 4_194_304,
            command: "a".repeat(15),
            user: "operator".into(),
            ..ProcessReport::default()
        };
        let source = |topic: &str| SourceReport {
            topic: topic.into(),
            age_s: Some(0.0123),
            processes: vec![process.clone(), process.clone()],
            rejected: None,
        };
        let report = StatusReport {
            warnings: vec![],
            version: String::new(),
            machine: "m".repeat(20),
            process_id: 4_194_304,
            stops: None,
            configuration: ConfigurationReport {
                file: "/f".repeat(60),
                sha1: "0123456789abcdef".into(),
                reloads: 1_000_000,
                loaded_unix_s: 0,
            },
            age_s: Some(0.0011),
            in_position: false,
            setpoint_distance: Some([0.012_345, 0.001_234]),
            limits_scale: 0.123_456_789,
            active_limits: Limit::ALL.iter().map(|limit| limit.name().into()).collect(),
            timing: TimingReport { rate_hz: 1000.0, cycles: 1_000_000_000, ..TimingReport::default() },
            pose: Some([-3.1, 3.1, -0.0, -1.2345678, 1.1, 0.0]),
            setpoint: Some([0.1; 6]),
            target: None,
            position_error_m: Some([-1e-6, 2e-3, 0.0]),
            orientation_error_rad: Some([1e-5; 3]),
            condition: Some(6.789),
            condition_limit: 100.0,
            time_to_singularity_s: Some(0.5),
            legs: vec![LegReport { length_m: 1.225, rate_m_s: Some(-0.123), force_n: -250.0 }; 6],
            stroke_m: [0.85, 1.6],
            resolution: [1e-6, 2.5e-6],
            max_force_n: 500.0,
            sources: vec![source("setpoint"), source("measured")],
        };
        let diagnostic = Diagnostic::new(DiagnosticCode::SetpointTooFar, 5.0, 1.0);
        AnswerLine {
            version: VERSION,
            result: RequestResult::Done,
            request: "status".into(),
            id: None,
            state: "stopping".into(),
            diagnostic: DiagnosticReport {
                value: Some(5.0),
                bound: Some(1.0),
                text: diagnostic.to_string(),
                ..DiagnosticReport::default()
            },
            text: diagnostic.to_string(),
            status: Some(Box::new(report)),
        }
    }

    #[test]
    fn it_is_as_wide_as_the_smallest_terminal_and_cuts_nothing() {
        let mut answer = answer();
        (answer.diagnostic.code, answer.diagnostic.text) = (113, "of every length ".repeat(20) + "clear it");
        for known in [true, false] {
            let text = Screen(&answer, "", MotionUnits::default()).to_string();
            assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
            let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(words.contains("113 of every length") && words.contains("length clear it"), "{text}");
            assert_eq!(words.contains("following error, condition"), known, "{text}");
            assert_eq!(words.contains("unknown") && words.contains("no measurement"), !known, "{text}");
            let report = answer.status.as_mut().unwrap();
            **report = StatusReport {
                stroke_m: report.stroke_m,
                resolution: report.resolution,
                ..StatusReport::default()
            };
        }
        answer.diagnostic.text = "as long as most are".into();
        assert!(
            Screen(&answer, "", MotionUnits::default()).to_string().lines().count() <= 24,
            "fits the smallest terminal"
        );
    }

    #[test]
    fn numbers_are_in_millimetres_and_degrees_and_bars_in_proportion() {
        let text = Screen(&answer(), "", MotionUnits::default()).to_string();
        let line = |name: &str| text.lines().find(|line| line.starts_with(name)).unwrap().to_owned();
        let pose: Vec<_> = line("pose").split_whitespace().map(String::from).collect();
        assert_eq!(pose, ["pose", "-177.6169", "177.6169", "0.0000", "-1234.568", "1100.000", "0.000"]);
        assert!(line("error").contains("-0.0010     2.0000"), "{text}");
        let leg = line("  1");
        assert_eq!((leg.matches('#').count(), leg.matches('-').count()), (13, 7 + 2), "{leg}");
        assert!(text.contains("singular pose in 0.500 s"), "{text}");
    }

    #[test]
    fn without_a_diagnostic_it_says_how_far_the_setpoint_is() {
        let mut answer = answer();
        (answer.state, answer.diagnostic.code) = ("engaging".into(), 0);
        let words = "\nthe setpoint is 12.3 mm and 1.23 mrad away\n";
        assert!(
            Screen(&answer, "", MotionUnits::default()).to_string().contains(words),
            "{}",
            Screen(&answer, "", MotionUnits::default())
        );
        answer.status.as_mut().unwrap().in_position = true;
        assert!(
            Screen(&answer, "", MotionUnits::default()).to_string().contains("\nin position\n"),
            "{}",
            Screen(&answer, "", MotionUnits::default())
        );
    }

    #[test]
    fn a_small_stroke_has_more_digits() {
        let mut answer = answer();
        let report = answer.status.as_mut().unwrap();
        report.stroke_m = [0.083_303_7, 0.083_403_7];
        report.resolution = [1e-9, 1.4e-8];
        report.pose = Some([0.0, 0.0, 1e-6, 0.0, 25e-6, 0.135_012]);
        report.legs = vec![LegReport { length_m: 0.083_351_2, rate_m_s: Some(-0.01), force_n: -250.0 }; 6];
        let text = Screen(&answer, "", MotionUnits::default()).to_string();
        for words in ["0.000057", "0.025000", "135.012000", "83.3037 ", " 83.4037 ", "83.351200", "-10.0000"]
        {
            assert!(text.contains(words), "{words}: {text}");
        }
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
        let text = Screen(&answer, "", MotionUnits::read("nm,arcsec").unwrap()).to_string();
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        for words in ["alpha arcsec", "z nm pose 0.000 0.000 0.206 0 25000 135012000 setpoint"] {
            assert!(text.contains(words), "{words}: {text}");
        }
    }
}
