//! `[operator]`: who may send requests over the control socket.

use crate::config::reader::SectionReader;

/// Longest name of a group, as of useradd.
const MAX_GROUP_LENGTH: usize = 32;

/// Section `[operator]`.
#[derive(Clone, Debug, PartialEq)]
pub struct OperatorAccess {
    /// Group of the control socket; `None` for the group of the daemon.
    pub group: Option<String>,
    /// Permissions of the control socket: to connect is to write.
    pub mode: u32,
}

impl OperatorAccess {
    /// Whether every user may connect.
    pub fn is_for_everybody(&self) -> bool {
        self.mode & 0o002 != 0
    }
}

pub(super) fn read(mut section: SectionReader) -> OperatorAccess {
    let modes = [("0600", 0o600), ("0660", 0o660), ("0666", 0o666)];
    let access = OperatorAccess {
        group: section.optional_name("group", MAX_GROUP_LENGTH),
        mode: section.choice_or("mode", 0o660, &modes),
    };
    section.finish();
    access
}
