//! Users of daemons: their names, and whether their answers count.

use nix::unistd::{Gid, Group, Uid, User};

use crate::messages::location::{service_user_id, user_id};

/// Whether the answer of a daemon of this user counts: it must be root, the service's user, or this user. Any
/// other user can write a program that answers like a daemon.
pub fn is_trusted(owner: u32) -> bool {
    [Some(0), service_user_id(), Some(user_id())].contains(&Some(owner))
}

/// Name of a user, or its number.
pub fn user_name(user_id: u32) -> String {
    let found = User::from_uid(Uid::from_raw(user_id)).ok().flatten();
    found.map_or_else(|| user_id.to_string(), |user| user.name)
}

/// Name of a group, or its number.
pub fn group_name_or_id(group_id: u32) -> String {
    let found = Group::from_gid(Gid::from_raw(group_id)).ok().flatten();
    found.map_or_else(|| group_id.to_string(), |group| group.name)
}
