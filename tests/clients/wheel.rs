//! The wheel: built from the sources, installed into a clean environment, where nothing but Python is.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use crate::file;
use hexad_support::libhexad::prefix;
use hexad_support::not_run::lacking;
use hexad_support::python::{environment, output};
use hexad_support::repository;

/// What builds it.
const BUILD_TOOLS: [&str; 1] = ["hatchling==1.27.0"];

/// What a program sees of the installed package.
const PROGRAM: &str = "
import pathlib, hexad
from hexad import library
print(pathlib.Path(hexad.__file__).with_name(library.NAME).exists(), hexad.monotonic_ns() > 0)
with hexad.Client('MACHINE', hexad.Role.DRIVER) as client:
    may_be_applied, force = client.latest_force(20_000_000)
    client.publish_measured(hexad.monotonic_ns(), hexad.Measured(length_m=(1, 2, 3, 4, 5, 6)))
    print(may_be_applied, force.header.sequence)
try:
    hexad.request('MACHINE', 'stop', within_s=1.0)
except hexad.HexadError as error:
    print(error.result.name, error)
";

#[test]
fn the_wheel_works_in_a_clean_environment() {
    let tools = match environment(&BUILD_TOOLS.map(String::from)) {
        Ok(tools) => tools,
        Err(why) => return lacking(&why),
    };
    let (built, clean) = (file("dist"), file("clean"));
    for folder in [&built, &clean] {
        let _ = fs::remove_dir_all(folder);
    }
    let package = repository().join("clients/python");
    let mut wheel = Command::new(tools.join("bin/python"));
    wheel.args(["-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps"]);
    wheel.env("HEXAD_LIBRARY", prefix().join("lib/libhexad.so.0"));
    output(wheel.args(["--no-build-isolation", "-w"]).arg(&built).arg(&package)).unwrap();
    let wheels: Vec<PathBuf> = fs::read_dir(&built).unwrap().map(|entry| entry.unwrap().path()).collect();
    let [wheel] = &wheels[..] else { panic!("{wheels:?}") };
    assert!(wheel.to_string_lossy().contains("-py3-none-linux_"), "{wheel:?}");

    output(Command::new("python3").args(["-m", "venv"]).arg(&clean)).unwrap();
    let python = clean.join("bin/python");
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-index"];
    output(Command::new(&python).args(install).arg(wheel)).unwrap();
    let name = format!("wheel-{}", std::process::id());
    let mut program = Command::new(&python);
    program.arg("-I").env_remove("PYTHONPATH").env_remove("LD_LIBRARY_PATH").current_dir(file(""));
    let printed = output(program.args(["-c", &PROGRAM.replace("MACHINE", &name)])).unwrap();
    assert_eq!(
        printed,
        format!(
            "True True\nFalse 0\nNO_DAEMON no daemon runs for {name}: none listens in /run/hexad or in a folder of a user\n"
        )
    );
}
