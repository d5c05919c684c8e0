//! `config/reference.toml` cannot drift from the reader: the reader itself says which keys it knows.

use hexad::config::{Config, ConfigError, Violation};

use super::{REFERENCE, violations};

/// Visits every table of a document.
fn each_table(value: &mut toml::Value, visit: &mut dyn FnMut(&mut toml::Table)) {
    match value {
        toml::Value::Table(table) => {
            visit(table);
            table.iter_mut().for_each(|(_, value)| each_table(value, visit));
        }
        toml::Value::Array(items) => items.iter_mut().for_each(|item| each_table(item, visit)),
        _ => {}
    }
}

/// The reference with another k-th table; none behind the last.
fn with_table(k: usize, mut change: impl FnMut(&mut toml::Table)) -> Option<String> {
    let mut document = toml::Value::Table(REFERENCE.parse().unwrap());
    let mut count = 0;
    each_table(&mut document, &mut |table| {
        if count == k {
            change(table);
        }
        count += 1;
    });
    (k < count).then(|| toml::to_string(&document).unwrap())
}

/// The keys of each table.
fn keys() -> impl Iterator<Item = (usize, Vec<String>)> {
    (0..).map_while(|k| {
        let mut keys = vec![];
        with_table(k, |table| keys.extend(table.keys().cloned()))?;
        Some((k, keys))
    })
}

#[test]
fn the_reference_has_every_key_that_the_reader_knows() {
    for (k, keys) in keys() {
        let unknown = |table: &mut toml::Table| drop(table.insert("no_such_key".into(), 1.into()));
        let found = violations(&with_table(k, unknown).unwrap());
        let [violation] = found.as_slice() else { panic!("{keys:?}: {found:#?}") };
        let (_, known) = violation.bound.split_once("must be one of: ").unwrap();
        for key in known.split(", ") {
            let written = keys.iter().any(|k| k == key) || REFERENCE.contains(&format!("\n# {key} = "));
            assert!(written, "{violation} has no {key}");
        }
    }
}

#[test]
fn the_reference_gives_the_defaults() {
    let read = |text: &str| {
        let config = Config::parse(text, "reference.toml")?;
        // The frames are examples; their default is none.
        Ok(Config { text: String::new(), frames: vec![], ..config })
    };
    let all = format!("{:?}", read(&with_table(0, |_| ()).unwrap()).unwrap());
    let mut optional = Vec::new();
    for (k, key) in keys().flat_map(|(k, keys)| keys.into_iter().map(move |key| (k, key))) {
        match read(&with_table(k, |table| drop(table.remove(&key))).unwrap()) {
            Ok(config) => {
                assert_eq!(format!("{config:?}"), all, "{key} of table {k} is not the default");
                optional.push(key);
            }
            Err(ConfigError::Invalid { violations, .. }) => {
                let missing = |v: &Violation| v.bound.starts_with("missing") || v.key == "leg";
                assert!(violations.iter().all(missing), "{key} of table {k}: {violations:#?}");
            }
            Err(other) => panic!("{other}"),
        }
    }
    // 11 sections with 13 + 15 + 3 + 2 + 12 + 4 + 3 + 3 + 1 + 5 + 0 keys, 5 of the actuator, 3 of the inertia, one of home, one for each leg, the frames, 6 sections
    // of the plant with 2 + 4 + 2 + 4 + 3 + 3 keys.
    assert_eq!(optional.len(), 11 + 61 + 5 + 3 + 1 + 6 + 1 + 6 + 18, "{optional:?}");
}
