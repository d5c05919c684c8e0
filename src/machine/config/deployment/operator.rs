//! `[operator]`: users who may send requests over the control socket.

use crate::config::reader::SectionReader;

/// Longest name of a group, as in useradd.
const MAX_GROUP_LENGTH: usize = 32;

/// Section `[operator]`.
#[derive(Clone, Debug, PartialEq)]
pub struct OperatorAccess {
    /// Group of the control socket; `None` for the group of the daemon.
    pub group: Option<String>,
    /// Permissions of the control socket. Connecting needs the permission to write.
    pub mode: u32,
    /// Group that may read the status and nothing else, besides those who may send requests.
    pub read_group: Option<String>,
}

pub(super) fn read(mut section: SectionReader) -> OperatorAccess {
    let modes = [("0600", 0o600), ("0660", 0o660), ("0666", 0o666)];
    OperatorAccess {
        group: section.optional_name("group", MAX_GROUP_LENGTH),
        mode: section.choice_or("mode", 0o660, &modes),
        read_group: section.optional_name("read_group", MAX_GROUP_LENGTH),
    }
}
