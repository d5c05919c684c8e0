//! The numbers of a diagnostic in words.

use core::fmt;

use crate::control::state::{Cause, Evidence};

/// The numbers behind a cause, if it has any.
pub struct Told(pub Cause, pub Evidence);

impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(cause, Evidence { value, bound, index }) = self;
        if cause.unit().is_empty() {
            return Ok(());
        }
        if *index > 0 {
            write!(f, ", leg or axis {index}")?;
        }
        write!(f, ": {value:.6} {} (bound {bound:.6})", cause.unit())
    }
}

impl fmt::Display for crate::control::state::Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}; {}", self.cause.name(), Told(self.cause, self.evidence), self.cause.remedy())
    }
}
