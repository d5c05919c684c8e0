//! Services `std_srvs/srv/Trigger` that carry out operators' requests.

use std::thread;
use std::time::Duration;

use futures::executor::block_on;
use hexad::control::signals::state::Request;
use hexad::operator::protocol::is_stop;
use hexad::operator::requests::carry_out;
use hexad::operator::stops::stop_machine;
use hexad::operator::{OperatorError, Order};
use ros2_client::Server;
use tracing::{info, warn};

use crate::node::NodeNames;
use crate::rejection::{Rejection, RejectionLog};
use crate::ros_messages::{TriggerRequest, TriggerResponse};

/// Longest wait for the result of a request.
const TIMEOUT: Duration = Duration::from_secs(30);

/// Serves one request in a thread of its own, so that no request waits for another kind.
pub fn serve(
    machine: String,
    request: Request,
    server: Server<TriggerRequest, TriggerResponse>,
    names: NodeNames,
) {
    thread::spawn(move || {
        let mut rejections = RejectionLog::default();
        loop {
            let id = match block_on(server.async_receive_request()) {
                Ok((id, _)) => id,
                Err(error) => {
                    rejections.add(&Rejection::Format(error.to_string()), || request.name().into());
                    continue;
                }
            };
            let remote = names.of(&id.writer_gid);
            let outcome = carry_out_for(&machine, request, &remote);
            info!(remote, "{}: {}", request.name(), outcome.message);
            // Those that arrived meanwhile have the same outcome: none of them begins control later. Stops are carried out one by one.
            let mut waiting = vec![id];
            while !is_stop(request)
                && let Ok(Some((id, _))) = server.receive_request()
            {
                waiting.push(id);
            }
            for id in waiting {
                if let Err(error) = server.send_response(id, outcome.clone()) {
                    warn!(remote, "{}: no answer: {error}", request.name());
                }
            }
        }
    });
}

fn carry_out_for(machine: &str, request: Request, remote: &str) -> TriggerResponse {
    let order = Order { request, is_patient: false, timeout: TIMEOUT, remote: Some(remote) };
    let outcome: Result<String, OperatorError> = if is_stop(request) {
        stop_machine(machine, &order, &|| false)
    } else {
        carry_out(machine, &order, &|| false, |_| ())
    };
    match outcome {
        Ok(state) => TriggerResponse { success: true, message: state },
        Err(error) => TriggerResponse { success: false, message: error.to_string() },
    }
}
