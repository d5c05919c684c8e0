//! Bodies in MuJoCo whose parameters a seed draws, in the plant's place: the daemon records how it moves them, and
//! `hexad identify` finds from that what the machine file lacks.
//!
//! The machine file is up to 30 % off in masses, centres of mass, inertias and reflected mass, and in force scales by 5 %. Each drive has
//! viscous and Coulomb friction, a Stribeck part, load friction and a force scale. Lengths and rates are as the engine has them.
//!
//! MuJoCo integrates as the exported model says: implicit steps of 0.1 ms, ten in a period. Its forces then differ from inverse
//! dynamics by 6e-5 RMS (`in_the_loop`), less than a tenth of the bound of 1e-3. In semi-implicit steps a force acts half a step earlier: the
//! identification finds that as a delay of the drives of -0.05 ms.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{self, Command};

use hexad::config::Config;
use hexad::model::machine::{Link, Machine};
use hexad::model::random::Random;
use hexad::motion::built_in::BuiltInMotion;
use nalgebra::Vector3;
use serde_json::Value;
use toml::Table;

use super::stage::{Run, Stage, turn};
use super::{file, python};
use hexad_support::certificate::Certificate;
use hexad_support::edited::{deployed_table, set, table};
use hexad_support::identified::{drawn, loaded};
use hexad_support::process::Process;
use hexad_support::python::output;
use hexad_support::{Errors, largest};

const MACHINE: &str = "motion_base";
/// Known weight as a share of the platform, and its place \[m\].
const WEIGHT_RATIO: f64 = 0.15;
const WEIGHT_AT: [f64; 3] = [0.3, -0.2, 0.8];
/// Motion for the identification, and the one in its place in the short form.
const EXCITATION: &[&str] = &["excite", "--periods", "6"];
const SHORT_MOTION: &[&str] = &["move", "--motion", "sines", "--seconds", "4"];
/// Largest relative difference of a base parameter in numpy.
const NUMPY_DIFFERENCE: f64 = 1e-8;

/// A body and its machine file.
struct Trial {
    /// Machine that the file describes, and its configuration.
    file: Machine,
    table: Table,
    /// Machine file of the body, of the same with the known weight, and friction that MuJoCo gets beside it.
    truth: PathBuf,
    with_weight: PathBuf,
    friction: PathBuf,
    /// Folder of all this.
    folder: PathBuf,
}

/// A machine whose links differ, too.
fn drawn_with_links(file: &Machine, random: &mut Random) -> Machine {
    let mut machine = drawn(file, random);
    let mut off = || 1.0 + 0.3 * random.signed();
    machine.rod.mass_kg = file.rod.mass_kg;
    for link in [&mut machine.cylinder, &mut machine.rod] {
        link.mass_kg *= off();
        link.center_of_mass_m *= off();
        link.axial_inertia_kg_m2 *= off();
        link.transverse_inertia.constant_kg_m2 *= off();
    }
    machine
}

/// A configuration with the masses, inertias, friction and force scales of a machine.
fn written(table: &Table, machine: &Machine) -> Table {
    let mut table = table.clone();
    let platform = &machine.platform;
    set(&mut table, "platform", "mass_kg", platform.mass_kg);
    set(&mut table, "platform", "center_of_mass_m", Vec::from(<[f64; 3]>::from(platform.center_of_mass_m)));
    let i = &platform.inertia;
    let elements = [("xx", i.m11), ("yy", i.m22), ("zz", i.m33), ("xy", i.m12), ("xz", i.m13), ("yz", i.m23)];
    let inertia: Table = elements.into_iter().map(|(key, value)| (key.to_owned(), value.into())).collect();
    set(&mut table, "platform", "inertia_kg_m2", inertia);
    for (section, Link { mass_kg, center_of_mass_m, axial_inertia_kg_m2, transverse_inertia }) in
        [("cylinder", &machine.cylinder), ("rod", &machine.rod)]
    {
        assert_eq!(transverse_inertia.quadratic_kg, 0.0, "a number in the file");
        set(&mut table, section, "mass_kg", *mass_kg);
        set(&mut table, section, "center_of_mass_m", *center_of_mass_m);
        set(&mut table, section, "axial_inertia_kg_m2", *axial_inertia_kg_m2);
        set(&mut table, section, "transverse_inertia_kg_m2", transverse_inertia.constant_kg_m2);
    }
    let actuator = &machine.actuator;
    set(&mut table, "actuator", "reflected_mass_kg", actuator.reflected_mass_kg);
    for (key, values) in [
        ("viscous_friction_n_s_m", actuator.viscous_friction_n_s_m),
        ("coulomb_friction_n", actuator.coulomb_friction_n),
        ("load_friction", actuator.load_friction_share),
        ("force_scale", actuator.force_scale),
    ] {
        set(&mut table, "actuator", key, Vec::from(values));
    }
    table
}

impl Trial {
    fn new(seed: u64) -> Self {
        let name = format!("identified-{}-{seed}", process::id());
        let folder = file(&name);
        // Of a failed process that had the same ID.
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let mut table = deployed_table(MACHINE);
        table.insert("name".into(), name.into());
        set(&mut table, "realtime", "release", "lockstep");
        set(&mut table, "limits", "payload_change_kg", f64::INFINITY);
        let machine = Config::parse(&table.to_string(), "the machine file").unwrap().machine;
        let mut random = Random::new(seed);
        let truth = drawn_with_links(&machine, &mut random);
        let with_weight = loaded(&truth, WEIGHT_RATIO * machine.platform.mass_kg, Vector3::from(WEIGHT_AT));
        let [truth_file, with_weight_file] = [("truth.toml", &truth), ("with_weight.toml", &with_weight)]
            .map(|(name, machine)| {
                let path = folder.join(name);
                fs::write(&path, written(&table, machine).to_string()).unwrap();
                path
            });
        let friction = folder.join("friction.csv");
        let mut rows = String::from("load_friction,stribeck_n,stribeck_speed_m_s\n");
        for (load, coulomb) in
            truth.actuator.load_friction_share.iter().zip(truth.actuator.coulomb_friction_n)
        {
            let [excess, speed] = [0.3, 0.008].map(|mean| mean * (1.0 + 0.25 * random.signed()));
            writeln!(rows, "{load},{},{speed}", excess * coulomb).unwrap();
        }
        fs::write(&friction, rows).unwrap();
        Self { file: machine, table, truth: truth_file, with_weight: with_weight_file, friction, folder }
    }

    /// A run of a daemon with this machine file on a body, recorded.
    fn played(
        &self,
        what: &str,
        machine_file: &str,
        body: &Path,
        source: impl FnOnce(&Stage) -> Process,
    ) -> Stage {
        let stage = Stage::of(self.folder.join(what), machine_file);
        let recording = stage.path("recording");
        let friction = ["--friction".as_ref(), self.friction.as_os_str()];
        stage.with_mujoco(body, &friction, &["--record".as_ref(), recording.as_os_str()], || source(&stage));
        stage
    }

    /// The motion for the identification.
    fn excited(&self, what: &str, body: &Path) -> Stage {
        let motion = if Certificate::is_long() { EXCITATION } else { SHORT_MOTION };
        self.played(what, &self.table.to_string(), body, |stage| stage.command(motion))
    }

    /// A motion that the identification does not use, by a daemon with this machine file.
    fn unused(&self, what: &str, machine_file: &str) -> (Stage, Run) {
        let seconds = if Certificate::is_long() { 10.0 } else { 2.5 };
        let source = |stage: &Stage| stage.source(&self.file, BuiltInMotion::Circle, seconds);
        let stage = self.played(what, machine_file, &self.truth, source);
        let run = stage.judge(&stage.periods());
        (stage, run)
    }

    /// What `hexad identify` prints; it writes a new machine file.
    fn identify(&self, empty: &Stage, with_weight: &Stage, unused: &Stage, new: &Path) -> Value {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
        command.arg("identify").args(recordings(empty)).arg("--loaded").args(recordings(with_weight));
        command.arg("--known-mass").arg(self.weight().to_string());
        command.arg("--at").arg(WEIGHT_AT.map(|x| format!("{x}m")).join(","));
        command.arg("--validate").args(recordings(unused)).arg("--output").arg(new).arg("--json");
        serde_json::from_str(&output(&mut command).unwrap()).unwrap()
    }

    /// Least squares in numpy, from the same recordings by other equations, finds the base parameters that `hexad identify` found
    /// before its prior.
    fn numpy_agrees(&self, report: &Value, empty: &Stage, with_weight: &Stage) {
        let [empty_csv, with_weight_csv] = [empty, with_weight].map(|stage| {
            let csv = stage.path("recording.csv");
            let mut command = Command::new(env!("CARGO_BIN_EXE_hexad"));
            output(command.arg("convert").args(recordings(stage)).arg("--csv").arg(&csv)).unwrap();
            csv
        });
        let mut command = python::command("least_squares.py");
        command.arg(empty.path("machine.toml")).args([empty_csv, with_weight_csv]);
        command.arg(self.weight().to_string()).arg(WEIGHT_AT.map(|x| x.to_string()).join(","));
        let delay_s = report["delay_us"].as_f64().map(|delay_us| 1e-6 * delay_us);
        command.arg(delay_s.unwrap_or(empty.config.deployment.drive.total_delay_s()).to_string());
        let found: Value = serde_json::from_str(&output(&mut command).unwrap()).unwrap();
        let theirs = numbers(found["base_parameters"].as_object().unwrap().clone().into_iter());
        let ours = report["base_parameters"].as_array().unwrap().iter();
        let ours = numbers(ours.map(|each| (each["name"].as_str().unwrap().into(), each["value"].clone())));
        assert!(theirs.keys().eq(ours.keys()) && found["equations"] == report["equations"]);
        assert_eq!(found["rank"], ours.len());
        let mut differences = Errors::default();
        theirs.values().zip(ours.values()).for_each(|(a, b)| differences.add((a - b) / b));
        let worst = differences.max;
        println!(
            "{} base parameters, condition {}: off by at most {worst:.1e} in numpy",
            ours.len(),
            found["condition"]
        );
        assert!(worst < NUMPY_DIFFERENCE, "{worst}");
    }

    /// The known weight \[kg\].
    fn weight(&self) -> f64 {
        WEIGHT_RATIO * self.file.platform.mass_kg
    }

    /// Machine file of the body, with the delay of its drives: none.
    fn exact(&self) -> String {
        let mut table = table(&self.truth);
        set(&mut table, "drive", "delay_us", 0.0);
        table.to_string()
    }
}

/// Base parameters by name.
fn numbers(pairs: impl Iterator<Item = (String, Value)>) -> BTreeMap<String, f64> {
    pairs.map(|(name, value)| (name, value.as_f64().unwrap())).collect()
}

/// Files of a recording.
fn recordings(stage: &Stage) -> Vec<PathBuf> {
    fs::read_dir(stage.path("recording")).unwrap().map(|entry| entry.unwrap().path()).collect()
}

/// A force that is not explained, RMS of the worst leg \[N\].
fn worst_rms(report: &Value, key: &str) -> f64 {
    largest(&report[key].as_array().unwrap().iter().map(|leg| leg[0].as_f64().unwrap()).collect::<Vec<_>>())
}

#[test]
fn certificate_bodies_in_mujoco_are_identified() {
    if python::is_lacking() {
        return;
    }
    let _turn = turn();
    let certificate = Certificate::new("identification in MuJoCo", 1, 6);
    let seed = certificate.seed();
    let (mut worst_prediction, mut worst_tracking) = (0.0_f64, 0.0_f64);
    for trial in 0..certificate.total() {
        let body = Trial::new(seed + trial);
        let empty = body.excited("empty", &body.truth);
        let with_weight = body.excited("loaded", &body.with_weight);
        let (unused, by_file) = body.unused("file", &body.table.to_string());
        let new = body.folder.join("new.toml");
        let report = body.identify(&empty, &with_weight, &unused, &new);

        let forces = unused.periods().into_iter().filter_map(|period| period.force);
        let peak = forces.map(|force| largest(&force)).fold(0.0, f64::max);
        let [before, after] = ["before", "after"].map(|key| worst_rms(&report, key));
        let (_, by_identified) = body.unused("identified", &fs::read_to_string(&new).unwrap());
        let (_, by_exact) = body.unused("exact", &body.exact());
        let [by_file, by_identified, by_exact] =
            [by_file, by_identified, by_exact].map(|run| run.position.rms());
        println!(
            "{trial}: predicts {before:.1} to {after:.2} N RMS of {peak:.0}; tracks {:.2} um, identified {:.2}, exact {:.2}",
            1e6 * by_file,
            1e6 * by_identified,
            1e6 * by_exact
        );
        assert!(after < 1e-3 * peak && before > 1e-2 * peak, "{trial}: {before} to {after} of {peak}");
        assert!(
            by_identified < 1.3 * by_exact && by_file > 2.0 * by_exact,
            "{trial}: {by_file} {by_identified} {by_exact}"
        );
        body.numpy_agrees(&report, &empty, &with_weight);
        worst_prediction = worst_prediction.max(after / peak);
        worst_tracking = worst_tracking.max(by_identified / by_exact);
        // Hundreds of megabytes of a long form.
        fs::remove_dir_all(&body.folder).unwrap();
        certificate.advance(1);
    }
    certificate.finish(format_args!(
        "force prediction {worst_prediction:.1e} of the peak, tracking {worst_tracking:.2} times the exact file's"
    ));
}
