//! What tests and benches share: the machines, tables of numbers, statistics of errors.

#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "a failed assertion is how a test speaks"
)]

pub mod browser;
pub mod certificate;
pub mod edited;
pub mod extremes;
pub mod fast;
pub mod hexad_process;
pub mod hosts;
pub mod identified;
pub mod libhexad;
pub mod limit_check;
pub mod not_run;
pub mod paper;
pub mod process;
pub mod python;
pub mod rig;
pub mod search;
pub mod shipped;
pub mod stability;
pub mod stalls;
pub mod true_motion;

use std::collections::BTreeMap;
use std::env;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use hexad::config::Config;
use hexad::model::LEGS;
use hexad::model::machine::{Joints, Machine};
use hexad::model::rigid::Motion;
use hexad::model::task::TaskState;
use nalgebra::{Matrix3, Vector3, Vector6};

/// The machines with vectors in `tests/data`.
pub const MACHINES: [&str; 10] = [
    "ceiling",
    "fried2008",
    "gimbal",
    "motion_base",
    "scattered",
    "sideways_x_up",
    "tabletop",
    "telescope",
    "tilted",
    "tsai2000",
];

/// Where the sources are.
pub fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap()
}

/// Where the programs of this test's profile are: one of them is `hexad`.
pub fn programs() -> PathBuf {
    env::current_exe().unwrap().ancestors().nth(2).unwrap().into()
}

/// A folder for files of tests that are kept, beside the programs.
pub fn kept_files() -> PathBuf {
    programs().parent().unwrap().join("tmp")
}

/// `tests/data/NAME.EXTENSION`.
pub fn data(name: &str, extension: &str) -> PathBuf {
    repository().join("tests/data").join(name).with_extension(extension)
}

/// Values that take long to make, by what they are made from.
pub type Remembered<T> = Mutex<BTreeMap<String, T>>;

/// Makes a value once.
pub fn remembered<T: Clone>(known: &Remembered<T>, key: &str, make: impl FnOnce() -> T) -> T {
    if let Some(value) = known.lock().unwrap().get(key) {
        return value.clone();
    }
    let value = make();
    known.lock().unwrap().insert(key.into(), value.clone());
    value
}

/// One of [`MACHINES`].
pub fn machine(name: &str) -> Machine {
    static KNOWN: Remembered<Machine> = Mutex::new(BTreeMap::new());
    let load = || Config::load(&data(name, "toml")).unwrap_or_else(|error| panic!("{error}")).machine;
    remembered(&KNOWN, name, load)
}

/// The motions of a machine's vectors.
pub fn motions(name: &str) -> Vec<Motion> {
    states(name).iter().map(TaskState::motion).collect()
}

/// The same in task coordinates.
pub fn states(name: &str) -> Vec<TaskState> {
    let table = Table::read(&data(name, "csv"));
    let state = |row| TaskState {
        x: table.coordinates(row, ""),
        xd: table.coordinates(row, "_rate"),
        xdd: table.coordinates(row, "_accel"),
    };
    (0..table.rows.len()).map(state).collect()
}

/// A deployable machine of the folder `config`.
pub fn deployed(name: &str) -> Config {
    // The reference file has every section, so the key stands in a comment there.
    if name == "reference" {
        let path = repository().join("config/reference.toml");
        let text = std::fs::read_to_string(path).unwrap().replace("# delay_us = ", "delay_us = ");
        return Config::parse(&text, name).unwrap_or_else(|error| panic!("{error}"));
    }
    edited::configured(name, "[drive]\ndelay_us = 100")
}

/// The joints of a machine, leg by leg.
#[derive(Clone, Debug)]
pub struct Legs {
    /// `A_i`, base axes.
    pub base: [Vector3<f64>; LEGS],
    /// `CB_i`, platform axes.
    pub platform: [Vector3<f64>; LEGS],
    /// `u_i`, base axes.
    pub universal_axis: [Vector3<f64>; LEGS],
}

impl Legs {
    pub fn of(machine: &Machine) -> Self {
        let joints = &machine.joints;
        Self {
            base: joints.triples.unpack_vectors(&joints.base),
            platform: joints.triples.unpack_vectors(&joints.platform),
            universal_axis: joints.triples.unpack_vectors(&joints.universal_axis),
        }
    }

    /// `home` is the pose the joints are laid out for.
    pub fn joints(&self, home: &[f64; 6]) -> Joints {
        let home = TaskState::at_rest(*home).motion().pose;
        Joints::new(&self.base, &self.platform, &self.universal_axis, &home)
    }
}

/// Mean, root mean square and maximum of errors.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    count: f64,
    sum: f64,
    squares: f64,
    pub max: f64,
}

impl Errors {
    pub fn add(&mut self, error: f64) {
        assert!(error.is_finite(), "an error of {error}");
        self.count += 1.0;
        self.sum += error.abs();
        self.squares += error * error;
        self.max = self.max.max(error.abs());
    }

    pub fn mean(&self) -> f64 {
        self.sum / self.count
    }

    pub fn rms(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }

    /// A few rows may reach `bound`; the typical one stays well below.
    pub fn assert_within(&self, bound: f64, what: &str) {
        let (mean, rms, max) = (self.mean(), self.rms(), self.max);
        println!("{what}: mean {mean:.1e}, RMS {rms:.1e}, max {max:.1e}");
        assert!(self.count > 0.0, "{what}: nothing compared");
        assert!(max < bound && rms < 0.5 * bound && mean < 0.25 * bound, "{what}: {self:?} beyond {bound:e}");
    }
}

/// The largest magnitude among these.
pub fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| f64::max(largest, value.abs()))
}

/// R of Bryan angles, multiplied out by hand.
pub fn rotation(alpha: f64, beta: f64, gamma: f64) -> Matrix3<f64> {
    let ((sa, ca), (sb, cb), (sg, cg)) = (alpha.sin_cos(), beta.sin_cos(), gamma.sin_cos());
    Matrix3::new(
        cb * cg,
        -cb * sg,
        sb,
        ca * sg + sa * sb * cg,
        ca * cg - sa * sb * sg,
        -sa * cb,
        sa * sg - ca * sb * cg,
        sa * cg + ca * sb * sg,
        ca * cb,
    )
}

/// omega of angle rates, with E multiplied out by hand.
pub fn angular_velocity(alpha: f64, beta: f64, rates: &Vector3<f64>) -> Vector3<f64> {
    let ((sa, ca), (sb, cb)) = (alpha.sin_cos(), beta.sin_cos());
    Vector3::new(rates.x + sb * rates.z, ca * rates.y - sa * cb * rates.z, sa * rates.y + ca * cb * rates.z)
}

/// Angle of the rotation from `a` to `b`; exact to rounding where it is small.
pub fn angle_between(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
    let r = b * a.transpose();
    let twice_sin = Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12).norm();
    twice_sin.atan2(r.trace() - 1.0)
}

/// A CSV file as it is written.
pub struct Table {
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap();
        assert!(text.ends_with('\n'), "{} ends within a line", path.display());
        let mut lines = text.lines().map(|line| line.split(',').map(String::from).collect::<Vec<_>>());
        let header = lines.next().unwrap();
        let rows: Vec<_> = lines.collect();
        assert!(rows.iter().all(|row| row.len() == header.len()), "{} is not a table", path.display());
        Self { header, rows }
    }

    pub fn number(&self, row: usize, column: &str) -> f64 {
        let index = self.header.iter().position(|name| name == column);
        self.rows[row][index.unwrap_or_else(|| panic!("no column {column}"))].parse().unwrap()
    }

    /// `stem_1 ... stem_6`.
    pub fn legs(&self, row: usize, stem: &str) -> [f64; 6] {
        core::array::from_fn(|i| self.number(row, &format!("{stem}_{}", i + 1)))
    }

    /// `alpha<suffix> ... z<suffix>`.
    pub fn coordinates(&self, row: usize, suffix: &str) -> Vector6<f64> {
        let names = ["alpha", "beta", "gamma", "x", "y", "z"];
        Vector6::from(names.map(|name| self.number(row, &format!("{name}{suffix}"))))
    }
}
