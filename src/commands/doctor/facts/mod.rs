//! Facts about a host that matter to a hard real-time loop, each with an assessment and a remedy.
//!
//! Nothing is guessed: a fact that cannot be read is unknown, with the reason.

use fearless_simd::Level;
use serde::{Deserialize, Serialize};

use self::permissions::RefusedRights;
use self::processors::LoopCpus;
use super::files::HostFiles;
use hexad_client::messages::location::{user_folder, user_id};
use hexad_client::realtime::clock_cost::ClockCost;
use hexad_client::realtime::setup::permissions::Permissions;
use hexad_core::model::machine::at_most_256_bits;
use hexad_machine::config::deployment::Realtime;

mod kernel;
pub mod permissions;
mod power;
mod processors;
pub mod surroundings;

/// Assessment of a fact: its consequence for a loop that must never be late.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Assessment {
    /// Nothing needs to be improved.
    Good,
    /// The fact costs a bounded amount of latency.
    Fair,
    /// The fact makes any bound of the latency impossible.
    Bad,
    /// The fact could not be determined.
    Unknown,
}

/// Fact about a host.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fact {
    pub name: String,
    pub assessment: Assessment,
    /// The finding, or the reason why it is unknown.
    pub found: String,
    /// Action that improves a fact that is not good.
    pub remedy: Option<String>,
}

/// Outcome of an examination: a fact without its name, or the reason why it is unknown.
type Examined = Result<Fact, String>;

impl Fact {
    /// Good fact.
    pub fn good(found: impl Into<String>) -> Self {
        Self { name: String::new(), assessment: Assessment::Good, found: found.into(), remedy: None }
    }

    /// Fair fact.
    pub fn fair(found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { assessment: Assessment::Fair, remedy: Some(remedy.into()), ..Self::good(found) }
    }

    /// Bad fact.
    pub fn bad(found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { assessment: Assessment::Bad, ..Self::fair(found, remedy) }
    }

    /// Unknown fact; `remedy` is how it can be determined.
    pub fn unknown(reason: impl Into<String>, remedy: Option<&str>) -> Self {
        Self { assessment: Assessment::Unknown, remedy: remedy.map(Into::into), ..Self::good(reason) }
    }
}

/// All facts, the most important first.
pub fn all(
    host: &HostFiles,
    realtime: &Realtime,
    permissions: &Permissions,
    refused: &RefusedRights,
    cost: &ClockCost,
) -> Vec<Fact> {
    let permitted = permissions.cpus_permitted.clone();
    let chosen = &LoopCpus { realtime: realtime.cpu, io: realtime.io_cpu, permitted };
    let idle_us = realtime.cpu_dma_latency_us;
    let mut facts = vec![("kernel", kernel::preemption(host)), ("machine", surroundings::machine(host))];
    let scheduling = permissions::scheduling(permissions, realtime, refused);
    facts.extend(scheduling.into_iter().map(|fact| ("scheduling", Ok(fact))));
    facts.extend([
        ("locked memory", Ok(permissions::locked_memory(permissions, realtime, refused))),
        ("cgroup", Ok(permissions::cgroup(permissions, realtime, refused))),
        ("container", Ok(permissions::container(permissions))),
        ("throttling", kernel::throttling(host)),
        ("processors", Ok(processors::count(chosen))),
        ("instruction set", Ok(processors::arithmetic(at_most_256_bits(Level::new())))),
        ("isolation", processors::isolation(host, chosen)),
        ("hyper-threading", processors::siblings(host, chosen)),
    ]);
    facts.extend(processors::interrupts(host, chosen).map(|fact| ("interrupts", Ok(fact))));
    facts.extend([
        ("frequency", power::frequency(host, chosen)),
        ("idle states", power::idle(host, chosen, idle_us, refused.idle_bound.as_ref())),
        ("clock", kernel::clock(host, cost)),
        ("swap", surroundings::swap(host)),
        ("huge pages", surroundings::huge_pages(host)),
        ("shared memory", surroundings::shared_memory(host, &user_folder())),
        ("after logout", surroundings::removed_memory(host, user_id())),
    ]);
    facts.into_iter().map(|(name, examined)| named(name, examined)).collect()
}

/// The fact with a name; unknown if its examination failed.
fn named(name: &str, examined: Examined) -> Fact {
    Fact { name: name.into(), ..examined.unwrap_or_else(|reason| Fact::unknown(reason, None)) }
}

#[cfg(test)]
mod tests {
    pub use super::Assessment::{Bad, Fair, Good, Unknown};
    use super::*;
    pub use crate::commands::doctor::files::sample::host;

    /// A fact as [`all`] returns it, without the name.
    pub fn examined(examined: Examined) -> Fact {
        named("", examined)
    }

    /// Asserts what a fact is on hosts with these files.
    pub fn assert_facts(fact: impl Fn(&HostFiles) -> Examined, rows: &[(&[(&str, &str)], Assessment)]) {
        for (files, assessment) in rows {
            let fact = examined(fact(&host(files).files));
            assert_eq!(fact.assessment, *assessment, "{files:?}: {fact:?}");
        }
    }
}
