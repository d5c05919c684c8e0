//! `hexad status`: the state of a running daemon, once or repeatedly, or of all daemons on this host.

use std::io::{self, IsTerminal};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use clap::Args;
use console::Term;

use self::screen::Screen;
use super::arguments::OptionalMachineFile;
use super::failure::Failure;
use super::frame_options::{FrameOptions, UnitOptions};
use super::request::machine_name;
use hexad_client::operator::protocol::AnswerLine;
use hexad_client::operator::requests;
use hexad_client::realtime::stop_request::Stop;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::files::print;

mod hosted;
pub(super) mod screen;

/// Interval between two screens, short enough for a reader.
const INTERVAL: Duration = Duration::from_millis(200);

/// Escape sequence: to the first column of the first line.
const HOME: &str = "\x1b[H";
/// Escape sequences: clear the rest of a line, clear everything below.
const CLEAR_LINE: &str = "\x1b[K";
const CLEAR_BELOW: &str = "\x1b[J";

#[derive(Debug, Args)]
pub struct StatusArguments {
    #[command(flatten)]
    machine: OptionalMachineFile,
    /// Show it again and again, until Ctrl-C
    #[arg(long, requires = "OptionalMachineFile")]
    watch: bool,
    #[command(flatten)]
    frames: FrameOptions,
    #[command(flatten)]
    units: UnitOptions,
    /// Print the daemon's answer as JSON, one line for each; its coordinates describe the platform in the base frame
    #[arg(long, conflicts_with_all = ["tool", "work", "units"])]
    json: bool,
}

impl StatusArguments {
    pub fn execute(self) -> Result<(), Failure> {
        match self.machine.path() {
            Some(path) => self.show_machine(path),
            None if !self.frames.is_empty() => {
                Err(Failure::before_start("--tool, --work: name the machine file that has the frames"))
            }
            None if !self.units.is_empty() => {
                Err(Failure::before_start("--units: name the machine whose coordinates are to be shown"))
            }
            None => hosted::show(self.json),
        }
    }

    fn show_machine(&self, path: &Path) -> Result<(), Failure> {
        let machine = machine_name(path)?;
        // Without frames the machine may be named without its file.
        let coordinates = match self.frames.is_empty() {
            true => Coordinates::default(),
            false => self.frames.coordinates(&Config::load(path)?)?,
        };
        if !self.watch {
            return self.show(requests::status(&machine)?, &coordinates, false);
        }
        let stop = Stop::on_signals()?;
        let is_terminal = io::stdout().is_terminal();
        while !stop.is_requested() {
            match requests::status(&machine) {
                Ok(answer) => self.show(answer, &coordinates, is_terminal)?,
                // The daemon may be restarting.
                Err(error) if is_terminal && !self.json => {
                    print(format_args!("{HOME}hexad: {error}{CLEAR_LINE}\n{CLEAR_BELOW}"))?;
                }
                Err(error) => return Err(error.into()),
            }
            sleep(INTERVAL);
        }
        Ok(())
    }

    fn show(&self, mut answer: AnswerLine, coordinates: &Coordinates, in_place: bool) -> Result<(), Failure> {
        if self.json {
            return Ok(print(answer.to_line())?);
        }
        answer.status = answer.status.map(|report| Box::new(coordinates.report(&report)));
        let text = Screen(&answer, &coordinates.label, self.units.units()).to_string();
        if !in_place {
            return Ok(print(text)?);
        }
        // What is beyond the last line would scroll the first ones away.
        let rows = usize::from(Term::stdout().size().0);
        let (shown, more) = match text.lines().count() {
            count if count > rows => {
                (rows.saturating_sub(1), "... (more lines: hexad status without --watch)")
            }
            count => (count, ""),
        };
        let lines = text.lines().take(shown).chain(Some(more).filter(|it| !it.is_empty()));
        let lines: String = lines.map(|line| format!("{line}{CLEAR_LINE}\n")).collect();
        Ok(print(format_args!("{HOME}{}{CLEAR_BELOW}", lines.trim_end()))?)
    }
}
