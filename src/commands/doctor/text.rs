//! The diagnosis as text for a terminal.

use core::fmt::Write as _;

use console::{Color, Term, colors_enabled, measure_text_width, style};

use super::facts::{Fact, Rating, surroundings};
use super::latency::{Latency, Waiting};
use super::verdict::Judgement;
use super::{Diagnosis, Rate};
use crate::config::deployment::Realtime;
use crate::realtime::cyclic::ReleaseMode;

/// Longer lines are hard to read, even where the terminal has room.
const WIDEST: usize = 100;
/// Below, every word would be a line.
const NARROWEST: usize = 60;
/// Where there is no terminal.
const USUAL: usize = 80;

/// Columns of the facts: rating and name.
const RATING: usize = 9;
const NAME: usize = 17;

/// A shorter measurement says nothing about what is rare \[s\].
const LONG_S: f64 = 3600.0;

/// How to write.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    width: usize,
    colours: bool,
}

impl Layout {
    /// As standard output likes it.
    pub fn of_stdout() -> Self {
        let width = Term::stdout().size_checked().map_or(USUAL, |(_, width)| usize::from(width));
        Self { width: width.clamp(NARROWEST, WIDEST), colours: colors_enabled() }
    }

    /// What was looked at, and the facts.
    pub fn facts(&self, name: &str, realtime: &Realtime, facts: &[Fact]) -> String {
        let release = match realtime.release {
            ReleaseMode::External => "sleep (instead of external)",
            ReleaseMode::Lockstep => "sleep (instead of lockstep)",
            release => Waiting::from(release).name(),
        };
        let on = realtime.cpu.map_or_else(|| "any CPU".into(), |cpu| format!("CPU {cpu}"));
        let mut text = format!("{name}: {} Hz by {release}, on {on}\n\n", realtime.rate_hz);
        for Fact { name, rating, found, remedy } in facts {
            let (word, colour) = match rating {
                Rating::Good => ("good", Color::Green),
                Rating::Fair => ("fair", Color::Yellow),
                Rating::Bad => ("bad", Color::Red),
                Rating::Unknown => ("unknown", Color::Magenta),
            };
            let head = format!("{}{name:<NAME$}", self.paint(&format!("{word:<RATING$}"), colour));
            self.paragraph(&mut text, &head, found);
            if let Some(remedy) = remedy {
                self.paragraph(&mut text, &" ".repeat(RATING + NAME), &format!("-> {remedy}"));
            }
        }
        text
    }

    /// The measurement and the verdicts.
    pub fn rates(&self, diagnosis: &Diagnosis) -> String {
        let Diagnosis { rate_hz, release, rates, seconds, verdict, .. } = diagnosis;
        let mut text = String::from("\n");
        let what = "wake-up after the release [us]; late: by more than late_wakeup_us, or half a period";
        self.paragraph(&mut text, "", what);
        text += "    Hz by     ";
        text += &self.times(["min", "p50", "p99", "p99.9", "p99.99"].map(String::from));
        text += "    max  late missed verdict\n";
        for Rate { latency, verdict, .. } in rates {
            text += &self.row(latency, *verdict);
        }
        text += "\n";
        for rate in rates {
            let Latency { rate_hz, release, .. } = &rate.latency;
            let head = format!("{rate_hz:>6} {:<7}", release.name());
            self.paragraph(&mut text, &head, &reasons(rate));
        }
        text += "\n";
        for note in notes(diagnosis) {
            self.paragraph(&mut text, "", &note);
        }
        let (word, colour) = words(*verdict);
        let asked = format!("{rate_hz} Hz by {}, in {seconds} s: ", release.name());
        text + &format!("\n{asked}{}\n", self.paint(word, colour))
    }

    fn row(&self, latency: &Latency, verdict: Judgement) -> String {
        let Latency { rate_hz, release, wakeup_ns, late_wakeups, missed, .. } = latency;
        // Of fewer, the longest stands for all of them.
        let quantile = |time_ns: u64, least: u64| {
            if wakeup_ns.count < least { "-".into() } else { microseconds(time_ns) }
        };
        let times = [
            microseconds(wakeup_ns.min),
            microseconds(wakeup_ns.p50),
            quantile(wakeup_ns.p99, 100),
            quantile(wakeup_ns.p999, 1_000),
            quantile(wakeup_ns.p9999, 10_000),
        ];
        let (word, colour) = words(verdict);
        format!(
            "{rate_hz:>6} {:<7}{}{:>7} {late_wakeups:>5} {missed:>6} {}\n",
            release.name(),
            self.times(times),
            microseconds(wakeup_ns.max),
            self.paint(word, colour),
        )
    }

    /// Shortest time and quantiles; where there is no room, those between 50 % and 99.9 %.
    fn times(&self, times: [String; 5]) -> String {
        let [min, p50, p99, p999, p9999] = times.map(|time| format!("{time:>6} "));
        if self.width < USUAL { p50 + &p99 + &p999 } else { min + &p50 + &p99 + &p999 + &p9999 }
    }

    fn paint(&self, word: &str, colour: Color) -> String {
        style(word).fg(colour).force_styling(self.colours).to_string()
    }

    /// Words beside a head, wrapped.
    fn paragraph(&self, text: &mut String, head: &str, words: &str) {
        let indent = measure_text_width(head);
        text.push_str(head);
        let mut column = indent;
        for word in words.split(' ') {
            let width = measure_text_width(word);
            if column > indent && column + 1 + width > self.width {
                // A String takes all.
                let _ = write!(text, "\n{:indent$}", "");
                column = indent;
            } else if column > indent {
                text.push(' ');
                column += 1;
            }
            text.push_str(word);
            column += width;
        }
        text.push('\n');
    }
}

fn words(verdict: Judgement) -> (&'static str, Color) {
    match verdict {
        Judgement::Good => ("good", Color::Green),
        Judgement::Marginal => ("marginal", Color::Yellow),
        Judgement::Impossible => ("impossible", Color::Red),
    }
}

/// At least two digits.
pub fn microseconds(time_ns: u64) -> String {
    let time_us = time_ns as f64 / 1e3;
    let decimals = if time_us < 0.995 { 2 } else { usize::from(time_us < 9.95) };
    format!("{time_us:.decimals$}")
}

fn reasons(rate: &Rate) -> String {
    let latency = &rate.latency;
    let mut why = rate.why.join("; ");
    if latency.lead_ns > 0 {
        let lead_us = microseconds(latency.lead_ns);
        let share = 100.0 * latency.lead_ns as f64 / latency.period_ns();
        why += &format!("; spins {lead_us} us before a release, {share:.0}% of a processor");
    }
    why
}

/// What the numbers do not say.
fn notes(diagnosis: &Diagnosis) -> Vec<String> {
    let Diagnosis { seconds, rates, facts, .. } = diagnosis;
    let mut notes = Vec::new();
    let stolen_ms: Option<u64> = rates.iter().map(|rate| rate.latency.stolen_ms).sum();
    if let Some(stolen_ms) = stolen_ms.filter(|_| facts.contains(&surroundings::virtual_machine())) {
        notes.push(format!(
            "The longest wake-ups may be pauses by the host of this virtual machine. It says that it took \
             {stolen_ms} ms of processor time meanwhile; it may take more at any time."
        ));
    }
    if *seconds < LONG_S {
        notes.push(
            "What happens once an hour is not in so short a measurement. Before a machine moves, measure for \
             hours, under the load that it will run with."
                .into(),
        );
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::demo::DEFAULT_MACHINE;
    use crate::config::Config;
    use crate::messages::Times;
    use crate::realtime::usage::ThreadUsage;

    const RARE: u64 = 123_456_789;

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
            release: Waiting::Hybrid,
            wakeup_ns: times,
            late_wakeup_ns: 25_000,
            late_wakeups: 12_345,
            missed: 23_456,
            lead_ns: 20_000,
            stolen_ms: Some(40),
            thread: ThreadUsage::default(),
        };
        let verdict = Judgement::Impossible;
        Diagnosis {
            name: "test".into(),
            rate_hz: 20_000.0,
            release: Waiting::Hybrid,
            cpu: None,
            seconds,
            facts: if virtual_machine { vec![surroundings::virtual_machine()] } else { vec![] },
            rates: vec![Rate { latency, verdict, why: vec!["it is late".into()] }],
            verdict,
        }
    }

    #[test]
    fn lines_fit_the_terminal_and_lose_no_word() {
        let realtime = Config::parse(DEFAULT_MACHINE, "test").unwrap().deployment.realtime;
        let facts = [Fact::fair("isolation", "one two three ".repeat(20).trim(), "four ".repeat(30).trim())];
        for width in [60, 80, 100] {
            let layout = Layout { width, colours: false };
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
        let text = Layout { width: 80, colours: false }.rates(&diagnosis(true, 100_000, 10.0));
        let row = "20000 hybrid   0.01    3.5     46 123457 123457  123457 12345  23456 impossible";
        assert!(text.contains(row), "{text}");
        assert!(text.contains("it is late; spins 20 us before a release, 40% of a processor"), "{text}");
        assert!(text.ends_with("20000 Hz by hybrid, in 10 s: impossible\n"), "{text}");
    }

    #[test]
    fn quantiles_of_too_few_wake_ups_are_not_shown() {
        for (count, row) in
            [(99, "3.5      -      -      -"), (999, "46      -      -"), (9_999, "46 123457      -")]
        {
            let text = Layout { width: 80, colours: false }.rates(&diagnosis(true, count, 10.0));
            assert!(text.contains(row), "{count}:\n{text}");
        }
    }

    #[test]
    fn it_says_what_it_cannot_know() {
        let text = |virtual_machine, seconds| {
            let text = Layout { width: 80, colours: false }.rates(&diagnosis(virtual_machine, 1, seconds));
            (text.contains("it took 40 ms"), text.contains("once an hour"))
        };
        assert_eq!(text(true, 10.0), (true, true));
        assert_eq!(text(false, 3600.0), (false, false));
    }

    #[test]
    fn colours_are_for_terminals() {
        for colours in [false, true] {
            let text = Layout { width: 80, colours }.rates(&diagnosis(true, 1, 10.0));
            assert_eq!(text.contains("\u{1b}[31mimpossible"), colours, "{text:?}");
        }
    }
}
