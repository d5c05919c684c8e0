//! Differences between two machine files, for a terminal.

use similar::{ChangeTag, TextDiff};

use crate::commands::check::CheckReport;
use hexad_machine::config::Config;

/// The lines that differ, each with its number: `-` for lines of the old text, `+` for lines of the new text.
pub fn difference(old: &str, new: &str) -> String {
    let [old, new] = [old, new].map(|text| text.lines().collect::<Vec<_>>());
    let compared = TextDiff::from_slices(&old, &new);
    let lines = compared.iter_all_changes().filter_map(|change| {
        let (sign, index) = match change.tag() {
            ChangeTag::Delete => ('-', change.old_index()?),
            ChangeTag::Insert => ('+', change.new_index()?),
            ChangeTag::Equal => return None,
        };
        Some(format!("{sign} {:>4}  {}\n", index + 1, change.value()))
    });
    lines.collect()
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
