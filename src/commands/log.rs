//! Log of the process: to the journal with fields where standard error is the journal, else as text.

use std::fs::metadata;
use std::io::IsTerminal;
use std::os::unix::fs::MetadataExt;
use std::{env, io};

use tracing::Level;
use tracing_journald::{Priority, PriorityMappings};
use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::fmt::format::debug_fn;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{fmt, registry};

/// Identifier of the journal's entries, whatever started the process.
const IDENTIFIER: &str = "hexad";
/// Beginning of the names of the fields: `HEXAD_STATE`, `HEXAD_CODE`, `HEXAD_VALUE`, `HEXAD_BOUND`, `HEXAD_CYCLE`.
const FIELD_PREFIX: &str = "HEXAD";

/// Fields that the text of a message contains in words.
const FIELDS_IN_TEXT: [&str; 3] = ["state", "value", "bound"];

/// Installs the log of this process, with the level of `HEXAD_LOG`.
pub fn install() {
    let level = env::var("HEXAD_LOG").ok().and_then(|level| level.parse().ok()).unwrap_or(LevelFilter::INFO);
    let journal = is_journal().then(tracing_journald::layer).and_then(Result::ok).map(|journal| {
        journal
            .with_syslog_identifier(IDENTIFIER.into())
            .with_field_prefix(Some(FIELD_PREFIX.into()))
            .with_priority_mappings(priorities())
    });
    // The journal stamps its entries itself.
    match journal {
        Some(journal) => registry().with(level).with(journal).init(),
        None => {
            let text = fmt::layer()
                .with_target(false)
                .with_ansi(io::stderr().is_terminal())
                .with_writer(io::stderr)
                .fmt_fields(debug_fn(|writer, field, value| match field.name() {
                    "message" => write!(writer, "{value:?}"),
                    name if FIELDS_IN_TEXT.contains(&name) => Ok(()),
                    name => write!(writer, " {name}={value:?}"),
                }));
            registry().with(level).with(text).init();
        }
    }
}

/// Reports why the process ends.
pub fn report_failure(message: &str) {
    if is_journal() && tracing::enabled!(Level::ERROR) {
        tracing::error!("{message}");
    } else {
        eprintln!("hexad: {message}");
    }
}

fn priorities() -> PriorityMappings {
    PriorityMappings {
        error: Priority::Error,
        warn: Priority::Warning,
        info: Priority::Informational,
        debug: Priority::Debug,
        trace: Priority::Debug,
    }
}

/// Whether standard error is the stream of the journal that systemd names by device and inode.
fn is_journal() -> bool {
    let named = env::var("JOURNAL_STREAM").unwrap_or_default();
    metadata("/proc/self/fd/2").is_ok_and(|found| named == format!("{}:{}", found.dev(), found.ino()))
}
