//! Joining the topics of the machine that a configuration describes, in the time that it lives in.

extern crate std;

use tracing::warn;

use super::config::Config;
use crate::ipc::ports::{Bus, PortError, Time};

/// Joins. Says so loudly where time is simulated: nobody shall wait for a machine to move.
pub fn join(config: &Config) -> Result<Bus, PortError> {
    let time = config.deployment.realtime.time();
    if time == Time::Simulated {
        warn!(
            "TIME IS SIMULATED (realtime.release = \"lockstep\"): no hardware hears of this, topics are \
             hexad-simulated/{}/...",
            config.name
        );
    }
    Bus::join_in(&config.name, time)
}
