//! Log of the process: to the journal with fields if standard error is the journal, else as text, or as JSON.

use std::fs::metadata;
use std::io::IsTerminal;
use std::os::unix::fs::MetadataExt;
use std::sync::OnceLock;
use std::{env, io};

use clap::ValueEnum;
use tracing::{Level, Subscriber};
use tracing_journald::{Priority, PriorityMappings};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::format::debug_fn;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{Layer, Registry, fmt, registry};

/// Identifier of the journal's entries, independent of the program that started the process.
const IDENTIFIER: &str = "hexad";
/// Prefix of the names of the fields: `HEXAD_STATE`, `HEXAD_CODE`, `HEXAD_VALUE`, `HEXAD_BOUND`,
/// `HEXAD_CYCLE`.
const FIELD_PREFIX: &str = "HEXAD";

/// Fields that the text of a message already contains.
const FIELDS_IN_TEXT: [&str; 3] = ["state", "value", "bound"];

/// Environment variable of [`LogFormat`], which child processes inherit.
pub const FORMAT_VARIABLE: &str = "HEXAD_LOG_FORMAT";

/// Environment variables with the filter. The first that is set counts.
pub const FILTER_VARIABLES: [&str; 2] = ["HEXAD_LOG", "RUST_LOG"];

/// Format of the log on standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// Text; to the journal with fields where standard error is the journal.
    #[default]
    Text,
    /// A JSON object per line: `timestamp`, `level`, `message`, `target` and the fields.
    Json,
}

/// Format of this process.
static FORMAT: OnceLock<LogFormat> = OnceLock::new();

/// Installs the log of this process, with the filter of `HEXAD_LOG` or `RUST_LOG`, as `debug` or `info,hexad::daemon=debug`.
pub fn install(format: LogFormat) {
    let (filter, warning) = filter(Targets::new().with_default(LevelFilter::INFO));
    registry().with(filter).with(output_layer(format)).init();
    warn_of(warning);
}

/// The same beside a layer that receives the events of a library. The log leaves them out unless the filter is given.
pub fn install_beside(format: LogFormat, library: &str, layer: impl Layer<Registry> + Send + Sync) {
    let (filter, warning) =
        filter(Targets::new().with_default(LevelFilter::INFO).with_target(library, LevelFilter::OFF));
    registry().with(layer).with(output_layer(format).with_filter(filter)).init();
    warn_of(warning);
}

/// The filter that the environment gives, else the default; and the reason why the given one is ignored.
fn filter(default: Targets) -> (Targets, Option<String>) {
    let given = FILTER_VARIABLES.iter().find_map(|name| Some((name, env::var(name).ok()?)));
    let Some((name, text)) = given else { return (default, None) };
    let ignored = |error| {
        format!("{name} = {text:?} is ignored: {error}; must be a level, or as info,hexad::daemon=debug")
    };
    match text.parse::<Targets>() {
        Ok(filter) => (filter, None),
        Err(error) => (default, Some(ignored(error))),
    }
}

fn warn_of(filter: Option<String>) {
    if let Some(reason) = filter {
        tracing::warn!("{reason}");
    }
}

fn output_layer<S: Subscriber + for<'a> LookupSpan<'a>>(
    format: LogFormat,
) -> Box<dyn Layer<S> + Send + Sync> {
    let _ = FORMAT.set(format);
    let is_json = format == LogFormat::Json;
    let journal =
        (is_journal() && !is_json).then(tracing_journald::layer).and_then(Result::ok).map(|journal| {
            journal
                .with_syslog_identifier(IDENTIFIER.into())
                .with_field_prefix(Some(FIELD_PREFIX.into()))
                .with_priority_mappings(priorities())
        });
    // The journal adds its own time stamps.
    match journal {
        Some(journal) => Box::new(journal),
        None if is_json => Box::new(fmt::layer().json().flatten_event(true).with_writer(io::stderr)),
        None => Box::new(text_layer()),
    }
}

fn text_layer<S: Subscriber + for<'a> LookupSpan<'a>>() -> impl Layer<S> {
    fmt::layer().with_target(false).with_ansi(io::stderr().is_terminal()).with_writer(io::stderr).fmt_fields(
        debug_fn(|writer, field, value| match field.name() {
            "message" => write!(writer, "{value:?}"),
            name if FIELDS_IN_TEXT.contains(&name) => Ok(()),
            name => write!(writer, " {name}={value:?}"),
        }),
    )
}

/// Name of the format of this process, for its children.
pub fn format_name() -> &'static str {
    match FORMAT.get() {
        Some(LogFormat::Json) => "json",
        _ => "text",
    }
}

/// Logs the reason why the process ends.
pub fn report_failure(message: &str) {
    let is_structured = is_journal() || FORMAT.get() == Some(&LogFormat::Json);
    if is_structured && tracing::enabled!(Level::ERROR) {
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
