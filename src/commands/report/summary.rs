//! Summary of a run as text.

use serde::Serialize;

use super::history::History;
use super::run::Run;
use crate::output::axis::{displayed_exponent, prefixed};
use hexad_client::messages::Times;
use hexad_machine::config::Config;

/// Largest number of faults described. The list shows all.
const MAX_FAULTS: usize = 20;

/// A fact about the run.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct Fact {
    /// Its subject.
    pub name: &'static str,
    /// Text of the fact.
    pub text: String,
    /// Whether it needs attention.
    pub is_bad: bool,
}

/// Facts of a complete run.
pub fn facts(run: &Run) -> Vec<Fact> {
    let (config, info, history) = (run.config(), run.info(), &run.history);
    let commit = if info.commit.is_empty() { "unknown" } else { &info.commit };
    let software = format!(
        "hexad {} (commit {commit}), fidelity {}, instruction set {}",
        info.version, info.fidelity, info.instruction_set
    );
    let mut facts = live_facts(config, history, &history.times(), Some(run.begin_s()));
    facts.insert(1, end(history, run.begin_s()));
    facts.extend(scaled_limits(config));
    facts.extend(configurations(run));
    facts.extend([lost(history), Fact { name: "Software", text: software, is_bad: false }]);
    facts
}

/// Facts as plain text below a title, for programs and browsers that run no script.
pub fn plain_text(title: &str, facts: &[Fact]) -> String {
    facts.iter().fold(format!("{title}\n"), |text, fact| format!("{text}{}: {}\n", fact.name, fact.text))
}

/// Facts of the run so far. `times`: wake-up and computation; `begin_s`: Unix time of the first cycle, if it is shown.
pub fn live_facts(config: &Config, history: &History, times: &[Times; 2], begin_s: Option<f64>) -> Vec<Fact> {
    let good = |name, text| Fact { name, text, is_bad: false };
    let rate_hz = config.deployment.realtime.rate_hz;
    let (length, cycles) = (duration(history.length_s()), thousands(history.cycles));
    let states = history.time_in_states();
    let states = states.iter().map(|(state, length)| format!("{} {}", state.name(), duration(*length)));
    vec![
        good("Run", format!("{length} at {rate_hz} Hz, {cycles} cycles")),
        good("States", states.collect::<Vec<_>>().join(", ")),
        faults(history, begin_s),
        tracking(history),
        missed(config, history),
        good("Times", times_in_words(times)),
    ]
}

fn faults(history: &History, begin_s: Option<f64>) -> Fact {
    let faults = &history.faults;
    let count = match faults.len() {
        0 => {
            let text = if history.is_unfinished { "none up to the last cycle" } else { "none" };
            return Fact { name: "Faults", text: text.into(), is_bad: false };
        }
        1 => "one".to_string(),
        many => many.to_string(),
    };
    let clock =
        |t: f64| begin_s.map_or_else(String::new, |begin_s| format!(" ({})", time_of_day(begin_s + t)));
    let described = faults
        .iter()
        .take(MAX_FAULTS)
        .map(|fault| format!("at {:.3} s{} {}", fault.t, clock(fault.t), fault.text));
    let mut text = format!("{count}: {}", described.collect::<Vec<_>>().join(". Then "));
    if faults.len() > MAX_FAULTS {
        text += &format!(". Then {} more, see the list of intervals", faults.len() - MAX_FAULTS);
    }
    Fact { name: "Faults", text, is_bad: true }
}

fn tracking(history: &History) -> Fact {
    let tracking = history.tracking.tracking();
    let text = if history.tracking.count() == 0 {
        "never active".into()
    } else {
        format!(
            "position {} RMS, {} largest; orientation {} RMS, {} largest (reference less estimated pose, in state active)",
            scaled(tracking.position_rms_m, "m"),
            scaled(tracking.position_max_m, "m"),
            scaled(tracking.orientation_rms_rad, "rad"),
            scaled(tracking.orientation_max_rad, "rad")
        )
    };
    Fact { name: "Tracking error", text, is_bad: false }
}

fn missed(config: &Config, history: &History) -> Fact {
    let [late, overruns, skipped, inputs] = history.missed().map(thousands);
    let late_us = config.deployment.realtime.late_wakeup_s * 1e6;
    let mut text = format!(
        "late wake-ups (above {late_us:.0} µs): {late}; overruns: {overruns}; skipped releases: {skipped}"
    );
    if inputs != "0" {
        text += &format!("; cycles without new inputs: {inputs}");
    }
    let [_, overruns, skipped, _] = history.missed();
    Fact { name: "Missed deadlines", text, is_bad: overruns + skipped > 0 }
}

/// Text of the times of wake-up and computation.
fn times_in_words([wakeup, compute]: &[Times; 2]) -> String {
    let words = |times: &Times| {
        let [p50, p99, max] = [times.p50, times.p99, times.max].map(|ns| ns as f64 * 1e-3);
        format!("{p50:.1} / {p99:.1} / {max:.1} µs")
    };
    format!("p50 / p99 / largest: wake-up {}, computation {}", words(wakeup), words(compute))
}

/// `limits.scale` at the begin of the run, if it is less than 1.
fn scaled_limits(config: &Config) -> Option<Fact> {
    let scale = config.deployment.limits.scale;
    let text = format!("velocity, acceleration and jerk times {scale} (limits.scale)");
    (scale < 1.0).then_some(Fact { name: "Limits", text, is_bad: false })
}

/// Changes of the configuration, if there are any.
fn configurations(run: &Run) -> Option<Fact> {
    let later = run
        .parts()
        .skip(1)
        .map(|part| format!("at {:.3} s (cycle {}) {}", part.from_s, part.first_cycle, part.changes));
    let text = later.collect::<Vec<_>>().join(". Then ");
    (!text.is_empty()).then_some(Fact { name: "Reloads", text, is_bad: false })
}

/// Where the recording ends, and whether the run may have gone on.
fn end(history: &History, begin_s: f64) -> Fact {
    let (t, is_bad) = (history.length_s(), history.is_unfinished);
    let place =
        format!("at {t:.3} s ({}) in state {}", time_of_day(begin_s + t), history.last_state().name());
    let causes = "the daemon still records, was killed, or the disk was full";
    let text = match is_bad {
        true => format!("unfinished, the last cycle is {place}; what followed is unknown: {causes}"),
        false => format!("{place}; the file is complete"),
    };
    Fact { name: "End", text, is_bad }
}

fn lost(history: &History) -> Fact {
    let mut text = match history.lost {
        0 if history.is_unfinished => "none from the first to the last cycle in the file".into(),
        0 => "none: every cycle is in the recording".into(),
        lost => format!("{}: these cycles are not in the recording", thousands(lost)),
    };
    if history.is_unfinished {
        text += "; after it an unknown number";
    }
    Fact { name: "Records lost", text, is_bad: history.lost > 0 || history.is_unfinished }
}

/// Time of day of a Unix time \[s\].
fn time_of_day(unix_s: f64) -> String {
    let second = unix_s.rem_euclid(86_400.0) as u64;
    format!("{:02}:{:02}:{:02} UTC", second / 3600, second / 60 % 60, second % 60)
}

/// Date and time of day of a Unix time \[s\], in the Gregorian calendar. Years begin in March, so that a leap day is their last.
pub fn date_and_time(unix_s: f64) -> String {
    let day = (unix_s / 86_400.0) as u64 + 719_468;
    let (cycle, of_cycle) = (day / 146_097, day % 146_097);
    let year = (of_cycle - of_cycle / 1460 + of_cycle / 36_524 - of_cycle / 146_096) / 365;
    let of_year = of_cycle - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let date = of_year - (153 * month + 2) / 5 + 1;
    let (year, month) = (400 * cycle + year + month / 10, (month + 2) % 12 + 1);
    format!("{year}-{month:02}-{date:02} {}", time_of_day(unix_s))
}

/// Text of a duration, in suitable units.
pub fn duration(seconds: f64) -> String {
    // Rounds to a tenth beyond a minute, so that no 60.0 s remain.
    let seconds = if seconds < 59.95 { seconds } else { (10.0 * seconds).round() / 10.0 };
    let whole = seconds as u64;
    let (hours, minutes) = (whole / 3600, whole / 60 % 60);
    let rest = seconds - (whole - whole % 60) as f64;
    match (hours, minutes) {
        (0, 0) => format!("{seconds:.3} s"),
        (0, _) => format!("{minutes} min {rest:.1} s"),
        _ => format!("{hours} h {minutes} min {rest:.0} s"),
    }
}

/// Separates groups of three digits by narrow spaces.
fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// Quantity with three digits and the prefix of its unit.
fn scaled(value: f64, unit: &str) -> String {
    let label = format!("[{unit}]");
    let exponent = displayed_exponent(&label, value);
    let number = value / 10f64.powi(exponent);
    let digits = if number >= 100.0 {
        0
    } else if number >= 10.0 {
        1
    } else {
        2
    };
    format!("{number:.digits$} {}", prefixed(&label, exponent).trim_matches(['[', ']']))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_people_read_them() {
        assert_eq!([1.5, 61.24, 3599.97].map(duration), ["1.500 s", "1 min 1.2 s", "1 h 0 min 0 s"]);
        let dates = [0.0, 951_827_696.0, 4_107_542_399.9, 1_796_002_330.0].map(date_and_time);
        let expected = [
            "1970-01-01 00:00:00 UTC",
            "2000-02-29 12:34:56 UTC",
            "2100-02-28 23:59:59 UTC",
            "2026-11-30 01:32:10 UTC",
        ];
        assert_eq!(dates, expected);
        assert_eq!([7, 1234, 3_600_000].map(thousands), ["7", "1\u{202f}234", "3\u{202f}600\u{202f}000"]);
        assert_eq!([1.4e-7, 2.5e-3, 0.0].map(|value| scaled(value, "m")), ["140 nm", "2.50 mm", "0.00 m"]);
    }
}
