//! The library as the linker and a wrong caller see it.

use std::fs;
use std::process::Command;

use crate::file;
use hexad_support::libhexad::{cargo, prefix, with_library};
use hexad_support::python::output;

/// Functions of the header.
fn declared_functions() -> Vec<String> {
    let header = fs::read_to_string(prefix().join("include/hexad.h")).unwrap();
    let word = |line: &str| {
        let (before, _) = line.split_once('(')?;
        let name = before.rsplit([' ', '*']).next()?;
        (!line.starts_with("//") && name.starts_with("hexad_")).then(|| name.to_owned())
    };
    let mut found: Vec<_> = header.lines().filter_map(word).collect();
    found.sort();
    found
}

#[test]
fn the_library_exports_the_functions_of_its_header_and_nothing_else() {
    let library = prefix().join("lib/libhexad.so.0");
    let symbols = output(Command::new("nm").args(["-D", "--defined-only"]).arg(&library)).unwrap();
    let mut exported: Vec<_> =
        symbols.lines().filter_map(|line| line.split(' ').next_back()).map(String::from).collect();
    exported.sort();
    assert_eq!(exported, declared_functions());
    assert!(exported.len() > 10, "{exported:?}");
    let dynamic = output(Command::new("readelf").arg("-d").arg(&library)).unwrap();
    assert!(dynamic.contains("Library soname: [libhexad.so.0]"), "{dynamic}");
}

#[test]
fn its_own_tests_pass() {
    let said = output(cargo("test").args(["--lib", "outcome::"])).unwrap();
    assert!(said.contains("1 passed"), "{said}");
}

/// Outcomes of wrong calls: number, and the text of the failure.
const WRONG_CALLS: &str = "
import ctypes, threading, hexad
from hexad.client import _LIBRARY as library, Result, Role
def show(number):
    print(Result(number).name, library.hexad_last_error().decode() if number >= 3 else '')
print(library.hexad_last_error().decode() == '')
for roles in (0, 8, 16, 17):
    print(library.hexad_open(b'NAME', roles), library.hexad_last_error().decode())
print(library.hexad_open(None, 1), library.hexad_last_error().decode())
print(library.hexad_open(b'\\xff', 1), library.hexad_last_error().decode())
measured, force = hexad.Measured(), hexad.Force()
show(library.hexad_publish_measured(None, 0, measured))
monitor = library.hexad_open(b'NAME', Role.MONITOR)
show(library.hexad_publish_measured(monitor, 0, measured))
show(library.hexad_latest_measured(monitor, measured))
show(library.hexad_close(monitor))
driver = library.hexad_open(b'NAME', Role.DRIVER)
show(library.hexad_latest_force(driver, 0, force))
show(library.hexad_latest_force(driver, 0, None))
show(library.hexad_publish_measured(driver, 0, None))
show(library.hexad_close(driver))
show(library.hexad_close(None))
source = library.hexad_open(b'NAME', Role.SOURCE)
show(library.hexad_request_in_cycle(source, 0, 99))
show(library.hexad_close(source))
show(library.hexad_request(b'NAME', 99, False, 1.0))
show(library.hexad_request(b'NAME', 1, False, -1.0))
show(library.hexad_request(b'NAME', 1, False, float('nan')))
show(library.hexad_request(b'NAME', 1, False, 1.0))
";

const OUTCOMES: &str = "True
None roles = 0 are not a sum of roles
None roles = 8 are not a sum of roles
None roles = 16 are not a sum of roles
None roles = 17 are not a sum of roles
None machine is NULL
None machine is not UTF-8
INVALID the client is NULL
INVALID the client was opened without HEXAD_DRIVER
NOTHING 
OK 
BRAKE 
INVALID force is NULL
INVALID measured is NULL
OK 
OK 
INVALID no request is 99
OK 
INVALID no request is 99
INVALID within_s = -1 s is not between 0 and 86400 s
INVALID within_s = NaN s is not between 0 and 86400 s
NO_DAEMON no daemon runs for NAME: none listens in /run/hexad or in a folder of a user
";

#[test]
fn a_wrong_call_fails_with_a_reason() {
    let name = format!("wrong-calls-{}", std::process::id());
    let script = file("wrong_calls.py");
    fs::write(&script, WRONG_CALLS.replace("NAME", &name)).unwrap();
    let mut command = with_library(Command::new("python3"));
    let found = output(command.arg(script)).unwrap();
    assert_eq!(found, OUTCOMES.replace("NAME", &name));
}

/// A child of fork has a copy of its parent's client, ends, and lets the parent go on.
const FORK: &str = "
import hexad, os
with hexad.Client('NAME', hexad.Role.DRIVER | hexad.Role.MONITOR) as client:
    measured = hexad.Measured()
    child = os.fork()
    if child == 0:
        try:
            client.publish_measured(1, measured)
        except hexad.HexadError as error:
            print(error)
        client.close()
        raise SystemExit
    os.waitpid(child, 0)
    client.publish_measured(2, measured)
    print(client.latest_measured().header.time_ns)
";

#[test]
fn a_child_of_fork_leaves_its_parents_ports_alone() {
    let name = format!("fork-{}", std::process::id());
    let script = file("fork.py");
    fs::write(&script, FORK.replace("NAME", &name)).unwrap();
    let said = output(with_library(Command::new("python3")).arg(script)).unwrap();
    let [refusal, received] = said.lines().collect::<Vec<_>>()[..] else { panic!("{said}") };
    assert!(refusal.starts_with("the client is that of process ") && received == "2", "{said}");
}
