//! `hexad view`: the page of a recording, live, for browsers on this host.
//!
//! It subscribes to the topics as any client does and sends nothing to the daemon.

use std::sync::{Mutex, PoisonError};
use std::thread::sleep;
use std::time::Duration;

use clap::Args;

use self::live::Live;
use self::server::{Reply, Server};
use self::topics::Topics;
use super::arguments::MachineFile;
use super::failure::Failure;
use super::frame_options::FrameOptions;
use super::report::head;
use crate::output::page::{PageKind, page};
use hexad_client::operator::endpoint::{Endpoint, endpoints};
use hexad_client::operator::users::user_name;
use hexad_client::realtime::stop_request::Stop;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::files::{print, remark};

mod live;
mod server;
mod topics;

/// Interval between two polls of the topics. At 20 kHz they fill only by a fraction in it.
const POLL_INTERVAL: Duration = Duration::from_millis(3);

#[derive(Debug, Args)]
pub struct ViewArguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Port on 127.0.0.1 [default: any that is free]
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    #[command(flatten)]
    frames: FrameOptions,
}

impl ViewArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let (config, stop) = (self.machine.load()?, Stop::on_signals()?);
        let coordinates = self.frames.coordinates(&config)?;
        let mut topics = Topics::join(&config)?;
        check_user(&config.name)?;
        let live = Mutex::new(Live::new(&config, coordinates.clone()));
        let server = Server::start(self.port).map_err(|cause| {
            let port = self.port;
            Failure::before_start(format_args!(
                "cannot listen on 127.0.0.1:{port}: {cause}; choose another --port"
            ))
        })?;
        print(format_args!("{}\n", server.address()))?;
        remark("open this address in a browser on this host; Ctrl-C ends it");
        std::thread::scope(|scope| {
            for _ in 0..server::THREADS {
                scope.spawn(|| {
                    server.serve(&stop, |path, query| reply(&config, &coordinates, &live, path, query))
                });
            }
            while !stop.is_requested() {
                let cycles = topics.cycles();
                if !cycles.is_empty() {
                    let mut live = live.lock().unwrap_or_else(PoisonError::into_inner);
                    live.times = topics.statistics.total;
                    cycles.iter().for_each(|(cycle, status)| live.add(cycle, status));
                }
                sleep(POLL_INTERVAL);
            }
        });
        Ok(())
    }
}

/// An error if only daemons of other users run, because their topics cannot be joined: the page would stay empty.
fn check_user(machine: &str) -> Result<(), Failure> {
    let found = endpoints(Some(machine));
    let foreign = found.iter().find(|it| it.daemon.is_some() && !it.is_own());
    match foreign {
        Some(foreign) if !found.iter().any(Endpoint::is_own) => {
            let user = user_name(foreign.owner);
            Err(Failure::before_start(format_args!(
                "the daemon of {machine} runs as user {user}, whose topics only {user} can join: run hexad view as that user; \
                 hexad status needs no topics"
            )))
        }
        _ => Ok(()),
    }
}

/// Why the daemon sends nothing, as far as this process can find out.
fn cause_of_silence(config: &Config) -> String {
    let name = &config.name;
    let found: Vec<_> = endpoints(Some(name)).into_iter().filter(|it| it.daemon.is_some()).collect();
    let own = found.iter().find(|it| it.is_own()).and_then(|it| it.daemon.as_ref()).map(|it| it.process_id);
    match (own, found.first()) {
        (Some(process), _) if config.deployment.realtime.is_simulated() => format!(
            "simulated time stands still: the plant, the source of setpoints or the daemon (process {process}) is paused, or plant or source has ended"
        ),
        (Some(process), _) => {
            format!("the daemon (process {process}) sends nothing: it is starting, paused (SIGSTOP) or hangs")
        }
        (None, Some(other)) => {
            let user = user_name(other.owner);
            format!("a daemon of user {user} runs {name} now: run hexad view as {user}")
        }
        (None, None) => format!(
            "no daemon of {name} is found on this host: it has ended, was killed, or restarts; this page shows the next one by itself"
        ),
    }
}

/// Reply to a path and its query.
fn reply(
    config: &Config,
    coordinates: &Coordinates,
    live: &Mutex<Live>,
    path: &str,
    query: &[(&str, &str)],
) -> Option<Reply> {
    match path {
        "/" => {
            let title = format!("{}: live", config.name);
            Some(Reply {
                kind: "text/html; charset=utf-8",
                content: page(PageKind::Live, &title, "", &head::of_live(config, coordinates), &[]),
            })
        }
        "/data" => {
            let after = query.iter().find(|(key, _)| *key == "after");
            let after = after.and_then(|(_, number)| number.parse().ok()).unwrap_or(0);
            let content = live.lock().unwrap_or_else(PoisonError::into_inner).since(after);
            Some(Reply { kind: "application/json", content })
        }
        _ => None,
    }
}
