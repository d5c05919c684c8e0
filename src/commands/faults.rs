//! `hexad faults`: names and texts of states, faults and limits by number, from their definition.

use core::fmt;

use clap::Args;
use serde::Serialize;

use super::failure::Failure;
use hexad_core::control::signals::diagnostic::{DiagnosticCode, Reaction};
use hexad_core::control::signals::limits::Limit;
use hexad_core::control::signals::state::State;
use hexad_machine::text::files::{print, print_json};
use hexad_machine::text::text_table::{Left, Right, paragraph, stdout_width, text_table};

#[derive(Debug, Args)]
pub struct FaultsArguments {
    /// Number of a diagnostic, to show it alone
    #[arg(value_name = "CODE", value_parser = code_by_number)]
    code: Option<DiagnosticCode>,
    /// Print the diagnostics as JSON instead of the text
    #[arg(long)]
    json: bool,
}

impl FaultsArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let all = DiagnosticCode::ALL.iter().filter(|code| **code != DiagnosticCode::None);
        let shown = all.filter(|code| self.code.is_none_or(|wanted| wanted == **code));
        let entries: Vec<_> = shown.map(|code| FaultEntry::new(*code)).collect();
        match (self.json, self.code) {
            (true, _) => print_json(&entries)?,
            (false, Some(_)) => entries.iter().try_for_each(print)?,
            (false, None) => print(FaultTables(entries))?,
        }
        Ok(())
    }
}

fn code_by_number(text: &str) -> Result<DiagnosticCode, String> {
    let code = text.parse().ok().and_then(DiagnosticCode::from_number);
    code.filter(|code| *code != DiagnosticCode::None)
        .ok_or_else(|| "must be the number of a diagnostic; `hexad faults` lists them".into())
}

/// Texts of one diagnostic.
#[derive(Serialize)]
struct FaultEntry {
    code: u32,
    name: &'static str,
    cause: &'static str,
    /// `none`, `stop` or `brake`.
    reaction: &'static str,
    remedy: &'static str,
}

impl FaultEntry {
    fn new(code: DiagnosticCode) -> Self {
        let reaction = match code.reaction() {
            Reaction::None => "none",
            Reaction::Stop => "stop",
            Reaction::Brake => "brake",
        };
        Self {
            code: code as u32,
            name: code.name(),
            cause: code.meaning().trim(),
            reaction,
            remedy: code.remedy(),
        }
    }
}

impl fmt::Display for FaultEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { code, name, cause, remedy, .. } = self;
        let reaction = match self.reaction {
            "stop" => "The platform is brought to rest; fault until cleared. To do: ",
            "brake" => "Forces are disabled and the brakes close at once; fault until cleared. To do: ",
            _ => "To do: ",
        };
        let text = paragraph("    ", &format!("{cause} {reaction}{remedy}"), stdout_width());
        write!(f, "{code:>3} {name}\n{text}")
    }
}

/// Tables of states, faults and limits, by number.
struct FaultTables(Vec<FaultEntry>);

impl fmt::Display for FaultTables {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let states = State::ALL.map(|state| {
            let force = if state.has_control() { "valid" } else { "not valid: brake" };
            [(state as u32).to_string(), state.name().into(), force.into()]
        });
        write!(f, "{}", text_table(2, &[("state", Right), ("", Left), ("force", Left)], states))?;
        writeln!(f, "\nfault (below 100: none; the platform waits)")?;
        self.0.iter().try_for_each(|entry| write!(f, "{entry}"))?;
        writeln!(f, "\nbits of `active_limits`")?;
        let limits = Limit::ALL.map(|limit| [(limit as u32).to_string(), limit.name().into()]);
        write!(f, "{}", text_table(2, &[("bit", Right), ("limit", Left)], limits))
    }
}
