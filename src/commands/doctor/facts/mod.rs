//! Facts about a host that matter to a hard real-time loop, each with an assessment and a remedy.
//!
//! Nothing is guessed: a fact that cannot be read is unknown, with the reason.

use serde::{Deserialize, Serialize};

use self::permissions::RefusedRights;
use self::processors::LoopCpus;
use super::files::HostFiles;
use crate::config::deployment::Realtime;
use crate::messages::ports::Bus;
use crate::realtime::clock_cost::ClockCost;
use crate::realtime::setup::permissions::Permissions;

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
    /// The finding, or the reason why there is none.
    pub found: String,
    /// Action that improves the fact, where it is not good.
    pub remedy: Option<String>,
}

impl Fact {
    /// Good fact.
    pub fn good(name: &str, found: impl Into<String>) -> Self {
        Self { name: name.into(), assessment: Assessment::Good, found: found.into(), remedy: None }
    }

    /// Fair fact.
    pub fn fair(name: &str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { assessment: Assessment::Fair, remedy: Some(remedy.into()), ..Self::good(name, found) }
    }

    /// Bad fact.
    pub fn bad(name: &str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { assessment: Assessment::Bad, ..Self::fair(name, found, remedy) }
    }

    /// Unknown fact; `remedy` is how it can be determined.
    pub fn unknown(name: &str, reason: impl Into<String>, remedy: Option<&str>) -> Self {
        Self { assessment: Assessment::Unknown, remedy: remedy.map(Into::into), ..Self::good(name, reason) }
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
    let mut facts = vec![kernel::preemption(host), surroundings::machine(host)];
    facts.extend(permissions::scheduling(permissions, realtime, refused));
    facts.extend([
        permissions::locked_memory(permissions, realtime, refused),
        permissions::cgroup(permissions, refused),
        permissions::container(permissions),
        kernel::throttling(host),
        processors::count(chosen),
        processors::isolation(host, chosen),
        processors::siblings(host, chosen),
    ]);
    facts.extend(processors::interrupts(host, chosen));
    let idle_us = realtime.cpu_dma_latency_us;
    facts.extend([
        power::frequency(host, chosen),
        power::idle(host, chosen, idle_us, refused.idle_bound.as_ref()),
        kernel::clock(host, cost),
        surroundings::swap(host),
        surroundings::huge_pages(host),
        surroundings::shared_memory(host, Bus::places_of_its_own().as_deref()),
    ]);
    facts
}
