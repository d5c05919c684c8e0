//! Former names of options, which are refused with the new form.

use clap::Error;
use clap::error::{ContextKind, ContextValue};

/// Former names, and the form in the place of each.
const RENAMED: [(&str, &str); 7] = [
    ("--x-mm", "--x 5mm"),
    ("--y-mm", "--y 5mm"),
    ("--z-mm", "--z 5mm"),
    ("--alpha-deg", "--alpha 5deg"),
    ("--beta-deg", "--beta 5deg"),
    ("--gamma-deg", "--gamma 5deg"),
    ("--turn-deg", "--turn 5deg"),
];

/// The error of a command line, with the new form of an option that has its former name.
pub fn with_new_form(mut error: Error) -> Error {
    let Some(ContextValue::String(found)) = error.get(ContextKind::InvalidArg) else { return error };
    let renamed = RENAMED.into_iter().find(|(former, _)| former == found);
    if let Some((former, new)) = renamed {
        let sentence = format!("{former} has no unit in its name any more, its value has one: {new}");
        error.remove(ContextKind::SuggestedArg);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![sentence.into()]));
    }
    error
}
