//! Events as entries of the systemd journal, with their fields (systemd's "Native Journal Protocol": one datagram an entry).

use core::fmt::{Debug, Write};
use std::io;
use std::os::unix::net::UnixDatagram;

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

use super::outlet;

const SOCKET: &str = "/run/systemd/journal/socket";

/// Identifier of the entries, independent of the program that started the process.
const IDENTIFIER: &str = "hexad";

/// Connects to the journal. The result writes an entry.
pub fn connect() -> io::Result<impl FnMut(&[u8]) -> io::Result<()> + Send> {
    let socket = UnixDatagram::unbound()?;
    socket.connect(SOCKET)?;
    Ok(move |entry: &[u8]| socket.send(entry).map(drop))
}

/// Layer that passes on each event: `MESSAGE`, `PRIORITY`, and each field of the event as `HEXAD_STATE`, `HEXAD_CODE`, `HEXAD_CYCLE`.
pub struct Journal;

impl<S: Subscriber> Layer<S> for Journal {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        let mut entry = Entry(vec![]);
        entry.add("PRIORITY", priority(*metadata.level()));
        entry.add("SYSLOG_IDENTIFIER", IDENTIFIER);
        entry.add("TARGET", metadata.target());
        event.record(&mut entry);
        outlet::put(entry.0);
    }
}

/// Priority of syslog.
fn priority(level: Level) -> &'static str {
    match level {
        Level::ERROR => "3",
        Level::WARN => "4",
        Level::INFO => "6",
        _ => "7",
    }
}

struct Entry(Vec<u8>);

impl Entry {
    fn add(&mut self, name: &str, value: &str) {
        self.0.extend(name.bytes());
        // A value of several lines has its length in front.
        if value.contains('\n') {
            self.0.push(b'\n');
            self.0.extend((value.len() as u64).to_le_bytes());
        } else {
            self.0.push(b'=');
        }
        self.0.extend(value.bytes());
        self.0.push(b'\n');
    }
}

impl Visit for Entry {
    fn record_str(&mut self, field: &Field, value: &str) {
        match field.name() {
            "message" => self.add("MESSAGE", value),
            name => self.add(&format!("HEXAD_{}", name.to_uppercase()), value),
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let mut text = String::new();
        // Fails only if the value's own format does.
        let _ = write!(text, "{value:?}");
        self.record_str(field, &text);
    }
}
