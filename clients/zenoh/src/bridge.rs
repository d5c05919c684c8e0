//! The bridge of one machine: setpoints and requests from Zenoh to the daemon, the state from the daemon to Zenoh.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use hexad_bridge::machine::join;
use hexad_bridge::rejection::{Rejection, RejectionLog};
use hexad_bridge::setpoint_relay::SetpointRelay;
use hexad_client::messages::Bus;
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::realtime::stop_request::Stop;
use hexad_machine::config::Config;
use tracing::info;
use zenoh::liveliness::LivelinessToken;
use zenoh::{Session, Wait};

use crate::access::{bridge_config, setpoint_key};
use crate::network_file::NetworkFile;
use crate::requests::Served;
use crate::setpoints::{Arrival, Setpoints, decode};
use crate::telemetry::Telemetry;
use crate::{motions, requests};

/// Longest pass of the loop.
const PERIOD: Duration = Duration::from_millis(1);

/// Setpoints that are kept until they are read: as many as arrive in one pass of the loop.
const BUFFER: usize = 64;

/// Bridge of one machine.
pub struct Bridge<'a> {
    config: &'a Config,
    setpoints: Setpoints<'a>,
    arrivals: Receiver<Arrival>,
    telemetry: Telemetry,
    refusals: Receiver<Rejection>,
    rejections: RejectionLog,
    _served: Served,
    _token: LivelinessToken,
    session: Session,
}

impl<'a> Bridge<'a> {
    /// Joins the machine and listens. An error says what prevents it. `refusals` are those of the library.
    pub fn open(
        file: &NetworkFile,
        config: &'a Config,
        refusals: Receiver<Rejection>,
    ) -> Result<Self, String> {
        let bus = join(&file.name, config)?;
        let session = zenoh::open(bridge_config(file)?).wait().map_err(|error| format!("Zenoh: {error}"))?;
        Self::serve(file, config, &bus, session, refusals)
    }

    fn serve(
        file: &NetworkFile,
        config: &'a Config,
        bus: &Bus,
        session: Session,
        refusals: Receiver<Rejection>,
    ) -> Result<Self, String> {
        let telemetry = Telemetry::new(bus, &session, &config.name, &file.zenoh)?;
        let (send, arrivals) = sync_channel(BUFFER);
        let mut served = Served::new();
        for (name, client) in &file.zenoh.client {
            requests::serve(&session, &mut served, &config.name, name, client.allowed_requests()?)?;
            if client.motions {
                motions::serve(&session, &mut served, &config.name, name, client)?;
            }
            if client.setpoints {
                subscribe(&session, &config.name, name, send.clone())?;
            }
        }
        let token = session.liveliness().declare_token(format!("hexad/{}", config.name)).wait();
        Ok(Self {
            config,
            setpoints: Setpoints::new(SetpointRelay::new(config)),
            arrivals,
            telemetry,
            refusals,
            rejections: RejectionLog::default(),
            _served: served,
            _token: token.map_err(|error| error.to_string())?,
            session,
        })
    }

    /// Relays until a signal.
    pub fn run(mut self, stop: &Stop) {
        // Only this thread, which does little in each pass. A flood would keep threads of Zenoh busy, and if all real-time threads together
        // are, the kernel pauses them, the control loop with them.
        self.config.deployment.realtime.prepare_peer_thread();
        info!("the bridge is open");
        while !stop.is_requested() {
            self.relay();
            for refusal in self.refusals.try_iter().take(BUFFER) {
                self.rejections.add(&refusal, || "Zenoh".into());
            }
            self.telemetry.publish(monotonic_ns());
        }
        let _ = self.session.close().wait();
    }

    /// Relays the newest of the setpoints that have arrived, at the latest after a period.
    fn relay(&mut self) {
        let Self { setpoints, arrivals, rejections, .. } = self;
        let first = match arrivals.recv_timeout(PERIOD) {
            Ok(first) => Some(first),
            Err(RecvTimeoutError::Timeout) => None,
            // No client may send setpoints.
            Err(RecvTimeoutError::Disconnected) => {
                std::thread::sleep(PERIOD);
                None
            }
        };
        for arrival in first.into_iter().chain(arrivals.try_iter().take(BUFFER)) {
            if let Err(rejection) = setpoints.add(&arrival) {
                rejections.add(&rejection, || arrival.client.clone());
            }
        }
        if let Err(error) = setpoints.relay.publish(monotonic_ns()) {
            rejections.add(&Rejection::Port(error.to_string()), || self.config.name.clone());
        }
    }
}

/// Receives the setpoints of a client.
fn subscribe(
    session: &Session,
    machine: &str,
    client: &str,
    send: SyncSender<Arrival>,
) -> Result<(), String> {
    let name = client.to_owned();
    let take = move |sample: zenoh::sample::Sample| {
        let message = decode(sample.payload());
        // Those beyond the buffer are beyond any rate that is accepted.
        let _ = send.try_send(Arrival { client: name.clone(), arrival_ns: monotonic_ns(), message });
    };
    let subscriber = session.declare_subscriber(setpoint_key(machine, client)).callback(take).background();
    subscriber.wait().map_err(|error| error.to_string())
}
