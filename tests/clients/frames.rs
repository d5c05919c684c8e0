//! Frames in C and Python against scipy and numpy.

use std::process::Command;

use hexad_support::libhexad::with_library;
use hexad_support::not_run::lacking;
use hexad_support::python::{environment, output};
use hexad_support::repository;

/// The reference.
pub const PACKAGES: [&str; 2] = ["numpy==2.3.5", "scipy==1.16.3"];

#[test]
fn frames_are_those_of_scipy() {
    match environment(&PACKAGES.map(String::from)) {
        Ok(python) => {
            let mut command = with_library(Command::new(python.join("bin/python")));
            println!("{}", output(command.arg(repository().join("tests/clients/frames.py"))).unwrap());
        }
        Err(why) => lacking(&why),
    }
}
