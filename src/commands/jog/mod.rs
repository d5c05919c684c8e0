//! `hexad jog`: moves the platform by keys on a terminal, one for each direction of each axis.
//!
//! Dead-man control: motion continues only while keys arrive. A key moves a target, and the daemon's
//! reference generator follows it within every limit. The target leads by at most the reference's stopping
//! distance.

use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use clap::Args;

use self::jog_target::JogTarget;
use self::keys::{Key, last_key};
use self::screen::JogScreen;
use self::terminal::Terminal;
use super::arguments::{MachineFile, duration};
use super::coordinates::{Coordinates, FrameOptions};
use super::failure::Failure;
use super::target::{TargetError, TargetSource, constants, pose_of};
use crate::output::files::print;
use crate::output::numbers::MotionDigits;
use crate::realtime::stop_request::Stop;

mod jog_target;
mod keys;
mod screen;
mod terminal;

/// Time after a key at which motion ends unless another key arrives: twice the repetition interval of a slow
/// keyboard.
const KEY_TIMEOUT: Duration = Duration::from_millis(200);

/// Interval between two screens, short enough for a reader.
const SCREEN_INTERVAL: Duration = Duration::from_millis(100);

/// Longest time for which a target moves in one cycle \[s\], so that it does not jump after a pause of this process.
const MAX_STEP_S: f64 = 0.02;

#[derive(Debug, Args)]
pub struct JogArguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    frames: FrameOptions,
    /// Take control, if the platform is not under control
    #[arg(long)]
    engage: bool,
    /// Longest to wait for control [s]
    #[arg(long, default_value_t = 30.0, value_parser = duration, allow_negative_numbers = true, requires = "engage")]
    within: f64,
}

impl JogArguments {
    pub fn execute(self) -> Result<(), Failure> {
        if !(io::stdin().is_terminal() && io::stdout().is_terminal()) {
            let message = "jog reads keys: standard input and output must be a terminal".into();
            return Err(Failure { exit_code: 2, message });
        }
        let (config, stop) = (self.machine.load()?, Stop::on_signals()?);
        let (constants, coordinates) = (constants(&config), self.frames.coordinates(&config)?);
        let within = self.engage.then(|| Duration::from_secs_f64(self.within));
        let mut source = TargetSource::open(&config, within, &stop)?;
        let digits = MotionDigits::new(config.resolution());
        let target = JogTarget::new(&constants, &coordinates, digits, source.resting_x(&constants)?);
        jog(&mut source, target, &coordinates, &stop)?;
        Ok(print("the platform stands under control; hexad stop or park ends it\n")?)
    }
}

/// Publishes a target moved by keys, until `q`, Esc or a signal.
fn jog(
    source: &mut TargetSource,
    mut target: JogTarget,
    coordinates: &Coordinates,
    stop: &Stop,
) -> Result<(), Failure> {
    let terminal = Terminal::open().map_err(|error| Failure { exit_code: 2, message: error.to_string() })?;
    let mut held: Option<(Key, Instant)> = None;
    let (mut moved, mut drawn) = (Instant::now(), None::<Instant>);
    while !stop.is_requested() {
        source.publish(target.x())?;
        let (reference, now) = (source.present_x()?, Instant::now());
        let key = last_key(&terminal.bytes());
        if key == Some(Key::Leave) {
            break;
        }
        if let Some(key) = key {
            held = target.press(key, &pose_of(&reference)).map(|key| (key, now));
        }
        held = held.filter(|(_, at)| at.elapsed() < KEY_TIMEOUT && source.active_since().is_some());
        let step_s = now.duration_since(core::mem::replace(&mut moved, now)).as_secs_f64().min(MAX_STEP_S);
        if let Some((Key::Move { axis, sign }, _)) = held {
            target.advance(axis, sign * step_s, &pose_of(&reference));
        }
        if drawn.is_none_or(|drawn| drawn.elapsed() > SCREEN_INTERVAL) {
            let answer = &source.status().newest.1;
            let held = held.map(|(key, _)| key);
            terminal.draw(&JogScreen { answer, target: &target, coordinates, held }.to_string());
            drawn = Some(now);
        }
    }
    if source.active_since().is_none() {
        return Err(TargetError::InterruptedEarly.into());
    }
    Ok(())
}
