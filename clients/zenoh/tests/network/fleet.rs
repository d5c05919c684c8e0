//! Many machines on one host, and an operator with their list.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::time::Instant;

use crate::{BRIDGE, Cell, machine_file, network_file};
use hexad_support::hosts::Host;

const DAEMONS: [&str; 10] = ["d0", "d1", "d2", "d3", "d4", "d5", "d6", "d7", "d8", "d9"];
const BRIDGES: [&str; 10] = ["b0", "b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8", "b9"];

/// What an operator's command prints, its errors, and whether it has succeeded.
fn operate(cell: &Cell, arguments: &str) -> (String, String, bool) {
    let began = Instant::now();
    let ended = cell.hosts.command(Host::Remote, Path::new(BRIDGE), arguments).output().unwrap();
    eprintln!("hexad-zenoh {arguments}: {:.0} ms", 1e3 * began.elapsed().as_secs_f64());
    let [out, errors] = [&ended.stdout, &ended.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    (out, errors, ended.status.success())
}

#[test]
fn an_operator_finds_and_stops_all_machines() {
    let Some(mut cell) = Cell::open("fleet") else { return };
    let mut fleet = String::from(
        "name = \"panel\"\nidentity = { ca = \"ca.pem\", certificate = \"panel.pem\", key = \"panel.key\" }\n[machine]\n",
    );
    let first = cell.hosts.machine();
    let names: Vec<_> = (0..DAEMONS.len()).map(|k| format!("{first}_{k}")).collect();
    for (k, name) in names.iter().enumerate() {
        let endpoint = format!("quic/10.77.1.1:{}?mixed_rel=1", 7450 + k);
        writeln!(fleet, "{name} = \"{endpoint}\"").unwrap();
        // Ten loops at 1 kHz are more than a small host has processors for.
        let slow = machine_file(name) + "\n[realtime]\nrate_hz = 100.0\n";
        fs::write(cell.hosts.path(&format!("{k}.toml")), slow).unwrap();
        fs::write(cell.hosts.path(&format!("{k}-network.toml")), network_file(name, &endpoint)).unwrap();
        cell.hosts.start(DAEMONS[k], cell.hosts.hexad(&format!("run --config {k}.toml")));
        let arguments = format!("run {k}-network.toml {k}.toml");
        cell.hosts.start(BRIDGES[k], cell.hosts.command(Host::Machine, Path::new(BRIDGE), &arguments));
    }
    for k in 0..names.len() {
        cell.hosts.wait_for(DAEMONS[k], "running name");
        cell.hosts.wait_for(BRIDGES[k], "the bridge is open");
    }
    fs::write(cell.hosts.path("fleet.toml"), fleet).unwrap();

    let (out, errors, is_success) = operate(&cell, "status fleet.toml");
    assert!(is_success && names.iter().all(|name| out.contains(name.as_str())), "{out}{errors}");
    eprintln!("{out}");
    let (out, errors, is_success) = operate(&cell, "stop fleet.toml --all");
    assert!(is_success && names.iter().all(|name| out.contains(&format!("{name}: "))), "{out}{errors}");
    // One that is not reached is named, and the others are stopped.
    cell.hosts.kill(BRIDGES[3]);
    let (out, errors, is_success) = operate(&cell, "estop fleet.toml --all");
    assert!(!is_success && out.matches(": fault").count() == 9, "{out}{errors}");
    assert!(errors.contains(&names[3]) && errors.contains("not confirmed by 1 of 10 machines"), "{errors}");
    let (out, errors, is_success) = operate(&cell, &format!("estop fleet.toml {}", names[0]));
    assert!(is_success && out == format!("{}: fault\n", names[0]), "{out}{errors}");
}
