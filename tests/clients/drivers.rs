//! The drivers of `examples/driver` in Rust, C, C++ and Python control the platform of their fake drives, built as a user
//! builds them from the installed library.

use std::fs;
use std::panic::{catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::process::{self, Command};
use std::sync::OnceLock;
use std::thread::{scope, sleep};
use std::time::Duration;

use hexad::messages::{Bus, MeasuredMessage};

use crate::{file, start_daemon};
use hexad_support::libhexad::{built, prefix, with_library};
use hexad_support::not_run::lacking;
use hexad_support::process::Process;
use hexad_support::python::output;
use hexad_support::repository;
use hexad_support::stalls::Watchdog;

/// What a run does not survive, half of the drivers' watchdog, and how often it is tried.
const HELD: Duration = Duration::from_millis(10);
const ATTEMPTS: u32 = 5;

/// Home of a leg, and the share of the source's 5 mm that is left when six legs rise together \[m\].
const HOME_LENGTH_M: f64 = 1.203_314_866;
const RISE_M: f64 = 0.004_570;

/// Timeouts that hardly a stall of the host reaches, but for the drivers' own.
const PATIENT: &str = "[timeouts]\nsetpoint_ms = 200.0\nmeasured_ms = 200.0\nallow_unstable_age = true";

const WARNINGS: &str = "-O2 -Wall -Wextra -Wpedantic -Wshadow -Werror";

/// A folder with the examples in C, as a user copies them.
fn copied(name: &str) -> PathBuf {
    let folder = file(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    for entry in fs::read_dir(repository().join("examples/driver")).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, folder.join(path.file_name().unwrap())).unwrap();
    }
    folder
}

/// Both examples, by the Makefile with a compiler.
fn made(compiler: &str) -> PathBuf {
    let folder = copied(&format!("make-{compiler}"));
    let mut make = with_library(Command::new("make"));
    let compiler = format!("CC={compiler}");
    output(make.current_dir(&folder).args([&compiler, &format!("CFLAGS={WARNINGS}")])).unwrap();
    folder
}

/// Both examples by the usual compiler.
fn made_by_cc() -> &'static Path {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    MADE.get_or_init(|| made("cc"))
}

/// Both examples as C++.
fn made_as_cpp() -> PathBuf {
    let folder = copied("cpp");
    let flags =
        output(with_library(Command::new("pkg-config")).args(["--cflags", "--libs", "hexad"])).unwrap();
    for name in ["driver", "setpoint_source"] {
        let mut compiler = Command::new("c++");
        compiler.current_dir(&folder).args(["-x", "c++", "-std=c++11"]).args(WARNINGS.split(' '));
        output(compiler.args(["-o", name, &format!("{name}.c")]).args(flags.split_whitespace())).unwrap();
    }
    folder
}

fn is_installed(tool: &str) -> bool {
    let found = Command::new(tool).arg("--version").output().is_ok();
    if !found {
        lacking(&format!("{tool}; apt-get install {tool}"));
    }
    found
}

#[test]
fn the_examples_build_with_clang_and_cmake() {
    if is_installed("clang") {
        made("clang");
    }
    if is_installed("cmake") {
        let folder = copied("cmake");
        let mut configure = with_library(Command::new("cmake"));
        output(configure.current_dir(&folder).args(["-B", "build", &format!("-DCMAKE_C_FLAGS={WARNINGS}")]))
            .unwrap();
        output(Command::new("cmake").current_dir(&folder).args(["--build", "build"])).unwrap();
        assert!(folder.join("build/driver").exists() && folder.join("build/setpoint_source").exists());
    }
}

#[test]
fn a_driver_links_with_the_static_library() {
    let (folder, prefix) = (copied("static"), prefix());
    let mut compiler = Command::new("cc");
    compiler
        .current_dir(&folder)
        .args(["-std=c11", "-o", "driver", "driver.c", "-I"])
        .arg(prefix.join("include"));
    compiler.arg("-L").arg(prefix.join("lib"));
    let libraries = "-Wl,-Bstatic -lhexad -Wl,-Bdynamic -lpthread -ldl -lm -lgcc_s";
    output(compiler.args(libraries.split(' '))).unwrap();
    let needed = output(Command::new("readelf").arg("-d").arg(folder.join("driver"))).unwrap();
    assert!(!needed.contains("libhexad"), "{needed}");
    controls("static", || Command::new(folder.join("driver")), &made_by_cc().join("setpoint_source"));
}

/// A run of the daemon with a driver and a setpoint source: largest length of a leg beyond home \[m\].
fn run(label: &str, driver: Command, source: &Path) -> f64 {
    let name = format!("driver-{label}-{}", process::id());
    let log = |part: &str| file(&format!("{name}-{part}.txt"));
    let daemon = start_daemon(&name, PATIENT);
    let bus = Bus::join(&name).unwrap();
    let mut measured = bus.subscriber::<MeasuredMessage>(256).unwrap();
    let start = |mut command: Command, part: &str| {
        command.arg(&name);
        Process::start(with_library(command), log(part))
    };
    let driver = start(driver, "driver");
    daemon.says("no setpoint");
    let mut source = start(Command::new(source), "source");
    let (mut highest, mut reported) = (0.0_f64, (0, 0, 0));
    while source.child.try_wait().unwrap().is_none() {
        while let Some(message) = measured.receive() {
            highest =
                message.length_m.iter().fold(highest, |highest, length| highest.max(length - HOME_LENGTH_M));
            let MeasuredMessage { drive_valid, drive_enabled, brake_open, .. } = message;
            reported = (drive_valid, drive_enabled.max(reported.1), brake_open.max(reported.2));
        }
        sleep(Duration::from_millis(1));
    }
    source.ends_well();
    // It stands; without a source control ends, and the driver closes the brakes.
    daemon.says("standby: setpoint source ended");
    driver.says("brakes open\nbrakes closed\n");
    let words = driver.log.clone();
    driver.stops();
    let words = fs::read_to_string(words).unwrap();
    assert!(words.ends_with("brakes closed, the driver ends\n"), "{words}");
    assert_eq!(reported, (15, 63, 63), "status of the drives");
    daemon.stops();
    highest
}

/// Where the host held somebody for longer than a driver waits, it is tried again.
fn controls(label: &str, driver: impl Fn() -> Command + std::panic::RefUnwindSafe, source: &Path) {
    for attempt in 1.. {
        let host = Watchdog::start();
        let risen = catch_unwind(|| run(&format!("{label}{attempt}"), driver(), source));
        let held = host.largest();
        match risen {
            Ok(risen) => {
                println!(
                    "{label}: the legs rose by {:.4} mm; the host held somebody for {held:?}",
                    risen * 1e3
                );
                assert!((risen - RISE_M).abs() < 1e-4, "{risen} m");
                return;
            }
            Err(failure) if held < HELD || attempt == ATTEMPTS => {
                println!("{label}: the host held nobody for longer than {held:?}");
                resume_unwind(failure)
            }
            Err(_) => println!("{label}: attempt {attempt} failed; the host held somebody for {held:?}"),
        }
    }
}

/// A program below the priorities of the daemon, as the head of the example says; an ordinary one where that is not permitted.
fn with_priority(program: &Path) -> Command {
    let prefix = ["-f", "70"];
    let is_permitted = Command::new("chrt").args(prefix).arg("true").status().is_ok_and(|it| it.success());
    let mut command = Command::new(if is_permitted { "chrt" } else { "env" });
    command.args(prefix.iter().filter(|_| is_permitted)).arg(program);
    command
}

#[test]
fn drivers_in_every_language_control_the_platform() {
    let (c, cpp, rust) = (made_by_cc(), &made_as_cpp(), &built().join("examples/driver"));
    let python = || {
        let mut command = Command::new("python3");
        command.arg(c.join("driver.py"));
        command
    };
    scope(|threads| {
        threads.spawn(|| controls("c", || Command::new(c.join("driver")), &cpp.join("setpoint_source")));
        threads.spawn(|| controls("cpp", || Command::new(cpp.join("driver")), &c.join("setpoint_source")));
        threads.spawn(|| controls("rust", || with_priority(rust), &c.join("setpoint_source")));
        threads.spawn(|| controls("python", python, &c.join("setpoint_source")));
    });
}
