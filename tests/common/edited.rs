//! Configurations with other values of some keys.

use std::fs;
use std::path::Path;

use hexad::config::Config;
use toml::{Table, Value};

/// The table of a file, to be edited.
pub fn table(path: &Path) -> Table {
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.parse().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// `config/NAME.toml`.
pub fn deployed_table(name: &str) -> Table {
    table(&Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(name).with_extension("toml"))
}

/// Sets `[section] key`.
pub fn set(table: &mut Table, section: &str, key: &str, value: impl Into<Value>) {
    let section = table.entry(section).or_insert_with(|| Table::new().into());
    section.as_table_mut().unwrap().insert(key.into(), value.into());
}

/// Validates an edited table.
pub fn config(table: &Table) -> Config {
    let text = table.to_string();
    Config::parse(&text, "edited").unwrap_or_else(|error| panic!("{error}"))
}
