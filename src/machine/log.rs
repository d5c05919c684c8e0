//! Log of the process: to the journal with fields if standard error is the journal, else as text, or as JSON.
//! A thread of its own writes it, so that a log that blocks holds nobody.

use std::fs::metadata;
use std::io::{IsTerminal, Write};
use std::os::unix::fs::MetadataExt;
use std::sync::OnceLock;
use std::{env, io};

mod journal;
mod outlet;

use clap::ValueEnum;
use tracing::{Level, Subscriber};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::format::{Writer, debug_fn};
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{Layer, Registry, fmt, registry};

use self::outlet::Lines;
pub use self::outlet::Log;

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

/// Installs the log of this process, with the filter of `HEXAD_LOG` or `RUST_LOG`, as `debug` or `info,hexad_daemon=debug`.
pub fn install(format: LogFormat) -> Log {
    install_without(&[], format)
}

/// The same without the events of these libraries, unless the filter names them, or is `debug`.
pub fn install_without(libraries: &[&str], format: LogFormat) -> Log {
    let (filter, warning) = filter(libraries);
    registry().with(filter).with(output_layer(format)).init();
    warn_of(warning);
    Log
}

/// The same without the events of a library, beside a layer that receives them.
pub fn install_beside(format: LogFormat, library: &str, layer: impl Layer<Registry> + Send + Sync) -> Log {
    let (filter, warning) = filter(&[library]);
    registry().with(layer).with(output_layer(format).with_filter(filter)).init();
    warn_of(warning);
    Log
}

/// The filter that the environment gives, else the default; and the reason why the given one is ignored.
fn filter(libraries: &[&str]) -> (Targets, Option<String>) {
    let default = without(libraries, Targets::new().with_default(LevelFilter::INFO));
    let given = FILTER_VARIABLES.iter().find_map(|name| Some((name, env::var(name).ok()?)));
    let Some((name, text)) = given else { return (default, None) };
    let ignored = |error| {
        format!("{name} = {text:?} is ignored: {error}; must be a level, or as info,hexad_daemon=debug")
    };
    match text.parse::<Targets>() {
        Ok(filter) => (without(libraries, filter), None),
        Err(error) => (default, Some(ignored(error))),
    }
}

/// The filter without libraries that it does not name and of which it does not ask for `debug`.
fn without(libraries: &[&str], filter: Targets) -> Targets {
    let is_meant = |library: &str| {
        filter.would_enable(library, &Level::DEBUG)
            || filter.iter().any(|(name, _)| name.starts_with(library))
    };
    let left_out = libraries.iter().filter(|library| !is_meant(library));
    filter.clone().with_targets(left_out.map(|library| (*library, LevelFilter::OFF)))
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
    // The journal adds its own time stamps.
    if is_journal()
        && !is_json
        && let Ok(sink) = journal::connect()
    {
        outlet::start(Box::new(sink));
        return Box::new(journal::Journal);
    }
    outlet::start(Box::new(|line| io::stderr().write_all(line)));
    if is_json {
        Box::new(fmt::layer().json().flatten_event(true).with_writer(Lines))
    } else {
        Box::new(text_layer())
    }
}

fn text_layer<S: Subscriber + for<'a> LookupSpan<'a>>() -> impl Layer<S> {
    fmt::layer().with_target(false).with_ansi(io::stderr().is_terminal()).with_writer(Lines).fmt_fields(
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

/// The present time as lines of the log have it: UTC, ISO 8601.
pub fn utc_now() -> String {
    let mut text = String::new();
    // Writing to memory cannot fail.
    let _ = SystemTime.format_time(&mut Writer::new(&mut text));
    text
}

/// Logs the reason why the process ends, and waits until it is written, unless that takes long.
pub fn report_failure(message: &str) {
    let is_structured = is_journal() || FORMAT.get() == Some(&LogFormat::Json);
    if is_structured && tracing::enabled!(Level::ERROR) {
        tracing::error!("{message}");
    } else {
        outlet::put(format!("hexad: {message}\n").into_bytes());
    }
    drop(Log);
}

/// Whether standard error is the stream of the journal that systemd names by device and inode.
fn is_journal() -> bool {
    let named = env::var("JOURNAL_STREAM").unwrap_or_default();
    metadata("/proc/self/fd/2").is_ok_and(|found| named == format!("{}:{}", found.dev(), found.ino()))
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::thread::sleep;
    use std::time::Duration;

    use tracing::Level;

    use super::{outlet, report_failure, without};

    #[test]
    fn a_library_is_in_the_log_only_if_it_is_named_or_debug_is_asked_for() {
        for (filter, level) in [
            ("info", None),
            ("hexad_ros2=debug,warn", None),
            ("debug", Some(Level::DEBUG)),
            ("info,rustdds=warn", Some(Level::WARN)),
            ("info,rustdds::discovery=info", Some(Level::INFO)),
        ] {
            let filter = without(&["rustdds"], filter.parse().unwrap());
            assert!(filter.would_enable("hexad_ros2", &Level::WARN));
            let found = [Level::DEBUG, Level::INFO, Level::WARN, Level::ERROR];
            let found = found.into_iter().find(|level| filter.would_enable("rustdds::discovery", level));
            assert_eq!(found, level, "{filter}");
        }
    }

    #[test]
    fn the_reason_of_the_end_is_written_before_the_process_ends() {
        let (written, lines) = channel();
        outlet::start(Box::new(move |line| {
            sleep(Duration::from_millis(50));
            written.send(line.to_vec()).map_err(std::io::Error::other)
        }));
        report_failure("no machine");
        assert_eq!(lines.try_recv().as_deref(), Ok(&b"hexad: no machine\n"[..]));
    }
}
