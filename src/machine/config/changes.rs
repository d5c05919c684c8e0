//! Difference of two machine files, key by key.

use core::fmt;
use core::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::bound::number;
use crate::text::excerpt::excerpt;

/// Sections that a running daemon can reload, and keys of `[actuator]`: how the platform is controlled, and what `hexad identify`
/// finds. All others need a restart: joints, stroke and force of the drives belong to the machine, `realtime` to the threads,
/// `operator` to the control socket, and the name to the topics.
const RELOADABLE: [&str; 11] = [
    "control",
    "cylinder",
    "drive",
    "envelope",
    "in_position",
    "limits",
    "measured",
    "platform",
    "rod",
    "setpoint",
    "timeouts",
];
const RELOADABLE_OF_ACTUATOR: [&str; 6] = [
    "actuator.coulomb_friction_n",
    "actuator.force_scale",
    "actuator.friction_uncertainty_n",
    "actuator.load_friction",
    "actuator.reflected_mass_kg",
    "actuator.viscous_friction_n_s_m",
];

/// Sections that the daemon does not read: commands read them from the file each time.
const FOREIGN: [&str; 2] = ["frame", "plant"];

/// A key whose value differs. Displays as `limits.velocity_m_s: 0.5 -> 0.4`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// Full name of the key; legs count from 1.
    pub key: String,
    /// Value as written; `None` if the file has none and the default is used.
    pub old: Option<String>,
    /// Value in the other file.
    pub new: Option<String>,
}

impl Change {
    /// Whether a running daemon can reload it.
    pub fn is_reloadable(&self) -> bool {
        RELOADABLE.contains(&self.section()) || RELOADABLE_OF_ACTUATOR.contains(&self.key.as_str())
    }

    fn section(&self) -> &str {
        self.key.split(['.', '[']).next().unwrap_or_default()
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |value: &Option<String>| value.clone().unwrap_or_else(|| "default".into());
        write!(f, "{}: {} -> {}", self.key, shown(&self.old), shown(&self.new))
    }
}

/// Keys that the daemon reads and whose values differ between two valid files. Order: as in the old file,
/// then the keys that only the new file has. Spelling (`1`, `1.0`, spaces, comments) makes no difference.
pub fn changes(old: &str, new: &str) -> Vec<Change> {
    let [old, new] = [old, new].map(Leaf::all);
    let value_in = |leaves: &[Leaf], key: &str| leaves.iter().find(|leaf| leaf.key == key).cloned();
    let of_old = old.iter().map(|leaf| (&leaf.key, Some(leaf.clone()), value_in(&new, &leaf.key)));
    let only_new = new.iter().filter(|leaf| value_in(&old, &leaf.key).is_none());
    let only_new = only_new.map(|leaf| (&leaf.key, None, Some(leaf.clone())));
    let differs = |(_, old, new): &(_, Option<Leaf>, Option<Leaf>)| {
        old.as_ref().map(|leaf| &leaf.meaning) != new.as_ref().map(|leaf| &leaf.meaning)
    };
    let shown = |leaf: Option<Leaf>| leaf.map(|leaf| leaf.shown);
    let found = of_old.chain(only_new).filter(differs);
    let found = found.map(|(key, old, new)| Change { key: key.clone(), old: shown(old), new: shown(new) });
    found.filter(|change| !FOREIGN.contains(&change.section())).collect()
}

/// A key without keys below it.
#[derive(Clone)]
struct Leaf {
    key: String,
    /// Value as written.
    shown: String,
    /// Value in a form that does not depend on spelling.
    meaning: String,
}

impl Leaf {
    fn all(text: &str) -> Vec<Self> {
        let mut leaves = vec![];
        let (table, _) = DeTable::parse_recoverable(text);
        add_table(&mut leaves, text, "", table.get_ref());
        leaves
    }
}

fn add_table(leaves: &mut Vec<Leaf>, text: &str, path: &str, table: &DeTable) {
    let mut entries: Vec<_> = table.iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    for (key, value) in entries {
        let key =
            if path.is_empty() { key.get_ref().to_string() } else { format!("{path}.{}", key.get_ref()) };
        add(leaves, text, key, value);
    }
}

fn add(leaves: &mut Vec<Leaf>, text: &str, key: String, value: &Spanned<DeValue>) {
    let is_table = |value: &Spanned<DeValue>| value.get_ref().is_table();
    match value.get_ref() {
        DeValue::Table(table) => add_table(leaves, text, &key, table),
        DeValue::Array(items) if items.iter().any(is_table) => {
            for (k, item) in items.iter().enumerate() {
                add(leaves, text, format!("{key}[{}]", k + 1), item);
            }
        }
        other => leaves.push(Leaf { key, shown: written(text, value.span()), meaning: meaning(other) }),
    }
}

fn written(text: &str, span: Range<usize>) -> String {
    text.get(span).map(excerpt).unwrap_or_default()
}

fn meaning(value: &DeValue) -> String {
    match value {
        DeValue::Array(items) => {
            let items: Vec<_> = items.iter().map(|item| meaning(item.get_ref())).collect();
            format!("[{}]", items.join(", "))
        }
        DeValue::String(text) => format!("{text:?}"),
        other => number(other).map_or_else(|| format!("{other:?}"), |number| number.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(old: &str, new: &str) -> Vec<String> {
        changes(old, new).iter().map(Change::to_string).collect()
    }

    #[test]
    fn changes_are_named_with_both_values_and_spelling_is_none() {
        let old = "name = 'a'\n[limits]\nvelocity_m_s = 1\nx = [1, 2.0]\n[control]\nmode = 'a'\n[[leg]]\nbase_m = [1,2,3]\n[[leg]]\n";
        let new = "# other\nname = \"a\"\n[limits]\nvelocity_m_s = 1.0 # same\nx = [1.0,2]\n[control]\nmode = \"a\"\n[[leg]]\nbase_m = [1, 2, 3]\n[[leg]]\n";
        assert_eq!(shown(old, new), [""; 0]);
        let new = "name = 'b'\n[limits]\nvelocity_m_s = 2\nx = [1, 3]\n[[leg]]\nbase_m = [1,2,4]\n[[leg]]\nc = {d = 1}\n[plant]\nrate_hz = 1\n";
        assert_eq!(
            shown(old, new),
            [
                "name: 'a' -> 'b'",
                "limits.velocity_m_s: 1 -> 2",
                "limits.x: [1, 2.0] -> [1, 3]",
                "control.mode: 'a' -> default",
                "leg[1].base_m: [1,2,3] -> [1,2,4]",
                "leg[2].c.d: default -> 1",
            ]
        );
        let reloadable: Vec<_> = changes(old, new).iter().map(Change::is_reloadable).collect();
        assert_eq!(reloadable, [false, true, true, true, false, false]);
        let [old, new] = ["[platform]\nmass_kg = 1\n[actuator]\nload_friction = 0\nmax_force_n = 5\n", ""];
        let reloadable: Vec<_> = changes(old, new).iter().map(Change::is_reloadable).collect();
        assert_eq!(reloadable, [true, true, false]);
    }
}
