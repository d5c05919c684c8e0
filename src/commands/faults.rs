//! `hexad faults`: names and texts of states, faults and limits by number, from their definition.

use core::fmt;

use crate::control::signals::diagnostic::{DiagnosticCode, Reaction};
use crate::control::signals::limits::Limit;
use crate::control::signals::state::State;
use crate::output::text_table::{Left, Right, paragraph, stdout_width, text_table};

/// Tables of states, faults and limits, by number.
pub struct FaultTables;

impl fmt::Display for FaultTables {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let states = State::ALL.map(|state| {
            let force = if state.has_control() { "valid" } else { "not valid: brake" };
            [(state as u32).to_string(), state.name().into(), force.into()]
        });
        write!(f, "{}", text_table(2, &[("state", Right), ("", Left), ("force", Left)], states))?;
        writeln!(f, "\nfault (below 100: none; the platform waits)")?;
        for code in DiagnosticCode::ALL.iter().filter(|code| **code != DiagnosticCode::None) {
            let reaction = match code.reaction() {
                Reaction::None => "To do: ",
                Reaction::Stop => "The platform is brought to rest; fault until cleared. To do: ",
                Reaction::Brake => {
                    "Forces are disabled and the brakes close at once; fault until cleared. To do: "
                }
            };
            let text = paragraph("    ", &format!("{reaction}{}", code.remedy()), stdout_width());
            write!(f, "{:>3} {}\n{text}", *code as u32, code.name())?;
        }
        writeln!(f, "\nbits of `active_limits`")?;
        let limits = Limit::ALL.map(|limit| [(limit as u32).to_string(), limit.name().into()]);
        write!(f, "{}", text_table(2, &[("bit", Right), ("limit", Left)], limits))
    }
}
