//! Search for a living driver. Two at once would both move the platform, and only one would be measured.

use std::thread;
use std::time::{Duration, Instant};

use hexad_client::messages::lockstep::REPEAT_INTERVAL;
use hexad_client::messages::{Bus, LeasedSubscriber, MeasuredMessage, PortError};
use hexad_daemon::process_names::{is_stopped, named};
use hexad_machine::config::Config;

/// Shortest time without a message after which no driver is assumed: longer than a busy host delays one. In
/// lock-step a waiting plant repeats its message within it.
const LISTENING_TIME: Duration = REPEAT_INTERVAL.saturating_mul(2);
/// The shortest time in periods of the loop, for slow loops.
const LISTENING_PERIODS: f64 = 3.0;
const POLL_INTERVAL: Duration = Duration::from_millis(1);

/// The process that publishes measurements of a machine, or is stopped and will go on, if there is one.
pub fn other_driver(config: &Config, bus: &Bus) -> Result<Option<String>, PortError> {
    let listed = bus.topic::<MeasuredMessage>()?.publisher_process_ids();
    if let Some(stopped) = listed.into_iter().find(|process_id| is_stopped(*process_id)) {
        return Ok(Some(named(stopped)));
    }
    let mut measured: LeasedSubscriber<MeasuredMessage> = bus.leased_subscriber(1, u64::MAX)?;
    let period_s = config.deployment.realtime.period_s();
    let listening_time = LISTENING_TIME.max(Duration::from_secs_f64(LISTENING_PERIODS * period_s));
    let began = Instant::now();
    while began.elapsed() < listening_time {
        if measured.receive_latest(false).is_some() {
            return Ok(Some(named(measured.publishers().used_pid)));
        }
        thread::sleep(POLL_INTERVAL);
    }
    Ok(None)
}
