//! The machine that a bridge connects.

use hexad_client::messages::Bus;
use hexad_machine::config::Config;

/// Joins the machine of a configuration, which the network file must name. An error says what prevents it.
pub fn join(name: &str, config: &Config) -> Result<Bus, String> {
    if name != config.name {
        return Err(format!("name = \"{name}\" must be the name in the machine file, \"{}\"", config.name));
    }
    let bus = config.join().map_err(|error| error.to_string())?;
    if bus.is_simulated() {
        return Err("the machine runs in simulated time, which no other host shares: realtime.release".into());
    }
    Ok(bus)
}
