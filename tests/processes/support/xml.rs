//! Well-formedness of XML, as far as pictures use it: tags in pairs, attributes in quotes, no stray `<` or `&`.

/// What is wrong with a document.
pub fn check(text: &str) -> Result<(), String> {
    let mut open: Vec<&str> = Vec::new();
    let mut roots = 0;
    let mut rest = text;
    while let Some(at) = rest.find('<') {
        references(&rest[..at])?;
        if open.is_empty() && !rest[..at].trim().is_empty() {
            return Err(format!("text outside of the root: {:?}", &rest[..at]));
        }
        let end = rest[at..].find('>').ok_or("a tag without end")? + at;
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        if tag.starts_with('?') || tag.starts_with('!') {
            continue;
        }
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop() != Some(name.trim()) {
                return Err(format!("</{name}> closes what is not open"));
            }
            continue;
        }
        let empty = tag.ends_with('/');
        let tag = tag.trim_end_matches('/');
        let (name, attributes) = tag.split_once(char::is_whitespace).unwrap_or((tag, ""));
        self::attributes(attributes)?;
        roots += usize::from(open.is_empty());
        if !empty {
            open.push(name);
        }
    }
    match (open.last(), roots, rest.trim()) {
        (Some(name), ..) => Err(format!("<{name}> is never closed")),
        (None, 1, "") => Ok(()),
        (None, 1, rest) => Err(format!("text after the root: {rest:?}")),
        (None, roots, _) => Err(format!("{roots} roots")),
    }
}

fn attributes(mut text: &str) -> Result<(), String> {
    while !text.trim().is_empty() {
        let (name, value) = text.split_once('=').ok_or_else(|| format!("no value: {text:?}"))?;
        let name = name.trim();
        if name.is_empty() || name.contains(char::is_whitespace) {
            return Err(format!("bad attribute name {name:?}"));
        }
        let value = value.strip_prefix('"').ok_or_else(|| format!("{name} is not in quotes"))?;
        let (value, after) = value.split_once('"').ok_or_else(|| format!("{name} is not in quotes"))?;
        references(value)?;
        text = after;
    }
    Ok(())
}

fn references(text: &str) -> Result<(), String> {
    for after in text.split('&').skip(1) {
        let name = after.split_once(';').map_or("", |(name, _)| name);
        if !(matches!(name, "lt" | "gt" | "amp" | "quot" | "apos") || name.starts_with('#')) {
            return Err(format!("a stray & before {after:.20?}"));
        }
    }
    Ok(())
}

#[test]
fn the_check_knows_good_from_bad() {
    assert_eq!(check("<?xml version=\"1.0\"?>\n<a b=\"1\" c=\"&lt;\"><d/>x &amp; y</a>\n"), Ok(()));
    for bad in ["", "<a>", "<a></b>", "<a b=1/>", "<a>&</a>", "<a/><b/>", "<a/>x", "<a b=\"<\"/", "x<a/>"] {
        assert!(check(bad).is_err(), "{bad:?}");
    }
}
