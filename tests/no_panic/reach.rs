//! Everything that a function can reach.

use std::collections::BTreeSet;

use super::executable::{Executable, Leap, Place};

/// What the walk from one function found.
#[derive(Debug, Default)]
pub struct Reached {
    /// Names of the functions walked through.
    pub functions: BTreeSet<String>,
    /// Functions of shared libraries that are called.
    pub imports: BTreeSet<String>,
    /// The ways to whatever is neither code of this executable nor an import that is allowed.
    pub forbidden: Vec<String>,
}

/// Who gets here has left real time: where from is all that matters. If the toolchain gives these another
/// name the walk goes on, to the pointers, imports and traps that all of them end in.
const DEAD_ENDS: [&str; 3] = ["core::panicking", "alloc::", "std::"];

/// Walks through all code that can run once the function called `root` runs.
pub fn reached_from(executable: &Executable, root: &str, allowed: &[(&str, Option<&str>)]) -> Reached {
    let roots = executable.named(root);
    assert!(!roots.is_empty(), "no function {root}: it has another name now, or was inlined or stripped");
    let mut reached = Reached::default();
    let mut seen: BTreeSet<u64> = roots.iter().map(|root| root.address).collect();
    let mut waiting: Vec<_> = roots.into_iter().map(|root| (root, root.name.clone())).collect();
    while let Some((function, way)) = waiting.pop() {
        reached.functions.insert(function.name.clone());
        for (address, leap) in executable.leaps(function) {
            let mut forbid = |what: &str| reached.forbidden.push(format!("{way} > {what} (at {address:#x})"));
            match executable.place(leap) {
                Place::Function(to) if is_dead_end(&to.name) => forbid(&to.name),
                Place::Function(to) if seen.insert(to.address) => {
                    waiting.push((to, format!("{way} > {}", to.name)));
                }
                Place::Function(_) => {}
                Place::Import(name) => {
                    reached.imports.insert(name.into());
                    let may = |(import, caller): &(&str, Option<&str>)| {
                        *import == name && caller.is_none_or(|caller| caller == function.name)
                    };
                    if !allowed.iter().any(may) {
                        forbid(name);
                    }
                }
                Place::Unknown if leap == Leap::Somewhere => forbid("call through a pointer"),
                Place::Unknown if leap == Leap::Trap => forbid("trap or system call"),
                Place::Unknown => forbid(&format!("code without a name, {leap:x?}")),
            }
        }
    }
    reached
}

fn is_dead_end(name: &str) -> bool {
    let path = name.trim_start_matches('<');
    DEAD_ENDS.iter().any(|end| path.starts_with(end))
}
