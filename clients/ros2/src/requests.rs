//! Services `std_srvs/srv/Trigger` that carry out operators' requests.

use std::thread;

use futures::executor::block_on;
use hexad_bridge::rejection::{Rejection, RejectionLog};
use hexad_bridge::requests::carry_out_for;
use hexad_client::operator::protocol::is_stop;
use hexad_core::control::signals::state::Request;
use ros2_client::Server;
use tracing::{info, warn};

use crate::node::NodeNames;
use crate::ros_messages::{TriggerRequest, TriggerResponse};

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
            let outcome = response(&machine, request, &remote);
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

fn response(machine: &str, request: Request, remote: &str) -> TriggerResponse {
    match carry_out_for(machine, request, remote) {
        Ok(state) => TriggerResponse { success: true, message: state },
        Err(error) => TriggerResponse { success: false, message: error.to_string() },
    }
}
