//! Many connections that send motions without pause: the loop is not disturbed, and a stop counts.

use std::time::Duration;

use serde_json::json;

use super::{Panel, finish, standing};
use crate::support::disturbance::python;
use crate::support::operator::does;
use crate::support::socket::{path_of, state};
use crate::support::trio::let_pass;

/// Lines without pause, valid and not, on twenty connections.
const FLOOD: &str = r#"
import json, random, socket, sys, threading, time
def line(request, **more):
    return json.dumps({"version": 1, "request": request, **more}).encode() + b"\n"
lines = [line("jog", rate={"z_m_s": 0.01}), line("goto", home=True, wait=True), line("hold", wait=True),
    line("goto", target={"x_m": 1e308}, relative=True), line("goto", target={"x_m": 0.001}, relative=True, tool=[0.0] * 6),
    b'{"version": 1, "request": "jog", "rate": {"x_m_s": NaN}}\n', b'{"version": 1, "request": "goto", "wiat": 1}\n']
def flood():
    while True:
        try:
            link = socket.socket(socket.AF_UNIX)
            link.connect(sys.argv[1])
            link.setblocking(False)
            for _ in range(random.randrange(1, 300)):
                try:
                    link.send(random.choice(lines))
                    link.recv(1 << 16)
                except BlockingIOError:
                    time.sleep(0.0005)
        except OSError:
            time.sleep(0.001)
for _ in range(20):
    threading.Thread(target=flood, daemon=True).start()
print("here", flush=True)
time.sleep(3600)
"#;

#[test]
#[apply(beside_others)]
fn a_flood_of_motions_disturbs_neither_the_loop_nor_a_stop() {
    let trio = standing("panel-flood", "");
    Panel::of(&trio).does("hold", &json!({"engage": true, "wait": true}), "done");
    let mut flood = python(&["/usr/bin/env"], FLOOD, &[path_of(&trio.daemon).as_os_str()]);
    let_pass(Duration::from_secs(2));
    assert_eq!(state(&trio.machine), "active");
    does(&trio.machine, "stop", &[], &["standby"]);
    let_pass(Duration::from_millis(300));
    assert_eq!(state(&trio.machine), "standby", "none of them takes control");
    flood.kill().expect("a signal");
    flood.wait().expect("its end");
    finish(trio);
}
