//! `config/reference.toml` cannot drift from the reader: the reader itself says which keys it knows.

use hexad::config::{Config, ConfigError, Violation};

use super::{REFERENCE, violations};

#[derive(Clone, Debug)]
enum Step {
    Key(String),
    Index(usize),
}

/// Every table of a document, with the path that leads to it.
fn tables(value: &toml::Value, path: Vec<Step>) -> Vec<Vec<Step>> {
    let children: Vec<(Step, &toml::Value)> = match value {
        toml::Value::Table(table) => {
            table.iter().map(|(key, value)| (Step::Key(key.clone()), value)).collect()
        }
        toml::Value::Array(items) => {
            items.iter().enumerate().map(|(i, value)| (Step::Index(i), value)).collect()
        }
        _ => Vec::new(),
    };
    let here = value.is_table().then(|| path.clone());
    let below = children.into_iter().flat_map(|(step, child)| {
        let path = path.iter().cloned().chain([step]).collect();
        tables(child, path)
    });
    here.into_iter().chain(below).collect()
}

fn table_at<'a>(document: &'a mut toml::Value, path: &[Step]) -> &'a mut toml::Table {
    let inner = path.iter().fold(document, |value, step| match step {
        Step::Key(key) => value.get_mut(key).unwrap(),
        Step::Index(i) => value.get_mut(i).unwrap(),
    });
    inner.as_table_mut().unwrap()
}

#[test]
fn the_reference_has_every_key_that_the_reader_knows() {
    let document = toml::Value::Table(REFERENCE.parse().unwrap());
    for path in tables(&document, Vec::new()) {
        let mut changed = document.clone();
        let table = table_at(&mut changed, &path);
        table.insert("no_such_key".into(), 1.into());
        let keys: Vec<String> = table.keys().cloned().collect();
        let found = violations(&toml::to_string(&changed).unwrap());
        let [violation] = found.as_slice() else { panic!("{path:?}: {found:#?}") };
        let (_, known) = violation.bound.split_once("must be one of: ").unwrap();
        for key in known.split(", ") {
            let written = keys.iter().any(|k| k == key) || REFERENCE.contains(&format!("\n# {key} = "));
            assert!(written, "{path:?} has no {key}");
        }
    }
}

#[test]
fn the_reference_gives_the_defaults() {
    let document = toml::Value::Table(REFERENCE.parse().unwrap());
    let read = |document: &toml::Value| {
        let config = Config::parse(&toml::to_string(document).unwrap(), "reference.toml")?;
        // The frames are examples; their default is none.
        Ok(Config { text: String::new(), frames: vec![], ..config })
    };
    let all = format!("{:?}", read(&document).unwrap());
    let mut optional = Vec::new();
    for path in tables(&document, Vec::new()) {
        let keys: Vec<String> = table_at(&mut document.clone(), &path).keys().cloned().collect();
        for key in keys {
            let mut changed = document.clone();
            table_at(&mut changed, &path).remove(&key);
            match read(&changed) {
                Ok(config) => {
                    assert_eq!(format!("{config:?}"), all, "{key} of {path:?} is not the default");
                    optional.push(key);
                }
                Err(ConfigError::Invalid { violations, .. }) => {
                    let missing = |v: &Violation| v.bound.starts_with("missing") || v.key == "leg";
                    assert!(violations.iter().all(missing), "{key} of {path:?}: {violations:#?}");
                }
                Err(other) => panic!("{other}"),
            }
        }
    }
    // 11 sections with 13 + 15 + 3 + 2 + 12 + 3 + 3 + 3 + 1 + 5 + 0 keys, 5 of the actuator, 3 of the inertia, one for each leg, the frames, 6 sections
    // of the plant with 2 + 4 + 2 + 4 + 3 + 3 keys.
    assert_eq!(optional.len(), 11 + 60 + 5 + 3 + 6 + 1 + 6 + 18, "{optional:?}");
}
