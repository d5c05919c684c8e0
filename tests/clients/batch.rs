//! Forces of many motions in C and Python.

use std::fs;
use std::process::Command;

use hexad::config::Config;
use hexad::model::active_forces::InverseDynamics;
use hexad::model::fidelity::Fidelity;
use hexad::model::task::TaskState;

use crate::file;
use hexad_support::libhexad::with_library;
use hexad_support::not_run::lacking;
use hexad_support::python::{environment, output};
use hexad_support::repository;

use super::frames::PACKAGES;

/// The lines of `batch.c` after those with forces; 1 before the reasons of `hexad_open_machine`.
const OUTCOMES: &str = "0 ok
3 the machine is NULL
3 fidelity = \"best\" must be one of gravity, massless-legs, lumped-legs, no-velocity, rigid-legs, exact
3 fidelity is NULL
3 x is NULL
3 forces is NULL
3 forces must be another array than x: they overlap
3 x = ADDRESS must be a multiple of 8
3 count = 18446744073709551615 must be at most 192153584101141162
1 path is NULL
1 nowhere.toml: could not be read: No such file or directory (os error 2)
1 WRONG:LINE: platform.mass_kg = -3: must be greater than 0
0 0
";

#[test]
fn c_has_the_forces_of_rust_and_reasons() {
    let (program, wrong) = (file("batch"), file("batch_wrong.toml"));
    let right = repository().join("config/fried2008.toml");
    let text = fs::read_to_string(&right).unwrap();
    let mass = text.lines().find(|line| line.starts_with("mass_kg")).unwrap();
    fs::write(&wrong, text.replacen(mass, "mass_kg = -3", 1)).unwrap();
    let machine = Config::load(&right).unwrap().machine;

    let flags =
        output(with_library(Command::new("pkg-config")).args(["--cflags", "--libs", "hexad"])).unwrap();
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c11", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror", "-o"]);
    compiler.arg(&program).arg(repository().join("tests/clients/batch.c"));
    output(compiler.args(flags.split_whitespace()).arg("-lm")).unwrap();
    let mut run = with_library(Command::new(program));
    run.arg(right).arg(&wrong).args(machine.home.map(|number| number.to_string()));
    let printed = output(&mut run).unwrap();

    let [result, still, unreadable, rising, said @ ..] = &printed.lines().collect::<Vec<_>>()[..] else {
        panic!("{printed}")
    };
    assert_eq!((*result, *unreadable), ("0 ok", "nan nan nan nan nan nan"));
    let model = InverseDynamics::new(&machine);
    for (line, accel) in [(still, 0.0), (rising, 1.0)] {
        let mut state = TaskState::at_rest(machine.home);
        state.xdd[5] = accel;
        let wanted = model.forces_of(Fidelity::Exact, &state.motion()).unwrap();
        let found: Vec<f64> = line.split(' ').map(|number| number.parse().unwrap()).collect();
        assert_eq!(found.len(), wanted.len());
        let pairs = || found.iter().zip(wanted);
        assert!(pairs().all(|(a, b)| (a - b).abs() < 1e-14 * b.abs()), "{found:?} instead of {wanted:?}");
    }
    let line = 1 + text.lines().position(|line| line == mass).unwrap();
    let place = format!("{}:{line}", wrong.display());
    let address = said.iter().find_map(|line| line.strip_prefix("3 x = ")?.split(' ').next()).unwrap();
    let expected = OUTCOMES.replace("WRONG:LINE", &place).replace("ADDRESS", address);
    assert_eq!(said, expected.lines().collect::<Vec<_>>());
}

#[test]
fn python_has_forces_of_arrays_without_a_copy() {
    match environment(&PACKAGES.map(String::from)) {
        Ok(python) => {
            let mut command = with_library(Command::new(python.join("bin/python")));
            command.arg(repository().join("tests/clients/batch.py")).arg(repository().join("tests/data"));
            println!("{}", output(&mut command).unwrap());
        }
        Err(why) => lacking(&why),
    }
}
