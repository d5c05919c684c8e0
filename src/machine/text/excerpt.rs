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

/// Characters outside ASCII, and the characters of numbers and keys that they look like.
const LIKENESSES: [(&str, &str); 6] = [
    ("\u{2010}\u{2011}\u{2012}\u{2013}\u{2014}\u{2212}\u{fe63}\u{ff0d}", "'-'"),
    ("\u{2018}\u{2019}\u{2032}", "\"'\""),
    ("\u{201c}\u{201d}\u{201e}\u{2033}\u{ff02}", "'\"'"),
    ("\u{060c}\u{066b}\u{201a}\u{ff0c}", "','"),
    ("\u{2024}\u{ff0e}", "'.'"),
    ("\u{ff1d}", "'='"),
];

/// Signs of units, which stand beside numbers.
const UNIT_SIGNS: [char; 3] = ['°', 'µ', 'μ'];

/// Clause that names the first character that is not ASCII by its code point: many look like one that is, or like none. Empty if
/// there is none.
pub fn stranger(text: &str) -> String {
    let Some(c) = text.chars().find(|c| !c.is_ascii() && !UNIT_SIGNS.contains(c)) else {
        return String::new();
    };
    let known = LIKENESSES.into_iter().find(|(those, _)| those.contains(c)).map(|(_, likeness)| likeness);
    let likeness = match known {
        Some(likeness) => likeness,
        None if c.is_whitespace() => "' '",
        None if c.is_alphabetic() => "a letter of ASCII",
        None if c.is_numeric() => "a digit of ASCII",
        None => "no character at all",
    };
    format!("; it contains U+{:04X}, which may look like {likeness}", u32::from(c))
}

/// The same of a line of TOML with an error; what is in quotes or a comment may be any character.
pub fn non_ascii_clause_in_toml(line: &str) -> String {
    stranger(line.split(['"', '\'', '#']).next().unwrap_or_default())
}

/// An error of a text in TOML, with the characters that cause it and are not seen.
pub fn toml_error(text: &str, error: &toml::de::Error) -> String {
    let at = error.span().unwrap_or_default().start;
    let mut ends = 0..;
    let line = text.split_inclusive('\n').find(|line| {
        ends = ends.start + line.len()..;
        ends.start > at
    });
    format!("{}{}", error.to_string().trim_end(), non_ascii_clause_in_toml(line.unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_looks_like_another_character_is_named() {
        for (text, code) in [
            ("\u{2212}5", "U+2212"),
            ("1\u{a0}m", "U+00A0"),
            ("\u{ff11}", "U+FF11"),
            ("m\u{430}ss", "U+0430"),
        ] {
            assert!(stranger(text).contains(code), "{text}");
        }
        assert_eq!(["5 µm", "-3 arcsec", "0.1°"].map(stranger), ["", "", ""]);
        let text = "name = \"Prüf\"\nx =\u{a0}1\ny = 2\n";
        let error = toml_error(text, &toml::from_str::<toml::Table>(text).unwrap_err());
        assert!(error.ends_with("; it contains U+00A0, which may look like ' '"), "{error}");
    }

    #[test]
    fn an_excerpt_is_one_line_without_control_characters() {
        assert_eq!(excerpt(" [1,\n\t2]\r\n"), "[1, 2]");
        assert_eq!(excerpt("\u{1b}[2J\0\u{9b}"), "\\u{1b}[2J\\u{0}\\u{9b}");
        assert_eq!(excerpt(&"ä".repeat(60)), "ä".repeat(60));
        assert_eq!(excerpt(&"\0".repeat(60)), "\\u{0}".repeat(12) + "...");
        assert_eq!(excerpt(&"ä".repeat(1_000_000)), "ä".repeat(60) + "...");
    }
}
