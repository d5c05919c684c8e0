//! Comment behind a new value: `# was 0.4, +- 0.012`, `# new, +- 0.012`, or `# xx was 0.4, +- 0.012; xy new` behind an
//! inline table.

/// Changes of the values in one line.
#[derive(Default)]
pub struct ChangeComment {
    changes: Vec<Change>,
}

/// Change of a value.
struct Change {
    /// Key within an inline table; empty for a value that is none.
    key: String,
    /// `was 0.4, +- 0.012` or `new, +- 0.012`.
    text: String,
}

impl ChangeComment {
    /// Adds a change: the old value, `None` for a new key, and the standard deviation of the new value.
    pub fn add(&mut self, key: &str, old: Option<String>, deviation: Option<String>) {
        let change = old.map_or_else(|| "new".into(), |old| format!("was {old}"));
        let text = change + &deviation.map_or_else(String::new, |deviation| format!(", +- {deviation}"));
        self.changes.push(Change { key: key.into(), text });
    }

    /// The rest of a line, with this comment in place of that of an earlier identification. An earlier change of a
    /// value that is not changed again stays.
    pub fn after(&self, rest: &str) -> String {
        let (own, earlier) = split(rest);
        let is_kept = |change: &&Change| self.changes.iter().all(|new| new.key != change.key);
        let changes = earlier.iter().filter(is_kept).chain(&self.changes).map(Change::written);
        format!("{} # {}", own.trim_end(), changes.collect::<Vec<_>>().join("; "))
    }
}

impl Change {
    fn written(&self) -> String {
        if self.key.is_empty() { self.text.clone() } else { format!("{} {}", self.key, self.text) }
    }

    fn parse(written: &str) -> Option<Self> {
        let is_numbers = |text: &str| {
            text.contains(|c: char| c.is_ascii_digit())
                && text.chars().all(|c| c.is_ascii_digit() || "+-.eE_[], ".contains(c))
        };
        let is_change = |text: &str| {
            let (old, deviation) = text.split_once(", +- ").unwrap_or((text, "0"));
            is_numbers(deviation) && (old == "new" || old.strip_prefix("was ").is_some_and(is_numbers))
        };
        let (key, text) = match written.split_once(' ') {
            Some((key, text)) if is_change(text) => (key, text),
            _ => ("", written),
        };
        is_change(text).then(|| Self { key: key.into(), text: text.into() })
    }
}

/// The rest of a line without the comment of an earlier identification, and the changes in that comment.
fn split(rest: &str) -> (&str, Vec<Change>) {
    let comment = |(start, _)| {
        let (own, comment) = rest.split_at_checked(start)?;
        let changes: Option<Vec<_>> =
            comment.strip_prefix('#')?.trim().split("; ").map(Change::parse).collect();
        Some((own, changes?))
    };
    rest.match_indices('#').find_map(comment).unwrap_or((rest, Vec::new()))
}
