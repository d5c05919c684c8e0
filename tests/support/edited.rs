//! Configurations with other values of some keys.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Mutex;

use super::{Remembered, remembered, repository};
use hexad::config::Config;
use toml::{Table, Value};

/// The table of a file, to be edited.
pub fn table(path: &Path) -> Table {
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.parse().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// `config/NAME.toml`.
pub fn deployed_table(name: &str) -> Table {
    table(&repository().join("config").join(name).with_extension("toml"))
}

/// Sets `[section] key`.
pub fn set(table: &mut Table, section: &str, key: &str, value: impl Into<Value>) {
    let section = table.entry(section).or_insert_with(|| Table::new().into());
    section.as_table_mut().unwrap().insert(key.into(), value.into());
}

/// A machine of `config` with drives of this force \[N\], and the limits that follow from it.
pub fn with_force(name: &str, force_n: f64) -> Config {
    let mut table = deployed_table(name);
    set(&mut table, "actuator", "max_force_n", force_n);
    config(&table)
}

/// Validates an edited table.
pub fn config(table: &Table) -> Config {
    let text = table.to_string();
    Config::parse(&text, "edited").unwrap_or_else(|error| panic!("{error}"))
}

/// A deployable machine with other values of the keys in these lines.
pub fn configured(machine: &str, lines: &str) -> Config {
    static KNOWN: Remembered<Config> = Mutex::new(BTreeMap::new());
    let make = || {
        let mut table = deployed_table(machine);
        for (section, keys) in lines.parse::<Table>().unwrap() {
            for (key, value) in keys.as_table().unwrap() {
                set(&mut table, &section, key, value.clone());
            }
        }
        self::config(&table)
    };
    remembered(&KNOWN, &format!("{machine} {lines}"), make)
}
