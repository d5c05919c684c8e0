//! Access to the topics of the machine that a configuration describes.

use tracing::warn;

use super::Config;
use crate::messages::ports::{Bus, PortError, Time};

impl Config {
    /// Joins the topics of the machine, in real or simulated time. Logs a warning where time is simulated.
    pub fn join(&self) -> Result<Bus, PortError> {
        let time = self.deployment.realtime.time();
        if time == Time::Simulated {
            warn!(
                "TIME IS SIMULATED (realtime.release = \"lockstep\"): no hardware receives messages, topics are \
                 hexad-simulated/{}/...",
                self.name
            );
        }
        Bus::join_in(&self.name, time)
    }
}
