//! Reload: a running daemon reads its machine file again and uses the new control law, limits and timeouts.
//!
//! The reload thread reads the file, examines it as at the start, and offers the new constants to the
//! real-time thread. That thread accepts them in a cycle without control ([`handover`]). Either the whole
//! file is accepted, or nothing. A change that needs a restart is refused, with the name of its key.

use core::time::Duration;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender};
use std::time::SystemTime;

use heapless::spsc::Producer;
use sha1_smol::Sha1;
use tracing::{info, warn};

use self::handover::{Answer, Offer};
use self::io_parameters::IoParameters;
use super::parameters::{parameters, timing};
use hexad_client::messages::clock::monotonic_ns;
use hexad_client::realtime::cyclic::ReleaseMode;
use hexad_core::control::controller::Controller;
use hexad_core::control::signals::state::State;
use hexad_core::model::fidelity::Fidelity;
use hexad_machine::config::changes::{Change, changes};
use hexad_machine::config::{Config, ConfigError, fidelity};

pub mod handover;
pub mod io_parameters;

/// Longest wait for the real-time thread. After it, an offer is too old to be accepted.
const ANSWER_LIMIT: Duration = Duration::from_millis(1200);

/// A configuration and the values computed from it.
#[derive(Debug)]
pub struct Loaded {
    /// The configuration.
    pub config: Config,
    /// Result of its choice of fidelity.
    pub fidelity: Fidelity,
    /// Controller before its first cycle.
    pub controller: Controller,
    /// SHA-1 of the file, as `sha1sum` prints it.
    pub sha1: String,
    /// Unix time at which the file was read \[s\].
    pub loaded_unix_s: u64,
}

impl Loaded {
    /// Computes the other fields from an examined configuration.
    pub fn new(config: Config) -> Self {
        let fidelity = fidelity::fidelity(&config);
        let parameters = parameters(&config.machine, &config.deployment, fidelity);
        let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        Self {
            fidelity,
            controller: Controller::new(&config.machine, parameters),
            sha1: Sha1::from(&config.text).hexdigest(),
            loaded_unix_s: since_1970.map_or(0, |time| time.as_secs()),
            config,
        }
    }

    /// Parameters of the I/O thread.
    pub fn io_parameters(&self) -> IoParameters {
        (&self.config.deployment).into()
    }
}

/// Reason why a configuration was not accepted.
#[derive(Debug, thiserror::Error)]
pub enum ReloadError {
    /// The configuration did not come from a file.
    #[error("the configuration of this daemon is not from a file")]
    NoFile,
    /// The file cannot be read, or is not valid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Keys have changed that a running daemon cannot change.
    #[error("{}", .0.iter().map(|key| format!("{key}: needs a restart")).collect::<Vec<_>>().join("\n"))]
    NeedsRestart(Vec<String>),
    /// The platform is under control.
    #[error("not possible in state {}, in which the platform is under control; hexad stop or park first", .0.name())]
    UnderControl(State),
    /// No cycle has run.
    #[error("the control loop runs no cycle; nothing has changed")]
    NoCycle,
}

/// Origin of a request: the number of a connection, or `None` for a signal.
pub type Requester = Option<u64>;

/// Result of a request.
pub struct Reloaded {
    /// Origin of the request.
    pub requester: Requester,
    /// The new configuration in force; `None` if it has not changed.
    pub loaded: Option<Arc<Loaded>>,
    /// Changes or error, as text.
    pub outcome: Result<String, ReloadError>,
}

/// Links of the reload thread to the other threads.
pub struct ReloadLinks<'q, 'o> {
    /// Requests. The thread ends when all senders are dropped.
    pub requests: Receiver<Requester>,
    /// Results, to the control thread.
    pub results: Sender<Reloaded>,
    /// Offers, to the real-time thread.
    pub offers: Producer<'q, &'o mut Offer>,
    /// Answered offers, from the log thread.
    pub returned: Receiver<&'o mut Offer>,
}

/// Serves requests until all senders are dropped. `offer` is the one offer that circulates.
pub fn run<'o>(current: Arc<Loaded>, offer: &'o mut Offer, links: ReloadLinks<'_, 'o>) {
    let mut reloading = Reloading { current, offer: Some(offer), links };
    while let Ok(requester) = reloading.links.requests.recv() {
        let before = Arc::as_ptr(&reloading.current);
        let outcome = reloading.reload();
        match &outcome {
            Ok(text) => info!("reload: {text}"),
            Err(error) => warn!("reload was refused, nothing has changed: {error}"),
        }
        let is_new = before != Arc::as_ptr(&reloading.current);
        let loaded = is_new.then(|| reloading.current.clone());
        let _ = reloading.links.results.send(Reloaded { requester, loaded, outcome });
    }
}

struct Reloading<'q, 'o> {
    current: Arc<Loaded>,
    /// The offer; `None` while another thread has it.
    offer: Option<&'o mut Offer>,
    links: ReloadLinks<'q, 'o>,
}

impl Reloading<'_, '_> {
    fn reload(&mut self) -> Result<String, ReloadError> {
        self.receive(Duration::ZERO);
        let current = &self.current.config;
        let path = current.path.as_deref().ok_or(ReloadError::NoFile)?;
        let new = Config::load_again(path)?;
        let (place, changes) = (new.place.clone(), changes(&current.text, &new.text));
        refuse_restarts(current, &new, &changes)?;
        for warning in new.examine().into_result(&new)? {
            warn!(target: super::CONFIGURATION_LOG, "{warning}");
        }
        let cycle = self.offer(Loaded::new(new))?;
        let changed: Vec<_> = changes.iter().map(Change::to_string).collect();
        let changed = if changed.is_empty() {
            "nothing that the daemon reads has changed".into()
        } else {
            changed.join("; ")
        };
        Ok(format!("{place}, from cycle {cycle} on: {changed}"))
    }

    /// Offers a configuration to the real-time thread. Returns the first cycle with it.
    fn offer(&mut self, loaded: Loaded) -> Result<u64, ReloadError> {
        let offer = self.offer.take().ok_or(ReloadError::NoCycle)?;
        *offer = Offer { offered_ns: monotonic_ns(), ..Offer::new(Arc::new(loaded)) };
        if let Err(offer) = self.links.offers.enqueue(offer) {
            self.offer = Some(offer);
            return Err(ReloadError::NoCycle);
        }
        match self.receive(ANSWER_LIMIT) {
            Some(Answer::Taken(cycle)) => Ok(cycle),
            Some(Answer::Refused(state)) => Err(ReloadError::UnderControl(state)),
            Some(Answer::TooOld | Answer::None) | None => Err(ReloadError::NoCycle),
        }
    }

    /// Receives the offer back if another thread has it. Returns its answer.
    fn receive(&mut self, limit: Duration) -> Option<Answer> {
        if self.offer.is_some() {
            return None;
        }
        let offer = self.links.returned.recv_timeout(limit).ok()?;
        let answer = offer.answer;
        if let Answer::Taken(_) = answer {
            self.current = offer.loaded.clone();
        }
        self.offer = Some(offer);
        Some(answer)
    }
}

/// Refuses all changes that need a restart, in one error.
fn refuse_restarts(current: &Config, new: &Config, changes: &[Change]) -> Result<(), ReloadError> {
    let mut refused: Vec<_> =
        changes.iter().filter(|change| !change.is_reloadable()).map(Change::to_string).collect();
    let [now, then] = [current, new].map(|config| timing(&config.deployment));
    // With external release the loop itself waits for this timeout. The timeout may also follow from other
    // keys, such as the gains.
    if refused.is_empty()
        && now.timeout_ns != then.timeout_ns
        && current.deployment.realtime.release == ReleaseMode::External
    {
        let [now, then] = [now, then].map(|timing| timing.timeout_ns as f64 * 1e-6);
        refused
            .push(format!("timeouts.measured_ms: {now} -> {then}, which releases cycles without a message"));
    }
    if refused.is_empty() { Ok(()) } else { Err(ReloadError::NeedsRestart(refused)) }
}
