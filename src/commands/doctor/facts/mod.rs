//! What a host offers to a hard real-time loop: facts, each with its rating and what would make it better.
//!
//! Nothing is guessed: what cannot be read is unknown, with the reason.

use serde::{Deserialize, Serialize};

use self::permissions::Refused;
use self::processors::Chosen;
use super::files::HostFiles;
use crate::config::deployment::Realtime;
use crate::messages::Bus;
use crate::realtime::clock_cost::ClockCost;
use crate::realtime::setup::permissions::Permissions;

mod kernel;
pub mod permissions;
mod power;
mod processors;
pub mod surroundings;

/// What a fact means to a loop that must never be late.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rating {
    /// Nothing is left to be done.
    Good,
    /// It costs latency, in a way that has an end.
    Fair,
    /// While it is so, no bound of the latency can be promised.
    Bad,
    /// Could not be found out.
    Unknown,
}

/// One thing about a host.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fact {
    pub name: String,
    pub rating: Rating,
    /// What it is, or why that is unknown.
    pub found: String,
    /// What to do about it, where it is not good.
    pub remedy: Option<String>,
}

impl Fact {
    /// Nothing to be done.
    pub fn good(name: &str, found: impl Into<String>) -> Self {
        Self { name: name.into(), rating: Rating::Good, found: found.into(), remedy: None }
    }

    /// Could be better.
    pub fn fair(name: &str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { rating: Rating::Fair, remedy: Some(remedy.into()), ..Self::good(name, found) }
    }

    /// Stands against a bound of the latency.
    pub fn bad(name: &str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { rating: Rating::Bad, ..Self::fair(name, found, remedy) }
    }

    /// Could not be found out; `remedy` is how it could.
    pub fn unknown(name: &str, reason: impl Into<String>, remedy: Option<&str>) -> Self {
        Self { rating: Rating::Unknown, remedy: remedy.map(Into::into), ..Self::good(name, reason) }
    }
}

/// Everything, the most important first.
pub fn all(
    host: &HostFiles,
    realtime: &Realtime,
    permissions: &Permissions,
    refused: &Refused,
    cost: &ClockCost,
) -> Vec<Fact> {
    let permitted = permissions.cpus_permitted.clone();
    let chosen = &Chosen { realtime: realtime.cpu, io: realtime.io_cpu, permitted };
    let mut facts = std::vec![kernel::preemption(host), surroundings::machine(host)];
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
        power::idle(host, chosen, idle_us, refused.shallow_sleep.as_ref()),
        kernel::clock(host, cost),
        surroundings::swap(host),
        surroundings::huge_pages(host),
        surroundings::shared_memory(host, Bus::fallback_location().as_deref()),
    ]);
    facts
}
