//! `hexad identify`: parameters of a machine from recordings of its motions, and a new machine file with them.

use std::path::{Path, PathBuf};

use clap::Args;

use self::new_values::new_values;
use self::recordings::Recorded;
use self::report::{Delay, IdentificationReport, predicted};
use self::verdict::Verdict;
use super::failure::Failure;
use super::machine_file::{changed_margins, difference, edited, write_new};
use super::quantity::{length, list};
use hexad_core::model::machine::Machine;
use hexad_machine::analysis::drive_delay::{Estimate, RecordedStretch, drive_delay};
use hexad_machine::analysis::identification::{Load, Run, identify, samples};
use hexad_machine::config::Config;
use hexad_machine::text::files::{print, print_json, write_whole};

mod new_values;
mod page;
mod quantities;
mod recordings;
mod report;
mod verdict;

/// Largest double standard deviation of a delay that is shown, as a ratio of the delay and \[s\]. Half a millisecond more
/// or less hardly affects the loop.
const MAX_DELAY_RATIO: f64 = 0.1;
const MAX_DELAY_DEVIATION_S: f64 = 5e-4;
/// Standard deviation of the file's delay, as a ratio of it.
const FILE_DELAY_RATIO: f64 = 0.5;

#[derive(Debug, Args)]
pub struct IdentifyArguments {
    /// Recordings of motions under control, all with the same platform
    #[arg(value_name = "RECORDING", required_unless_present = "payload")]
    recordings: Vec<PathBuf>,
    /// Recordings with a known weight on the platform: they show the force scales
    #[arg(long, value_name = "RECORDING", num_args = 1.., requires_all = ["known_mass", "at", "recordings"])]
    loaded: Vec<PathBuf>,
    /// The known weight, a compact one [kg]
    #[arg(long, value_name = "KG", requires = "loaded")]
    known_mass: Option<f64>,
    /// Its centre of mass, in platform axes, with its units, as in 0,-20mm,0.1m
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true, requires = "loaded")]
    at: Option<[f64; 3]>,
    /// Recordings with a payload that is to be identified; without other recordings the machine is as its file says
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    payload: Vec<PathBuf>,
    /// Recordings of another motion, whose forces are predicted before and after
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    validate: Vec<PathBuf>,
    /// New machine file with the result; a payload is then a part of the platform
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write the new machine file also if the residuals show that the model does not hold, with a warning at its beginning
    #[arg(long, requires = "output")]
    force: bool,
    /// Page with charts: change of each parameter, forces and residuals with the file and with the result (HTML)
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Why nothing is identified.
fn too_little() -> Failure {
    Failure::after_start(
        "too little motion under control is recorded; record `hexad excite`, or 20 s or more of another motion of all legs",
    )
}

/// Why no file is written.
fn does_not_hold(path: &Path, verdict: &Verdict) -> Failure {
    let (cause, remedy) = verdict.first();
    Failure::after_start(format_args!(
        "{}: not written, because the model does not hold; most likely {cause}: {remedy}, and record again; --force writes the \
         file nevertheless",
        path.display()
    ))
}

impl IdentifyArguments {
    pub fn execute(self) -> Result<(), Failure> {
        let mut recorded = Recorded::default();
        // The machine file comes from the last recording, so recordings that only validate are read first.
        let [other, empty, loaded, payload] =
            [&self.validate, &self.recordings, &self.loaded, &self.payload].map(|paths| recorded.read(paths));
        let (other, empty, loaded, payload) = (other?, empty?, loaded?, payload?);
        let (config, text) = recorded.configuration.ok_or_else(too_little)?;
        let machine = &config.machine;
        let known = self.known_weight()?;
        let runs = |delay_s: f64| {
            [
                runs_of(&empty, Load::Empty, delay_s),
                runs_of(&loaded, known, delay_s),
                runs_of(&payload, Load::Payload, delay_s),
            ]
            .concat()
        };
        let holds_machine = self.recordings.is_empty();
        let identified = |runs: &[Run]| identify(machine, runs, holds_machine).ok_or_else(too_little);
        // The delay shows once masses and friction are about right, and these are exact once the delay is.
        let first = identified(&runs(config.deployment.drive.total_delay_s()))?;
        let mut delay = delay(&config, &first.machine, &empty);
        let runs = runs(delay.used_s);
        let mut found = identified(&runs)?;
        let examination = found.examine(&runs, delay.deviation_s).ok_or_else(too_little)?;
        delay.widen(examination.delay_deviation_s);
        let verdict = Verdict::new(&examination);
        let validation = runs_of(&other, Load::Empty, delay.used_s);
        let report = IdentificationReport::new(&config, &found, &runs, &validation, delay, verdict);
        match self.json {
            true => print_json(&report)?,
            false => print(&report)?,
        }
        if let Some(path) = &self.page {
            let machines = [machine, &found.machine];
            write_whole(path, page::text(&report, machines, &predicted(&runs, &validation)).as_bytes())?;
            if !self.json {
                print(format_args!("\npage with charts: {}\n", path.display()))?;
            }
        }
        let Some(path) = &self.output else { return Ok(()) };
        let mut new = edited(&text, &new_values(&text, &found, !self.payload.is_empty(), &delay))?;
        let verdict = &report.verdict;
        if !verdict.holds && !self.force {
            return Err(does_not_hold(path, verdict));
        }
        if !verdict.holds {
            new.insert_str(0, &verdict.comment());
        }
        let changed = Config::parse(&new, "the new machine file")?;
        write_new(path, &new)?;
        if !self.json {
            let (lines, margins) = (difference(&text, &new), changed_margins(&config, &changed).join("\n"));
            print(format_args!(
                "\n{lines}\nhexad check, before and after:\n\n{margins}\n\n{}: written\n",
                path.display()
            ))?;
        }
        Ok(())
    }

    fn known_weight(&self) -> Result<Load, Failure> {
        let (Some(mass_kg), Some(at_m)) = (self.known_mass, self.at) else { return Ok(Load::Empty) };
        if mass_kg > 0.0 && mass_kg.is_finite() {
            return Ok(Load::Known { mass_kg, at_m });
        }
        Err(Failure::after_start(format_args!("--known-mass = {mass_kg} kg: must be greater than 0")))
    }
}

/// A place: three numbers with commas between them.
fn place(text: &str) -> Result<[f64; 3], String> {
    list(text, [length; 3], "0,-20mm,0.1m")
}

fn runs_of(stretches: &[RecordedStretch], load: Load, delay_s: f64) -> Vec<Run> {
    stretches.iter().map(|stretch| Run { samples: samples(stretch, delay_s), load }).collect()
}

/// Delay of the drives: from the motion of a machine without load if that shows it, else of the file.
fn delay(config: &Config, machine: &Machine, stretches: &[RecordedStretch]) -> Delay {
    let mut stretches = stretches.to_vec();
    for sent in stretches.iter_mut().flat_map(|stretch| &mut stretch.sent) {
        sent.force_n.iter_mut().zip(machine.actuator.force_scale).for_each(|(force, scale)| *force *= scale);
    }
    let found = drive_delay(machine, &stretches);
    let shown = found.filter(|found| {
        let Estimate { delay_s, deviation_s } = found.mean;
        2.0 * deviation_s <= MAX_DELAY_DEVIATION_S.max(MAX_DELAY_RATIO * delay_s)
    });
    let used_s = shown.map_or(config.deployment.drive.total_delay_s(), |found| found.mean.delay_s);
    let deviation_s = shown.map_or(FILE_DELAY_RATIO * used_s, |found| found.mean.deviation_s);
    Delay {
        used_s,
        deviation_s,
        shown,
        lag_s: config.deployment.drive.lag_s,
        file_s: config.deployment.drive.delay_s,
    }
}
