//! A minimal setpoint source: engages, raises the platform by some millimetres and lowers it again.
//!
//!     cargo run --example setpoint_source -- fried2008 10
//!
//! Until the daemon is in control it offers the pose in which the platform stands. Each setpoint is X, X' and X'' of one
//! smooth motion: if one asks for more than the limits and the machine allow, the daemon comes to rest.

use std::env;
use std::thread::{sleep, spawn};
use std::time::Duration;

use hexad_client::messages::clock::monotonic_ns;
use hexad_client::messages::{Bus, PortError, SetpointMessage, StatusMessage};
use hexad_client::operator::Order;
use hexad_client::operator::requests::carry_out;
use hexad_core::control::signals::state::{Request, State};
use hexad_core::model::task::TaskState;
use hexad_core::motion::minimum_jerk::{straight_move, window};
use nalgebra::Vector6;

const PERIOD: Duration = Duration::from_millis(1);

/// Longest wait for control.
const PATIENCE: Duration = Duration::from_secs(15);

/// Duration of the motion, and of its way up and its way down \[s\].
const DURATION_S: f64 = 6.0;
const RISE_S: f64 = 2.0;

fn main() -> Result<(), PortError> {
    let mut arguments = env::args().skip(1);
    let machine = arguments.next().unwrap_or("fried2008".into());
    let height_mm = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(10.0);
    let bus = Bus::join(&machine)?;
    let mut statuses = bus.subscriber::<StatusMessage>(8)?;
    let mut setpoints = bus.publisher::<SetpointMessage>()?;
    // Takes control as soon as the setpoints hold the pose of the platform. It waits, so it has a thread of its own.
    spawn(move || {
        let order = Order { is_patient: true, ..Order::new(Request::Engage, PATIENCE) };
        if let Err(error) = carry_out(&machine, &order, &|| false, |reason| println!("waiting: {reason}")) {
            println!("{error}");
        }
    });
    let (mut start, mut began_ns) = (None, None);
    loop {
        sleep(PERIOD);
        let now_ns = monotonic_ns();
        if let Some(status) = statuses.receive_latest() {
            let state = status.state().unwrap_or_default();
            match state {
                State::Active => began_ns = began_ns.or(Some(now_ns)),
                State::Off | State::Standby if status.pose_valid == 1 => {
                    start = Some(Vector6::from(status.x))
                }
                _ => {}
            }
            if began_ns.is_some() && !state.has_control() {
                println!("control ended: {}", state.name());
                return Ok(());
            }
        }
        let Some(start) = start else { continue };
        let top = start + Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, height_mm * 1e-3);
        let t = began_ns.map_or(0.0, |began_ns| now_ns.saturating_sub(began_ns) as f64 * 1e-9);
        if t > DURATION_S + 1.0 {
            return Ok(());
        }
        let task: TaskState = straight_move(&start, &top, &window(t, DURATION_S, RISE_S));
        setpoints.publish(now_ns, (&task).into())?;
    }
}
