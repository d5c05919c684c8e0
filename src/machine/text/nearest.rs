//! Nearest of several names, for a name with a mistake in writing.

/// The name that differs least from a written one, if it differs in at most a third of the characters.
pub fn nearest<'n>(written: &str, names: &[&'n str]) -> Option<&'n str> {
    let most = (written.chars().count() / 3).max(1);
    let distances = names.iter().map(|name| (distance(written, name), *name));
    distances.filter(|(distance, _)| *distance <= most).min().map(|(_, name)| name)
}

/// Levenshtein distance: least number of characters that must be inserted, deleted or replaced.
fn distance(written: &str, name: &str) -> usize {
    let mut row: Vec<usize> = (0..=name.chars().count()).collect();
    for (k, a) in written.chars().enumerate() {
        let mut left = k + 1;
        let mut next = vec![left];
        for (pair, b) in row.windows(2).zip(name.chars()) {
            let [diagonal, above] = *pair else { continue };
            left = (left + 1).min(above + 1).min(diagonal + usize::from(a != b));
            next.push(left);
        }
        row = next;
    }
    row.last().copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_the_one_with_the_fewest_changes() {
        for (a, b, changes) in
            [("", "", 0), ("", "ab", 2), ("ab", "", 2), ("kitten", "sitting", 3), ("leg", "legs", 1)]
        {
            assert_eq!(distance(a, b), changes, "{a} {b}");
        }
        let names = ["actuator", "realtime", "rod"];
        for (written, found) in [
            ("actuators", Some("actuator")),
            ("real_time", Some("realtime")),
            ("rode", Some("rod")),
            ("topics", None),
        ] {
            assert_eq!(nearest(written, &names), found, "{written}");
        }
    }
}
