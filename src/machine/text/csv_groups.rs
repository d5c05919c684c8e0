//! Groups of columns in one CSV table, as `hexad convert` writes them: `setpoint_x`, `reference_x`. A reader takes one group.

use super::csv_columns::find;

/// Groups with the columns of a motion or of lengths. Without a choice a reader takes the first, or the only one there is.
pub const GROUPS: [&str; 4] = ["setpoint", "reference", "estimated", "measured"];

/// Names of columns in a group.
pub fn in_group(group: &str, names: &[String]) -> Vec<String> {
    names.iter().map(|name| format!("{group}_{name}")).collect()
}

/// Names of a group's columns without the group; empty for columns of no or another group.
pub(super) fn without_group(header: &[String], group: &str) -> Vec<String> {
    let name = |found: &String| found.strip_prefix(group)?.strip_prefix('_').map(String::from);
    header.iter().map(|found| name(found).unwrap_or_default()).collect()
}

/// Group of the required columns, the first of which is the time; `None` if they are in no group.
///
/// # Errors
/// The requested group lacks a column, or several groups other than `setpoint` have all columns and none is requested.
pub(super) fn select_group<'a>(
    header: &[String],
    required: &[String],
    requested: Option<&'a str>,
) -> Result<Option<&'a str>, String> {
    let is_missing = |header: &[String], name: &&String| find(header, name).is_empty();
    let missing = |group: &str| {
        let header = without_group(header, group);
        required.iter().find(|name| is_missing(&header, name))
    };
    let complete: Vec<_> = GROUPS.into_iter().filter(|group| missing(group).is_none()).collect();
    if let Some(group) = requested {
        return missing(group).map_or(Ok(Some(group)), |name| {
            let others = if complete.is_empty() { "none".into() } else { complete.join(", ") };
            Err(format!("missing column {group}_{name}: groups with all columns: {others}"))
        });
    }
    let has_plain = required.iter().skip(1).any(|name| !is_missing(header, &name));
    match complete.as_slice() {
        _ if has_plain => Ok(None),
        [] => Ok(None),
        [group] | [group @ "setpoint", ..] => Ok(Some(group)),
        several => Err(format!("columns of several groups: --group must name one of {}", several.join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::csv_columns::{length_columns, pose_columns};

    fn header(groups: &[&str]) -> Vec<String> {
        [
            vec!["cycle".into(), "t".into()],
            groups.iter().flat_map(|group| in_group(group, &pose_columns())).collect(),
        ]
        .concat()
    }

    #[test]
    fn a_reader_takes_one_group_or_is_refused() {
        let select = |groups: &[&str], requested| select_group(&header(groups), &pose_columns(), requested);
        assert_eq!(select(&[], None), Ok(None));
        assert_eq!(select(&["reference"], None), Ok(Some("reference")));
        assert_eq!(select(&["reference", "setpoint"], None), Ok(Some("setpoint")));
        assert_eq!(select(&["reference", "setpoint"], Some("reference")), Ok(Some("reference")));
        let several = "columns of several groups: --group must name one of reference, estimated";
        assert_eq!(select(&["estimated", "reference"], None), Err(several.into()));
        let missing = "missing column measured_t: groups with all columns: reference";
        assert_eq!(select(&["reference"], Some("measured")), Err(missing.into()));
        let both = [header(&["setpoint"]), pose_columns()].concat();
        assert_eq!(select_group(&both, &pose_columns(), None), Ok(None));
        assert_eq!(select_group(&both, &length_columns(), None), Ok(None));
        assert_eq!(select_group(&both, &pose_columns(), Some("setpoint")), Ok(Some("setpoint")));
    }
}
