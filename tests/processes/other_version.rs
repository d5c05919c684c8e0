//! A participant with another version of iceoryx2, which a program gets that takes the newest from PyPI.

use std::io::BufReader;
use std::path::Path;
use std::process::{Child, Stdio};

use crate::support::disturbance::line_of;
use crate::support::host::Host;
use crate::support::machine::Machine;
use hexad_support::not_run::lacking;
use hexad_support::python::environment;

/// Takes part until its input ends: folder of the shared memory, topic. Says whether it could.
const PARTICIPANT: &str = r#"
import ctypes, sys
import iceoryx2 as iox2
folder, topic = sys.argv[1:]
config = iox2.config.default()
config.global_cfg.root_path = iox2.Path.new(folder + "/iceoryx2")
config.global_cfg.prefix = iox2.FileName.new(open(folder + "/prefix").read())
class Message(ctypes.Structure):
    _fields_ = [("bytes", ctypes.c_uint64 * 20)]
node = iox2.NodeBuilder.new().config(config).create(iox2.ServiceType.Ipc)
try:
    service = node.service_builder(iox2.ServiceName.new(topic)).publish_subscribe(Message).open_or_create()
    print("takes part", flush=True)
    sys.stdin.read()
except Exception as error:
    print(f"refused: {error!r}", flush=True)
"#;

fn participant(python: &Path, host: &Host) -> (Child, String) {
    let mut command = host.program(0, &[], python.join("bin/python"));
    let topic = format!("hexad/{}/measured", host.machine().name);
    command.args(["-c", PARTICIPANT, "/run/hexad-root", &topic]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("a Python");
    let said = line_of(&mut BufReader::new(child.stdout.take().expect("a pipe")));
    (child, said)
}

#[test]
#[ignore = "second tier: needs PyPI"]
#[apply(beside_others)]
fn a_participant_with_another_version_of_iceoryx2_is_named() {
    let python = match environment(&["iceoryx2==0.10.0".into()]) {
        Ok(python) => python,
        Err(why) => return lacking(&why),
    };
    // Shared memory of their own: what the other version leaves must not meet the other tests.
    let Some(host) = Host::start(Machine::patient("other-version")) else { return };
    let first = host.daemon(0, &[], None);
    let (mut refused, said) = participant(&python, &host);
    assert!(said.starts_with("refused: ") && said.contains("ServiceInCorruptedState"), "{said}");
    refused.wait().expect("its end");
    first.stops();

    let (mut other, said) = participant(&python, &host);
    assert_eq!(said, "takes part");
    let ended = host.run(0, &[], &["run", "/run/test/machine.toml"]);
    drop(other.stdin.take());
    other.wait().expect("its end");
    assert_eq!(ended.status.code(), Some(1), "{}", ended.stderr);
    let words =
        "another participant has another version of iceoryx2: every participant needs iceoryx2 0.9.3 exactly";
    assert!(ended.stderr.contains(words), "{}", ended.stderr);
}
