//! Motions with forces to compare with.
//!
//! `fast`: the states of `tests/data`, random over the workspace at the speeds and accelerations the
//! machine is made for; their forces were computed in fifty digits by a derivation of its own.
//! `slow`: the same poses at a twentieth of the speeds and a four-hundredth of the accelerations (the same
//! paths, in twenty times the time); the forces are those of the paper's dense form, which shares nothing
//! with the library and is right to 2e-15.
//! `peers`: the machine and the inputs of `benches/peers`; the forces are their long-double reference.

use std::path::Path;

use fearless_simd::Level;
use hexad::config::Config;
use hexad::model::LEGS;
use hexad::model::machine::Machine;
use hexad::model::rigid::Motion;
use hexad::model::task::TaskState;
use hexad::text::csv_table::{NumberTable, legs, six, trajectory_columns};

use super::Failure;
use super::methods::Forces;
use super::paper::{self, State};
use super::peers::Errors;
use hexad_support::data;

/// The machines whose scenes are evaluated.
const MACHINES: [&str; 3] = ["fried2008", "tsai2000", "motion_base"];

/// How much longer the slow scene takes.
const SLOWER: f64 = 20.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    Slow,
    Fast,
    Peers,
}

/// A machine, its motions and their forces.
pub struct Scene {
    pub name: String,
    pub pace: Pace,
    pub machine: Machine,
    pub motions: Vec<Motion>,
    pub reference: Vec<[f64; LEGS]>,
    /// The same for the dense form; empty for the peers.
    pub states: Vec<State>,
    pub paper_machine: Option<paper::Machine>,
}

impl Scene {
    /// A slow and a fast scene of each machine.
    pub fn of_machines() -> Result<Vec<Self>, Failure> {
        let mut scenes = vec![];
        for name in MACHINES {
            for pace in [Pace::Slow, Pace::Fast] {
                scenes.push(Self::of_machine(name, pace)?);
            }
        }
        Ok(scenes)
    }

    fn of_machine(name: &str, pace: Pace) -> Result<Self, Failure> {
        let machine = Config::load(&data(name, "toml"))?.machine;
        let paper_machine = paper::Machine::load(name);
        let mut columns = trajectory_columns();
        columns.extend(legs("force"));
        let table = NumberTable::read(&data(name, "csv"), None, &columns, &[])?;
        let slower = if pace == Pace::Slow { SLOWER } else { 1.0 };
        let (mut states, mut motions, mut reference) = (vec![], vec![], vec![]);
        for row in table.rows() {
            let (x, xd, xdd) = (six(row, 1), six(row, 7), six(row, 13));
            let state = State {
                x: x.into(),
                xd: xd.map(|rate| rate / slower).into(),
                xdd: xdd.map(|accel| accel / (slower * slower)).into(),
            };
            motions.push(TaskState { x: state.x, xd: state.xd, xdd: state.xdd }.motion());
            reference.push(match pace {
                Pace::Slow => paper::forces(&paper_machine, &state).into(),
                Pace::Fast | Pace::Peers => six(row, 19),
            });
            states.push(state);
        }
        let pace_name = if pace == Pace::Slow { "slow" } else { "fast" };
        let name = format!("{name}_{pace_name}");
        Ok(Self { name, pace, machine, motions, reference, states, paper_machine: Some(paper_machine) })
    }

    /// What the peers are timed on: their inputs as a CSV file.
    pub fn of_peers(inputs: &Path) -> Result<Self, Failure> {
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/machine.toml");
        let machine = Config::load(&config)?.machine;
        let mut columns: Vec<String> = vec![];
        for row in 1..=3 {
            columns.extend((1..=3).map(|column| format!("r{row}{column}")));
        }
        columns.extend(["x", "y", "z"].map(String::from));
        for stem in ["omega", "v", "omega_rate", "v_rate"] {
            columns.extend(["x", "y", "z"].map(|axis| format!("{stem}_{axis}")));
        }
        columns.extend(legs("force"));
        let table = NumberTable::read(inputs, None, &columns, &[])?;
        let mut motions = vec![];
        for row in table.rows() {
            let three = |at: usize| {
                let [x, y, z, ..] = six(row, at);
                nalgebra::Vector3::new(x, y, z)
            };
            let mut motion = TaskState::default().motion();
            motion.pose.rotation =
                nalgebra::Matrix3::from_columns(&[three(0), three(3), three(6)]).transpose();
            motion.pose.position = three(9);
            motion.twist.angular = three(12);
            motion.twist.linear = three(15);
            motion.acceleration.angular = three(18);
            motion.acceleration.linear = three(21);
            motions.push(motion);
        }
        let reference = table.rows().iter().map(|row| six(row, 24)).collect();
        let (name, pace) = ("peers".into(), Pace::Peers);
        Ok(Self { name, pace, machine, motions, reference, states: vec![], paper_machine: None })
    }

    /// The machine on an instruction set.
    pub fn machine_on(&self, level: Level) -> Machine {
        Machine { level, ..self.machine.clone() }
    }

    /// How far a method is from the reference.
    pub fn errors(&self, forces: impl Iterator<Item = Forces>) -> Errors {
        let (mut max, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
        for (reference, forces) in self.reference.iter().zip(forces) {
            let forces = forces.unwrap_or([f64::NAN; LEGS]);
            let largest = reference.iter().fold(0.0_f64, |largest, force| largest.max(force.abs()));
            for (force, reference) in forces.iter().zip(reference) {
                let error = (force - reference).abs() / largest;
                // A method without forces has no finite error; max() would pass over it.
                max = if error <= max { max } else { error };
                squares += error * error;
                count += 1.0;
            }
        }
        Errors { max, rms: f64::sqrt(squares / count) }
    }
}
