//! Joining the topics of the machine that a configuration describes.

use tracing::{info, warn};

use super::Config;
use crate::messages::{Bus, PortError};

impl Config {
    /// Joins the topics of the machine, in real or simulated time. Logs a warning where time is simulated.
    pub fn join(&self) -> Result<Bus, PortError> {
        if let Some(location) = Bus::fallback_location() {
            info!("{location}");
        }
        if self.deployment.realtime.is_simulated() {
            warn!(
                "TIME IS SIMULATED (realtime.release = \"lockstep\"): no hardware receives messages, topics are \
                 hexad-simulated/{}/...",
                self.name
            );
            return Bus::join_simulated(&self.name);
        }
        Bus::join(&self.name)
    }
}
