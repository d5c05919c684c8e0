//! Text of the diagnosis for a terminal.

use console::{Color, colors_enabled, style};

use super::Diagnosis;
use super::facts::{Assessment, Fact, surroundings};
use super::latency::{Latency, measured_mode};
use super::verdict::{Feasibility, RateVerdict};
use hexad_machine::config::deployment::Realtime;
use hexad_machine::text::text_table::{DEFAULT_WIDTH, Left, Right, paragraph, stdout_width, text_table};

/// Widths of the columns of the facts: assessment and name.
const ASSESSMENT_WIDTH: usize = 9;
const NAME_WIDTH: usize = 17;

/// Duration below which a note says that the measurement shows no rare event \[s\].
const LONG_MEASUREMENT_S: f64 = 3600.0;

/// Width and colours of the text.
#[derive(Clone, Copy, Debug)]
pub struct TextStyle {
    width: usize,
    has_colours: bool,
}

impl TextStyle {
    /// Style for standard output.
    pub fn of_stdout() -> Self {
        Self { width: stdout_width(), has_colours: colors_enabled() }
    }

    /// The examined rate and CPU, and the facts.
    pub fn facts(&self, name: &str, realtime: &Realtime, facts: &[Fact]) -> String {
        let (configured, measured) = (realtime.release, measured_mode(realtime.release));
        let instead = if configured == measured {
            String::new()
        } else {
            format!(" (instead of {})", configured.name())
        };
        let cpu = realtime.cpu.map_or_else(|| "any CPU".into(), |cpu| format!("CPU {cpu}"));
        let mut text =
            format!("{name}: {} Hz by {}{instead}, on {cpu}\n\n", realtime.rate_hz, measured.name());
        for Fact { name, assessment, found, remedy } in facts {
            let (word, colour) = match assessment {
                Assessment::Good => ("good", Color::Green),
                Assessment::Fair => ("fair", Color::Yellow),
                Assessment::Bad => ("bad", Color::Red),
                Assessment::Unknown => ("unknown", Color::Magenta),
            };
            let word = self.paint(&format!("{word:<ASSESSMENT_WIDTH$}"), colour);
            text += &paragraph(&format!("{word}{name:<NAME_WIDTH$}"), found, self.width);
            if let Some(remedy) = remedy {
                let indent = " ".repeat(ASSESSMENT_WIDTH + NAME_WIDTH);
                text += &paragraph(&indent, &format!("-> {remedy}"), self.width);
            }
        }
        text
    }

    /// The measured latencies and the verdicts; empty if nothing was measured.
    pub fn rates(&self, diagnosis: &Diagnosis) -> String {
        let Diagnosis { rate_hz, release, rates, seconds, verdict, .. } = diagnosis;
        let Some(verdict) = verdict else { return String::new() };
        let what = "wake-up after the release [us]; late: by more than late_wakeup_us, or half a period";
        let mut text = String::from("\n") + &paragraph("", what, self.width) + &self.table(rates) + "\n";
        for rate in rates {
            let Latency { rate_hz, release, .. } = &rate.latency;
            let head = format!("{rate_hz:>6} {:<7}", release.name());
            text += &paragraph(&head, &reasons(rate), self.width);
        }
        text += "\n";
        for note in notes(diagnosis) {
            text += &paragraph("", &note, self.width);
        }
        let (word, colour) = words(*verdict);
        let verdict = self.paint(word, colour);
        text + &format!("\n{rate_hz} Hz by {}, in {seconds} s: {verdict}\n", release.name())
    }

    /// A row per rate and release mode. A narrow table omits the less important quantiles.
    fn table(&self, rates: &[RateVerdict]) -> String {
        let header = ["Hz", "by", "min", "p50", "p99", "p99.9", "p99.99", "max", "late", "missed", "verdict"];
        let columns = header.map(|name| (name, if ["by", "verdict"].contains(&name) { Left } else { Right }));
        let is_shown =
            |column: &&(&str, _)| self.width >= DEFAULT_WIDTH || !["min", "p99.99"].contains(&column.0);
        let shown: Vec<_> = columns.iter().filter(is_shown).copied().collect();
        let rows = rates.iter().map(|rate| {
            let cells = columns.iter().zip(cells(rate));
            cells.filter(|(column, _)| is_shown(column)).map(|(_, cell)| cell)
        });
        let table = text_table(1, &shown, rows);
        let mut lines = table.lines();
        let mut text = format!("{}\n", lines.next().unwrap_or_default());
        for (line, rate) in lines.zip(rates) {
            let (word, colour) = words(rate.verdict);
            text += &format!("{}{}\n", line.strip_suffix(word).unwrap_or(line), self.paint(word, colour));
        }
        text
    }

    fn paint(&self, word: &str, colour: Color) -> String {
        style(word).fg(colour).force_styling(self.has_colours).to_string()
    }
}

/// Cells of a row, in the order of the header.
fn cells(rate: &RateVerdict) -> [String; 11] {
    let Latency { rate_hz, release, wakeup_ns, late_wakeups, missed, .. } = &rate.latency;
    // With too few wake-ups a quantile would only be their maximum.
    let quantile = |time_ns: u64, min_count: u64| {
        if wakeup_ns.count < min_count { "-".into() } else { microseconds(time_ns) }
    };
    [
        rate_hz.to_string(),
        release.name().into(),
        microseconds(wakeup_ns.min),
        microseconds(wakeup_ns.p50),
        quantile(wakeup_ns.p99, 100),
        quantile(wakeup_ns.p999, 1_000),
        quantile(wakeup_ns.p9999, 10_000),
        microseconds(wakeup_ns.max),
        late_wakeups.to_string(),
        missed.to_string(),
        words(rate.verdict).0.into(),
    ]
}

fn words(verdict: Feasibility) -> (&'static str, Color) {
    match verdict {
        Feasibility::Good => ("good", Color::Green),
        Feasibility::Marginal => ("marginal", Color::Yellow),
        Feasibility::Impossible => ("impossible", Color::Red),
    }
}

/// A time in microseconds, with at least two digits.
pub fn microseconds(time_ns: u64) -> String {
    let time_us = time_ns as f64 / 1e3;
    let decimals = if time_us < 0.995 { 2 } else { usize::from(time_us < 9.95) };
    format!("{time_us:.decimals$}")
}

fn reasons(rate: &RateVerdict) -> String {
    let latency = &rate.latency;
    let mut reasons = rate.reasons.join("; ");
    if latency.lead_ns > 0 {
        let lead_us = microseconds(latency.lead_ns);
        let share = 100.0 * latency.lead_ns as f64 / latency.period_ns();
        reasons += &format!("; spins {lead_us} us before a release, {share:.0}% of a processor");
    }
    reasons
}

/// Limits of the measurement, which its numbers do not show.
fn notes(diagnosis: &Diagnosis) -> Vec<String> {
    let Diagnosis { seconds, rates, facts, .. } = diagnosis;
    let mut notes = Vec::new();
    let stolen_ms: Option<u64> = rates.iter().map(|rate| rate.latency.stolen_ms).sum();
    let is_virtual = facts.iter().any(|fact| fact.found == surroundings::virtual_machine().found);
    if let Some(stolen_ms) = stolen_ms.filter(|_| is_virtual) {
        notes.push(format!(
            "The longest wake-ups may be pauses by the host of this virtual machine. The host reports that it took \
             {stolen_ms} ms of processor time meanwhile; it may take more at any time."
        ));
    }
    if *seconds < LONG_MEASUREMENT_S {
        notes.push(
            "A measurement this short does not show events that occur once an hour. Before a machine moves, measure \
             for hours, under the load that it will run with."
                .into(),
        );
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use hexad_client::messages::Times;
    use hexad_client::realtime::cyclic::ReleaseMode;
    use hexad_client::realtime::usage::ThreadUsage;
    use hexad_machine::config::Config;

    const RARE: u64 = 123_456_789;

    const PLAIN: TextStyle = TextStyle { width: 80, has_colours: false };

    /// Joins the words with single blanks.
    fn single_spaced(text: &str) -> String {
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    fn diagnosis(virtual_machine: bool, count: u64, seconds: f64) -> Diagnosis {
        let times = Times {
            count,
            min: 12,
            p50: 3_456,
            p99: 45_678,
            p999: RARE,
            p9999: RARE,
            max: RARE,
            mean: 0,
            p90: 0,
        };
        let latency = Latency {
            rate_hz: 20_000.0,
            release: ReleaseMode::Hybrid,
            wakeup_ns: times,
            late_wakeup_ns: 25_000,
            late_wakeups: 12_345,
            missed: 23_456,
            lead_ns: 20_000,
            stolen_ms: Some(40),
            thread: ThreadUsage::default(),
        };
        let verdict = Feasibility::Impossible;
        Diagnosis {
            schema: 1,
            name: "test".into(),
            rate_hz: 20_000.0,
            release: ReleaseMode::Hybrid,
            cpu: None,
            seconds,
            facts: if virtual_machine { vec![surroundings::virtual_machine()] } else { vec![] },
            rates: vec![RateVerdict { latency, verdict, reasons: vec!["it is late".into()] }],
            verdict: Some(verdict),
        }
    }

    #[test]
    fn lines_fit_the_terminal_and_lose_no_word() {
        let realtime = Config::parse(DEFAULT_CONFIG, "test").unwrap().deployment.realtime;
        let fact = Fact::fair("one two three ".repeat(20).trim(), "four ".repeat(30).trim());
        let facts = [Fact { name: "isolation".into(), ..fact }];
        for width in [60, 80, 100] {
            let layout = TextStyle { width, has_colours: false };
            let text = layout.facts("test", &realtime, &facts);
            let words = |word: &str| text.split_whitespace().filter(|found| *found == word).count();
            assert_eq!((words("one"), words("three"), words("four")), (20, 20, 30), "{text}");
            let rates = layout.rates(&diagnosis(true, 100_000, 10.0));
            let widest = text.lines().chain(rates.lines()).map(|line| line.chars().count()).max();
            assert!(widest <= Some(width.max(67)), "{widest:?}\n{text}{rates}");
        }
    }

    #[test]
    fn numbers_and_reasons_are_there() {
        let text = PLAIN.rates(&diagnosis(true, 100_000, 10.0));
        let row = "20000 hybrid 0.01 3.5 46 123457 123457 123457 12345 23456 impossible";
        assert!(text.lines().any(|line| single_spaced(line) == row), "{text}");
        assert!(text.contains("it is late; spins 20 us before a release, 40% of a processor"), "{text}");
        assert!(text.ends_with("20000 Hz by hybrid, in 10 s: impossible\n"), "{text}");
    }

    #[test]
    fn quantiles_of_too_few_wake_ups_are_not_shown() {
        for (count, row) in [(99, "3.5 - - - 123457"), (999, "46 - - 123457"), (9_999, "46 123457 - 123457")]
        {
            let text = PLAIN.rates(&diagnosis(true, count, 10.0));
            assert!(single_spaced(&text).contains(row), "{count}:\n{text}");
        }
    }

    #[test]
    fn the_limits_of_the_measurement_are_noted() {
        let text = |virtual_machine, seconds| {
            let text = PLAIN.rates(&diagnosis(virtual_machine, 1, seconds));
            (text.contains("it took 40 ms"), text.contains("once an hour"))
        };
        assert_eq!(text(true, 10.0), (true, true));
        assert_eq!(text(false, 3600.0), (false, false));
    }

    #[test]
    fn colours_are_for_terminals() {
        for colours in [false, true] {
            let text = TextStyle { width: 80, has_colours: colours }.rates(&diagnosis(true, 1, 10.0));
            assert_eq!(text.contains("\u{1b}[31mimpossible"), colours, "{text:?}");
        }
    }
}
