//! `hexad jog`: moves the platform by keys on a terminal, one for each direction of each axis.
//!
//! Dead-man control: motion continues only while keys arrive, and while this process and its connection live. The
//! daemon moves a target and follows it within every limit.

use std::io::{self, IsTerminal};
use std::thread::sleep;
use std::time::{Duration, Instant};

use clap::Args;

use self::jog_pace::{JogPace, Pace};
use self::keys::{Key, last_key};
use self::screen::JogScreen;
use self::terminal::Terminal;
use super::arguments::{EngageOptions, MachineFile};
use super::failure::Failure;
use super::frame_options::{FrameOptions, UnitOptions};
use super::motion_client::{MotionClient, MotionError};
use hexad_client::operator::motion_fields::{GOTO, HOLD, JOG, RateFields, TargetFields};
use hexad_client::operator::protocol::{RequestLine, RequestResult};
use hexad_client::realtime::stop_request::Stop;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::files::print;

mod jog_pace;
mod keys;
mod screen;
mod terminal;

/// Time after a key at which motion ends unless another key arrives: twice the repetition interval of a slow
/// keyboard.
const KEY_TIMEOUT: Duration = Duration::from_millis(200);

/// Interval between two requests: many fit into the time after which the daemon ends a motion.
const REQUEST_INTERVAL: Duration = Duration::from_millis(40);

/// Interval between two screens, short enough for a reader.
const SCREEN_INTERVAL: Duration = Duration::from_millis(100);

#[derive(Debug, Args)]
pub struct JogArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    frames: FrameOptions,
    #[command(flatten)]
    units: UnitOptions,
    #[command(flatten)]
    engage: EngageOptions,
}

impl JogArguments {
    pub fn execute(self) -> Result<(), Failure> {
        if !(io::stdin().is_terminal() && io::stdout().is_terminal()) {
            return Err(Failure::before_start(
                "jog reads keys: standard input and output must be a terminal",
            ));
        }
        let (config, stop) = (self.machine.load()?, Stop::on_signals()?);
        let coordinates = self.frames.coordinates(&config)?;
        let mut client = MotionClient::connect(&config.name, &stop)?;
        client.carry_out(self.engage.line(HOLD), |_| Ok(()))?;
        let [tool, work] = self.frames.fields(&config)?;
        let line = RequestLine { tool, work, ..RequestLine::new("") };
        jog(&mut client, &line, JogPace::new(&config, self.units.units()), &coordinates, &stop)?;
        Ok(print("the platform stands under control; hexad stop or park ends it\n")?)
    }
}

/// Sends requests by keys, until `q`, Esc or a signal. `frames` is a line with the frames.
fn jog(
    client: &mut MotionClient,
    frames: &RequestLine,
    mut pace: JogPace,
    coordinates: &Coordinates,
    stop: &Stop,
) -> Result<(), Failure> {
    let terminal = Terminal::open().map_err(Failure::before_start)?;
    let (mut held, mut is_jogging): (Option<(Key, Instant)>, bool) = (None, false);
    let (mut bound, mut drawn) = (String::new(), None::<Instant>);
    while !stop.is_requested() {
        let key = last_key(&terminal.bytes());
        if let Some(key) = key {
            held = None;
            pace.press(key);
            match (key, pace.pace()) {
                (Key::Leave, _) => break,
                (Key::Mode, _) => is_jogging = false,
                (Key::Move { .. }, Pace::Continuous(_)) => {
                    (held, is_jogging) = (Some((key, Instant::now())), true)
                }
                (Key::Move { axis, sign }, step) => {
                    let target = step.along(axis, sign).map(|step| Some(step).filter(|step| *step != 0.0));
                    let target = Some(TargetFields::new(target));
                    bound = moved(client, RequestLine { target, relative: true, ..named(frames, GOTO) })?;
                }
                _ => {}
            }
        }
        held = held.filter(|(_, at)| at.elapsed() < KEY_TIMEOUT);
        if is_jogging {
            let rates = match held {
                Some((Key::Move { axis, sign }, _)) => pace.pace().along(axis, sign),
                _ => [0.0; 6],
            };
            let rate = Some(RateFields::new(rates));
            bound = moved(client, RequestLine { rate, ..named(frames, JOG) })?;
        }
        if drawn.is_none_or(|drawn| drawn.elapsed() > SCREEN_INTERVAL) {
            let (answer, held) = (client.status_under_control()?, held.map(|(key, _)| key));
            let screen = JogScreen { answer: &answer, pace: &pace, bound: &bound, coordinates, held };
            terminal.draw(&screen.to_string());
            drawn = Some(Instant::now());
        }
        sleep(REQUEST_INTERVAL);
    }
    Ok(())
}

fn named(frames: &RequestLine, request: &str) -> RequestLine {
    RequestLine { request: request.into(), ..frames.clone() }
}

/// Sends a request of a motion. Returns the bound that ends it, if one does.
fn moved(client: &mut MotionClient, line: RequestLine) -> Result<String, MotionError> {
    let answer = client.ask(&line)?;
    match answer.result {
        RequestResult::Accepted if line.request == GOTO => Ok(String::new()),
        RequestResult::Accepted | RequestResult::Invalid => Ok(answer.text),
        _ => Err(MotionError::Failed(answer.text)),
    }
}
