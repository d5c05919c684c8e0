//! Request for control by a setpoint source. It is sent only after the first setpoints are published.

use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

use super::not_engaged;
use crate::commands::failure::Failure;
use crate::commands::request::carry_out_in_background;
use hexad_client::messages::StatusMessage;
use hexad_client::operator::connection::Connection;
use hexad_client::operator::requests::{StopBaseline, post_for_cycle};
use hexad_client::operator::{OperatorError, Order};
use hexad_client::realtime::stop_request::Stop;
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::state::{Request, State};
use hexad_machine::config::Config;

/// Time between two looks whether a stop came while the request waits here.
const STOP_CHECK_INTERVAL: Duration = Duration::from_millis(100);

/// Request for control in progress.
pub enum Engagement {
    /// Another process engages.
    None,
    /// Request over the control socket, sent by a separate thread.
    Socket {
        machine: String,
        baseline: StopBaseline,
        /// When it was last looked whether a stop came.
        checked: Instant,
        began: Instant,
        within: Duration,
        stop: Stop,
        result: Option<Outcome>,
    },
    /// Request for a cycle in simulated time, which begins with the first wait; `posted` keeps the last one.
    InStep { machine: String, began_ns: Option<u64>, within: Duration, posted: Option<Connection> },
}

type Outcome = Receiver<Result<(), OperatorError>>;

impl Engagement {
    /// Request over the control socket.
    pub fn over_socket(config: &Config, within: Duration, stop: &Stop) -> Self {
        let (machine, baseline, now) = (config.name.clone(), StopBaseline::now(&config.name), Instant::now());
        Self::Socket { machine, baseline, checked: now, began: now, within, stop: stop.clone(), result: None }
    }

    /// Request for the cycle of a setpoint.
    pub fn in_step(config: &Config, within: Duration) -> Self {
        Self::InStep { machine: config.name.clone(), began_ns: None, within, posted: None }
    }

    /// Control has begun; if it ends, the time in step with the setpoints begins again. A request over the socket that was not
    /// necessary is not sent later: the daemon may have been restarted, and an operator must engage.
    pub fn note_control_begun(&mut self) {
        match self {
            Self::InStep { began_ns, .. } => *began_ns = None,
            Self::Socket { result: None, .. } => *self = Self::None,
            Self::None | Self::Socket { .. } => {}
        }
    }

    /// Error if the time has passed, or a stop has come, before the request could be sent, or in step with the setpoints before
    /// control began. `reason` says why it was not sent.
    pub fn check_time(&mut self, now_ns: u64, reason: &str) -> Result<(), Failure> {
        let (elapsed, within) = match self {
            Self::Socket { machine, baseline, checked, began, within, result: None, .. } => {
                if checked.elapsed() > STOP_CHECK_INTERVAL {
                    *checked = Instant::now();
                    baseline.check(machine)?;
                }
                (began.elapsed(), *within)
            }
            Self::InStep { began_ns, within, .. } => {
                let began_ns = *began_ns.get_or_insert(now_ns);
                (Duration::from_nanos(now_ns.saturating_sub(began_ns)), *within)
            }
            Self::None | Self::Socket { .. } => return Ok(()),
        };
        if elapsed <= within {
            return Ok(());
        }
        Err(not_engaged(within, reason))
    }

    /// Sends the request while the setpoints hold the pose of the platform. An error if it was refused.
    pub fn request(&mut self, now_ns: u64, status: &StatusMessage) -> Result<(), Failure> {
        match self {
            Self::None => Ok(()),
            Self::Socket { machine, baseline, began, within, stop, result, .. } => {
                let result = result.get_or_insert_with(|| {
                    let rest = within.saturating_sub(began.elapsed());
                    let baseline = Some(*baseline);
                    let order = Order { is_patient: true, baseline, ..Order::new(Request::Engage, rest) };
                    carry_out_in_background(machine, order, stop)
                });
                match result.try_recv() {
                    Ok(outcome) => Ok(outcome?),
                    Err(TryRecvError::Empty | TryRecvError::Disconnected) => Ok(()),
                }
            }
            Self::InStep { machine, posted, .. } => {
                if status.state() == Some(State::Fault) {
                    let reason = "not possible in state fault; hexad clear first".into();
                    return Err(OperatorError::Refused(Request::Engage, reason).into());
                }
                if status.diagnostic.code == DiagnosticCode::ReadyToEngage as u32 {
                    *posted = Some(post_for_cycle(machine, Request::Engage, now_ns)?);
                }
                Ok(())
            }
        }
    }
}
