//! `hexad excite`: plays its motion in lock-step, or writes it for `hexad move --trajectory`.

use std::path::Path;

use hexad::commands::r#move::trajectory::Trajectory;
use hexad::commands::orientation::OrientationFormat;
use hexad::config::Config;
use hexad::config::coordinates::Coordinates;

use crate::support::children::{HANG, Hexad, run};
use crate::support::machine::Machine;
use crate::support::turns;

#[test]
fn an_excitation_ends_at_rest_without_a_fault() {
    let _turn = turns::beside_others();
    let machine = Machine::with("excite", "[realtime]\nrelease = \"lockstep\"");
    let daemon = Hexad::start::<&str>(&machine, "run", &[]);
    let plant = Hexad::start::<&str>(&machine, "plant", &[]);
    let excite = Hexad::start(&machine, "excite", &["--periods", "1", "--engage"]);
    let ended = excite.ends_within(2 * HANG);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    for words in ["24 s, of them 1 x 10 s counted", "mass of platform and six rods", "Coulomb friction"] {
        assert!(ended.stdout.contains(words), "{words}: {}", ended.stdout);
    }
    daemon.says("standby: setpoint source ended at rest");
    let log = daemon.stops_on("TERM", HANG).stderr;
    assert!(!log.contains("fault"), "{log}");
    plant.stops_on("TERM", HANG);
}

#[test]
fn the_file_holds_the_motion_that_would_be_played() {
    let machine = Machine::patient("excite-file");
    let (file, config) = (machine.path("excitation.csv"), machine.file.to_str().unwrap());
    let to = file.to_str().unwrap();
    let ended = run(&machine, &["excite", config, "--periods", "2", "--amplitude", "0.3", "--output", to]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.stderr);
    let config = Config::load(Path::new(config)).unwrap();
    let excitation = Trajectory::excitation(&config, 2, 0.3, 0).unwrap();
    let read = Trajectory::from_file(&config, &Coordinates::default(), &file, None, OrientationFormat::OF_X)
        .unwrap();
    assert_eq!(read.duration(), excitation.duration());
    for k in 0..3400 {
        let t = 0.01 * f64::from(k) + 0.0037;
        let (a, b) = (read.at(t), excitation.at(t));
        assert!((a.x - b.x).amax() < 1e-10 && (a.xd - b.xd).amax() < 1e-8, "{t}: {a:?} {b:?}");
        assert!((a.xdd - b.xdd).amax() < 1e-6, "{t}: {a:?} {b:?}");
    }
}
