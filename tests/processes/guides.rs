//! The commands of the guides for positioners and machine builders, as a user types them.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use crate::support::children::{HANG, Hexad, hexad};
use crate::support::machine::{Machine, patient};
use crate::support::trio::{start_daemon, start_plant};

const POSITIONER: &str = include_str!("../../docs/positioner.md");
pub const BUILDER: &str = include_str!("../../docs/machine_builder.md");

/// First block of a guide in a language.
fn block<'a>(guide: &'a str, language: &str) -> &'a str {
    let (_, rest) = guide.split_once(&format!("```{language}\n")).unwrap();
    rest.split_once("```").unwrap().0
}

/// Types the commands in the folder of the machine, with a shorter raster. That the host is too slow is the doctor's verdict on it.
pub fn type_commands(machine: &Machine, guide: &str) {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    for line in block(guide, "sh").lines() {
        let line = line.split('#').next().unwrap().trim();
        let line = line
            .replace("--config F", "--config machine.toml")
            .replace("raster.py 20", "raster.py 2")
            .replace("--seconds 5", "--seconds 1 --disturb");
        let is_doctor = line.starts_with("hexad doctor");
        let mut command = Command::new("sh");
        let program = format!("'{}'", hexad().get_program().display());
        let line = line
            .replacen("hexad", &program, 1)
            .replace("examples/", &format!("'{}'/examples/", root.display()));
        command.current_dir(machine.folder()).args(["-c", &line]);
        let ended = Hexad::spawn(machine, "guide", command).ends_within(2 * HANG);
        let is_verdict = is_doctor && ended.stderr.ends_with("is not possible on this host\n");
        assert!(ended.status.success() || is_verdict, "{line}: {}{}", ended.stdout, ended.stderr);
    }
}

#[test]
#[ignore = "second tier: takes long"]
#[apply(beside_others)]
fn a_positioner_turns_about_its_vertex_and_scans() {
    let machine = Machine::with("positioner", "");
    let text = include_str!("../data/mirror_stiction.toml");
    let text = text.replace("name = \"mirror_stiction\"", &format!("name = \"{}\"", machine.name));
    fs::write(&machine.file, patient(&format!("{text}\n{}", block(POSITIONER, "toml")))).unwrap();
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    type_commands(&machine, POSITIONER);
    let said = daemon.stops();
    assert!(!said.contains("fault") && said.matches("active:").count() == 1, "{said}");
    plant.stops();
}
