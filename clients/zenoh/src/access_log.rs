//! What Zenoh refuses, from the events of its library: connections, and messages that the access list does not permit.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};

use hexad_bridge::rejection::Rejection;
use tracing::field::{Field, Visit};
use tracing::{Event, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::Context;

/// Targets of all events of the library begin with this.
pub const LIBRARY: &str = "zenoh";

/// Target of the events of the access list. They are at the level `TRACE`.
const ACCESS_LIST: &str = "zenoh::net::routing::interceptor::access_control";

/// Decisions that the library makes when a key is declared, one for each kind of message, before any is sent.
const DECISIONS_OF_A_KEY: u32 = 9;

/// Reasons that wait for the log. Those beyond are not counted.
const MAX_WAITING: usize = 64;

/// Longest reason \[characters\]: a remote side chooses parts of it.
const MAX_CHARACTERS: usize = 300;

/// Sessions whose certificates are known by name.
const MAX_SESSIONS: usize = 64;

thread_local! {
    /// Decisions of a declared key that are still to come in this thread.
    static TO_COME: Cell<u32> = const { Cell::new(0) };
}

/// The events that [`AccessLog`] needs.
pub fn events() -> Targets {
    Targets::new().with_target(LIBRARY, LevelFilter::WARN).with_target(ACCESS_LIST, LevelFilter::TRACE)
}

/// Layer that collects refusals.
pub struct AccessLog {
    send: SyncSender<Rejection>,
    /// Names of certificates by session.
    names: Mutex<BTreeMap<String, String>>,
}

impl AccessLog {
    /// The layer, and the refusals that it collects.
    pub fn new() -> (Self, Receiver<Rejection>) {
        let (send, refusals) = sync_channel(MAX_WAITING);
        (Self { send, names: Mutex::default() }, refusals)
    }

    /// The refusal that an event of the access list describes.
    fn denied(&self, text: &str) -> Option<Rejection> {
        if text.contains("caching permissions") {
            TO_COME.set(DECISIONS_OF_A_KEY);
            return None;
        }
        if text.contains("did not match any configured ACL subject") {
            return Some(Rejection::UnnamedCertificate);
        }
        let subject = text.split_once(" on Interface(");
        if let Some((session, rest)) = subject {
            self.remember(session, rest);
        }
        // Decisions about what nobody has sent yet; used later, if at all.
        if subject.is_some() && TO_COME.get() > 0 {
            TO_COME.set(TO_COME.get() - 1);
            return None;
        }
        let (before, refused) = text.split_once(" is unauthorized to ")?;
        let session = before.trim_start_matches("Using cached result: ").split(' ').next()?;
        let names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        let name = names.get(session).map_or("a client", String::as_str);
        refused.contains("(ingress)").then(|| Rejection::Denied(format!("{name}: {refused}")))
    }

    fn remember(&self, session: &str, rest: &str) {
        let name = rest.split_once("CertCommonName(").and_then(|(_, name)| name.split_once(')'));
        let (Some((name, _)), mut names) = (name, self.names.lock().unwrap_or_else(PoisonError::into_inner))
        else {
            return;
        };
        if names.len() >= MAX_SESSIONS {
            names.pop_first();
        }
        names.insert(session.into(), name.into());
    }
}

impl<S: Subscriber> Layer<S> for AccessLog {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut text = Text::default();
        event.record(&mut text);
        let refusal = match event.metadata().target() {
            ACCESS_LIST => self.denied(&text.0),
            _ => Some(Rejection::Connection(text.0)),
        };
        // It is never waited for: the thread is one of the library.
        if let Some(refusal) = refusal {
            let _ = self.send.try_send(refusal);
        }
    }
}

/// Text of an event.
#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}").chars().take(MAX_CHARACTERS).collect();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Texts as version 1.10.2 of the library writes them.
    #[test]
    fn a_refusal_names_the_certificate_and_not_what_nobody_has_sent() {
        let (log, _) = AccessLog::new();
        let subject = "Interface(lo)+CertCommonName(eve)+Transport(Quic)+a1";
        assert_eq!(log.denied("ACL (ingress): caching permissions for `hexad/m/setpoint/studio` ..."), None);
        for action in ["Query", "Reply", "Put", "Delete", "S", "Q", "T", "L", "D"] {
            let text =
                format!("a1 on {subject} is unauthorized to {action} (ingress) on hexad/m/setpoint/studio");
            assert_eq!(log.denied(&text), None);
        }
        let denied = Some(Rejection::Denied("eve: Put (ingress) on hexad/m/setpoint/studio".into()));
        let refused = "is unauthorized to Put (ingress) on hexad/m/setpoint/studio";
        assert_eq!(log.denied(&format!("Using cached result: a1 {refused}")), denied);
        assert_eq!(log.denied(&format!("a1 on {subject} {refused}")), denied);
        assert_eq!(log.denied("Using cached result: a1 is authorized to Put (ingress) on hexad/m/x"), None);
        assert_eq!(log.denied("Using cached result: a1 is unauthorized to Put (egress) on hexad/m/x"), None);
    }
}
