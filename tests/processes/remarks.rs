//! What a daemon remarks on its own when it starts, and how its log is filtered and written.

use std::fs;
use std::time::Duration;

use serde_json::Value;

use crate::support::children::{Hexad, hexad};
use crate::support::machine::Machine;
use crate::support::recorder::Recorder;
use crate::support::trio::{let_pass, start_daemon, start_plant};

/// Its loop is bold, and somebody may have started it without `hexad check`; it has chosen its model by itself; and the measured lengths
/// are also those of another pose: it has searched for some hundredths of a second.
#[test]
#[apply(beside_others)]
fn a_daemon_remarks_on_its_loop_its_model_and_its_first_pose() {
    let control = "[control]\nmode = \"feedforward_joint_pd\"\nposition_bandwidth_hz = 28.724\nposition_damping_ratio = 3.0\n\
                   disturbance_m_s2_per_sqrt_s = 500.0\nfidelity = \"auto\"\n";
    let bold = Machine::with("remarks", control);
    let (plant, daemon) = (start_plant(&bold), start_daemon(&bold));
    daemon.says(
        "WARN control.position_bandwidth_hz = 28.724: legs loop: with 2.10 periods of delay it is stable with",
    );
    daemon.says("fidelity: leaving out spin of the legs costs ");
    daemon.says("INFO no other permitted pose has the measured leg lengths: proved");
    daemon.stops();
    plant.stops();

    let machine = Machine::patient("remarks");
    let text = fs::read_to_string(&machine.file).expect("the machine file");
    // The platform of home turned about the horizontal axis to its base.
    let home = "pose = [0.0, 0.0, 0.0, 1.1,";
    assert!(text.contains(home));
    fs::write(&machine.file, text.replace(home, "pose = [1.43, 0.0, 0.0, 1.1,")).expect("a machine file");
    let (plant, daemon) = (start_plant(&machine), start_daemon(&machine));
    const POSE: &str = "WARN another pose has the measured leg lengths";
    daemon.says(POSE);
    let_pass(Duration::from_millis(500));
    let said = daemon.stops();
    let lines: Vec<_> = said.lines().filter(|line| line.contains(POSE)).collect();
    let words = "16.1 deg and 0.076 m away, across a singular pose: see that the platform is where it is taken to \
                 be, [1.430000, 0.000000, 0.000000, 1.100000, 0.000000, 0.000000], before you engage";
    assert!(lines.len() == 1 && lines[0].contains(words), "{said}");
    plant.stops();
}

#[test]
fn the_log_is_filtered_and_json_where_it_is_wanted() {
    let machine = Machine::with("logged", "[realtime]\nrate_hz = 100\n");
    let with = |variables: &[(&str, &str)], more: &[&str]| {
        let mut command = hexad();
        command.arg("plant").arg("--config").arg(&machine.file).args(more);
        command.envs(variables.iter().copied());
        let plant = Hexad::spawn(&machine, "plant", command);
        let recorder = Recorder::start(&machine.name);
        recorder.until("it measures", |recording| recording.measured.last().map(drop));
        plant.stops()
    };
    let json = with(&[], &["--log-format", "json"]);
    let lines: Vec<Value> = json.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    let has = |key: &str| lines.iter().all(|line| line[key].is_string());
    assert!(!lines.is_empty() && has("timestamp") && has("level") && has("message"), "{json}");
    assert_eq!(with(&[("HEXAD_LOG", "error")], &[]), "");
    assert_eq!(with(&[("RUST_LOG", "hexad=error,warn")], &[]), "");
    let both = with(&[("RUST_LOG", "off"), ("HEXAD_LOG", "info")], &[]);
    assert_ne!(both, "", "HEXAD_LOG counts before RUST_LOG");
    let wrong = with(&[("HEXAD_LOG", "hexad=loud")], &[]);
    assert!(wrong.contains("HEXAD_LOG = \"hexad=loud\" is ignored"), "{wrong}");
}
