//! Changes of single values in a drives file; comments and everything else stay as they are.

/// The text with other values of keys of a leg, from 1; `None` removes a key. `None` if the file has no such leg.
pub fn with_values(text: &str, leg: usize, values: &[(&str, Option<String>)]) -> Option<String> {
    let start = text.match_indices("[[leg]]").nth(leg.checked_sub(1)?)?.0;
    let end = text.get(start + 7..)?.find("[[leg]]").map_or(text.len(), |next| start + 7 + next);
    let (before, section, after) = (text.get(..start)?, text.get(start..end)?, text.get(end..)?);
    let is_replaced = |line: &str| {
        let key = line.split('=').next().unwrap_or_default().trim();
        values.iter().any(|(replaced, _)| key == *replaced)
    };
    let mut lines = section.lines().filter(|line| !is_replaced(line));
    let first = lines.next()?;
    let set = values.iter().filter_map(|(key, value)| Some(format!("{key} = {}\n", value.as_ref()?)));
    let (set, rest): (String, String) = (set.collect(), lines.map(|line| format!("{line}\n")).collect());
    Some(format!("{before}{first}\n{set}{rest}{after}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_values_of_the_leg_change() {
        let text = "a = 1\n[[leg]]\nserial = 1\n[[leg]] # second\nx = 2\ny = 0.5 # old\nz = 1\n\n[[leg]]\nserial = 3\n";
        let values = [("serial", Some("22".to_string())), ("y", Some("1.25".to_string())), ("z", None)];
        let expected = "a = 1\n[[leg]]\nserial = 1\n[[leg]] # second\nserial = 22\ny = 1.25\nx = 2\n\n[[leg]]\nserial = 3\n";
        assert_eq!(with_values(text, 2, &values).unwrap(), expected);
        assert!(with_values(text, 4, &values).is_none() && with_values(text, 0, &values).is_none());
    }
}
