//! `hexad excite`: plays its motion in lock-step.

use crate::support::children::{HANG, Hexad};
use crate::support::machine::Machine;

#[test]
#[apply(beside_others)]
fn an_excitation_ends_at_rest_without_a_fault() {
    let machine = Machine::with("excite", "[realtime]\nrelease = \"lockstep\"");
    let daemon = Hexad::start::<&str>(&machine, "run", &[]);
    let plant = Hexad::start::<&str>(&machine, "plant", &[]);
    let excite = Hexad::start(&machine, "excite", &["--periods", "1", "--engage"]);
    let stdout = excite.ends_within(2 * HANG).succeeds();
    for words in ["24 s, of them 1 x 10 s counted", "mass of platform and six rods", "Coulomb friction"] {
        assert!(stdout.contains(words), "{words}: {stdout}");
    }
    daemon.says("standby: setpoint source ended at rest");
    let log = daemon.stops();
    assert!(!log.contains("fault"), "{log}");
    plant.stops();
}
