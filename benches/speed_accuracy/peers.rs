//! The peers as child processes: other people's ways to the same forces, see `benches/peers`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::Failure;

/// Errors as a share of the largest force of the row.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    pub max: f64,
    pub rms: f64,
}

/// One way, and who runs it.
pub struct Peer {
    /// In tables and figures.
    pub name: &'static str,
    program: &'static str,
    /// Its name there.
    bench: &'static str,
    /// How many times faster hexad has to be, where that was promised.
    pub goal: Option<f64>,
}

/// From the fastest to the slowest.
pub const PEERS: [Peer; 8] = [
    Peer { name: "hand-lanes", program: "hand_vec", bench: "hand_soa_autovec+gauss6", goal: Some(1.9) },
    Peer { name: "hand-scalar", program: "hand_scalar", bench: "hand_eigen_scalar+gauss6", goal: Some(1.9) },
    Peer { name: "casadi-lu", program: "cas_bench", bench: "casadi_codegen_full_LU(fixed piv)", goal: None },
    Peer { name: "casadi-qr", program: "cas_bench", bench: "casadi_codegen_full_QR", goal: Some(3.5) },
    Peer {
        name: "pinocchio-typed",
        program: "pin",
        bench: "pin_typed_spatial(no visitor)",
        goal: Some(10.0),
    },
    Peer { name: "pinocchio-rnea", program: "pin", bench: "pin_rnea18_RUB+platformNE", goal: None },
    Peer { name: "mujoco-lean", program: "mj", bench: "mj_kin+comPos+comVel+rne+6x6", goal: Some(20.0) },
    Peer { name: "mujoco-inverse", program: "mj", bench: "mj_inverse(no constraint)+6x6", goal: None },
];

/// How to build them.
pub const BUILD: &str = "benches/peers/run.sh";

/// What a peer said of itself.
pub struct Report {
    pub throughput: f64,
    pub latency: f64,
    pub errors: Errors,
}

/// Where `run.sh` builds them.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("peers")
}

impl Peer {
    fn path(&self) -> PathBuf {
        folder().join(self.program)
    }

    pub fn is_built(&self) -> bool {
        self.path().exists()
    }

    /// Runs it once: medians of `repetitions` samples of `seconds`.
    pub fn run(&self, repetitions: usize, seconds: f64) -> Result<Report, Failure> {
        let mut command = Command::new(self.path());
        command.env("GS_CSV", "1").env("GS_ONLY", self.bench);
        command.env("GS_REPS", format!("{repetitions}")).env("GS_TARGET", format!("{seconds}"));
        let said = output(&mut command)?;
        let figures = said.lines().find_map(|line| line.strip_prefix("csv,")?.strip_prefix(self.bench));
        let figures = figures.unwrap_or_default().split(',').filter_map(|figure| figure.parse().ok());
        match figures.collect::<Vec<f64>>()[..] {
            [throughput, latency, max, rms] => {
                Ok(Report { throughput, latency, errors: Errors { max, rms } })
            }
            _ => {
                Err(format!("{} does not report {}; build it again: {BUILD}", self.program, self.bench)
                    .into())
            }
        }
    }
}

/// The peers' inputs and reference forces, in a file; `None` without the peer that knows them.
pub fn inputs() -> Result<Option<PathBuf>, Failure> {
    let program = folder().join("hand_scalar");
    if !program.exists() {
        return Ok(None);
    }
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("peers_inputs.csv");
    std::fs::write(&path, output(Command::new(program).env("GS_INPUTS", "1"))?)?;
    Ok(Some(path))
}

fn output(command: &mut Command) -> Result<String, Failure> {
    let output = command.stderr(Stdio::inherit()).output()?;
    if !output.status.success() {
        return Err(format!("{:?} failed: {}", command.get_program(), output.status).into());
    }
    Ok(String::from_utf8(output.stdout)?)
}
