//! What a bench could not measure: it measures the rest, names these at its end with their reasons, and succeeds.
//!
//! With `HEXAD_REQUIRE_REALTIME=1`, as in `.ci/run`, it fails if it lacked a right or a tool, or measured nothing of one of its
//! parts: so a bench that has stopped to work is noticed.

use std::collections::BTreeMap;
use std::env;
use std::fmt::Display;

use super::Failure;

/// What was not measured.
#[derive(Default)]
pub struct Omissions {
    lines: Vec<String>,
    lacks_something: bool,
    /// Whether anything of a part was measured.
    parts: BTreeMap<&'static str, bool>,
}

impl Omissions {
    /// For what no right and no tool would change.
    pub fn add(&mut self, what: impl Display, why: impl Display) {
        self.lines.push(format!("    {what}: {why}"));
    }

    /// For lack of a right or a tool.
    pub fn lacking(&mut self, what: impl Display, why: impl Display) {
        self.lacks_something = true;
        self.add(what, why);
    }

    /// The result of a measurement, one of a part; `None` if it failed.
    pub fn attempt<T>(
        &mut self,
        part: &'static str,
        what: impl Display,
        result: Result<T, Failure>,
    ) -> Option<T> {
        *self.parts.entry(part).or_default() |= result.is_ok();
        result.map_err(|failure| self.add(what, failure)).ok()
    }

    /// Prints what was not measured.
    pub fn finish(self) -> Result<(), Failure> {
        if self.lines.is_empty() {
            return Ok(());
        }
        println!("\nNOT MEASURED: {}\n{}", self.lines.len(), self.lines.join("\n"));
        let has_no_figure = self.parts.values().any(|is_measured| !is_measured);
        let is_required = env::var_os("HEXAD_REQUIRE_REALTIME").is_some_and(|value| value == "1");
        if is_required && (self.lacks_something || has_no_figure) {
            return Err("HEXAD_REQUIRE_REALTIME=1, and a part of this bench was not measured".into());
        }
        Ok(())
    }
}
