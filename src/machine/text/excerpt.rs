//! Excerpts of a file for error texts.

/// Characters shown; enough to find the place.
const MAX_SHOWN: usize = 60;

/// An excerpt on one line, with control characters escaped, cut where it is long.
pub fn excerpt(text: &str) -> String {
    excerpt_of_length(text, MAX_SHOWN)
}

/// The same, cut after so many characters as they are shown.
pub fn excerpt_of_length(text: &str, max_shown: usize) -> String {
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let (mut shown, mut count) = (String::new(), 0);
    for c in words.chars() {
        let letters = if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
        count += letters.chars().count();
        if count > max_shown {
            return shown + "...";
        }
        shown += &letters;
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_excerpt_is_one_line_without_control_characters() {
        assert_eq!(excerpt(" [1,\n\t2]\r\n"), "[1, 2]");
        assert_eq!(excerpt("\u{1b}[2J\0\u{9b}"), "\\u{1b}[2J\\u{0}\\u{9b}");
        assert_eq!(excerpt(&"ä".repeat(60)), "ä".repeat(60));
        assert_eq!(excerpt(&"\0".repeat(60)), "\\u{0}".repeat(12) + "...");
        assert_eq!(excerpt(&"ä".repeat(1_000_000)), "ä".repeat(60) + "...");
    }
}
