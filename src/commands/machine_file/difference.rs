//! Differences between two machine files, for a terminal.

use crate::commands::check::CheckReport;
use hexad_machine::config::Config;

/// The lines that differ, each with its number: `-` for lines of the old text, `+` for lines of the new text.
pub fn difference(old: &str, new: &str) -> String {
    let [old, new] = [old, new].map(|text| text.lines().collect::<Vec<_>>());
    let (mut shown, mut i, mut j) = (String::new(), 0, 0);
    while i < old.len() || j < new.len() {
        let (removed, added) = lines_to_next_match(&old, &new, i, j);
        for (sign, lines, first, count) in [('-', &old, i, removed), ('+', &new, j, added)] {
            for (index, line) in lines.iter().enumerate().skip(first).take(count) {
                shown += &format!("{sign} {:>4}  {line}\n", index + 1);
            }
        }
        (i, j) = (i + removed + 1, j + added + 1);
    }
    shown
}

/// Fewest lines to skip in both texts, from `i` and `j` on, until a line of both or both ends match.
fn lines_to_next_match(old: &[&str], new: &[&str], i: usize, j: usize) -> (usize, usize) {
    let rest = (old.len().saturating_sub(i), new.len().saturating_sub(j));
    let splits = |sum: usize| (sum.saturating_sub(rest.1)..=sum.min(rest.0)).map(move |a| (a, sum - a));
    let is_match = |(a, b): &(usize, usize)| old.get(i + a) == new.get(j + b);
    (0..=rest.0 + rest.1).flat_map(splits).find(is_match).unwrap_or(rest)
}

/// The lines of `hexad check` that differ between two machine files, each as the old line, `->` and the new line below.
/// They include the errors that `hexad check` would end with.
pub fn changed_margins(old: &Config, new: &Config) -> Vec<String> {
    let [old, new] = [old, new].map(|config| {
        let report = CheckReport::new(config, &config.examine());
        let errors = report.errors.iter().map(|error| format!("ERROR: {error}\n"));
        labelled(&(report.to_string() + &errors.collect::<String>()))
    });
    let find = |lines: &[Labelled], label: &Label| {
        let line = lines.iter().find(|(other, _)| other == label);
        line.map_or_else(|| "(none)".into(), |(_, line)| line.clone())
    };
    let only_new = new.iter().filter(|(label, _)| old.iter().all(|(other, _)| other != label));
    old.iter()
        .chain(only_new)
        .map(|(label, _)| (find(&old, label), find(&new, label)))
        .filter(|(old, new)| old != new)
        .map(|(old, new)| format!("   {old}\n-> {new}"))
        .collect()
}

/// Text of a line before its first number or colon, and how many lines above begin alike.
type Label = (String, usize);
type Labelled = (Label, String);

fn labelled(report: &str) -> Vec<Labelled> {
    let label = |line: &str| {
        let text = line.trim_start_matches("WARNING: ").trim_start_matches("ERROR: ");
        text.split(|c: char| c.is_ascii_digit() || c == ':').next().unwrap_or_default().to_string()
    };
    let mut lines: Vec<Labelled> = Vec::new();
    for line in report.lines() {
        let label = label(line);
        let above = lines.iter().filter(|((other, _), _)| *other == label).count();
        lines.push(((label, above), line.trim_end().into()));
    }
    lines
}
