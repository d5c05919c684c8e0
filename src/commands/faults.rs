//! `hexad faults`: the table of causes, from the one place where they are defined; and their numbers in words.

use core::fmt;

use crate::control::diagnostic::{DiagnosticCode, Reaction};
use crate::control::limits::Limit;
use crate::control::state::State;

/// Displays as tables of states, causes and limits, by number.
pub struct Faults;

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "state     force")?;
        for state in State::ALL {
            let force = if state.has_control() { "valid" } else { "not valid: brake" };
            writeln!(f, "{} {:<9}{force}", state as u32, state.name())?;
        }
        writeln!(f, "\nfault (below 100: none; the platform waits)")?;
        for code in DiagnosticCode::ALL.iter().filter(|code| **code != DiagnosticCode::None) {
            let reaction = match code.reaction() {
                Reaction::None => "To do: ",
                Reaction::Stop => "The platform is brought to rest; fault until cleared. To do: ",
                Reaction::Brake => "The platform is let go at once; fault until cleared. To do: ",
            };
            writeln!(f, "{:>3} {}\n    {reaction}{}", *code as u32, code.name(), code.remedy())?;
        }
        writeln!(f, "\nbit of `limiting`")?;
        for limit in Limit::ALL {
            writeln!(f, "{:>3} {}", limit as u32, limit.name())?;
        }
        Ok(())
    }
}
