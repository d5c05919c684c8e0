//! `hexad demo` on every machine that comes with it: as a user runs it.

use std::fs;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::thread::scope;
use std::time::{Duration, Instant};

use hexad::daemon::report::Report;
use hexad::messages::Times;
use serde_json::{Map, Value};

use crate::support::children::{HANG, Hexad, hexad};
use crate::support::machine::{Machine, PATIENT};
use crate::support::xml;
use hexad_support::not_run::not_run;
use hexad_support::stalls::Watchdog;

const SECONDS: f64 = 3.0;

/// Settle, approach, settle and settle again at the least; see `scene/timeline.rs`.
const AROUND_S: f64 = 2.0;

/// The shortest timeout of the machine files, which have the defaults.
const SHORTEST_TIMEOUT: Duration = Duration::from_millis(20);

const PICTURES: [&str; 8] = [
    "acceleration.svg",
    "forces.svg",
    "leg_accelerations.svg",
    "leg_lengths.svg",
    "leg_rates.svg",
    "tracking_error.svg",
    "trajectory.svg",
    "velocity.svg",
];

/// Attempts of which the host may spoil all but the last.
const ATTEMPTS: usize = 3;

/// The machines, and how well they track \[m\], \[rad\].
const MACHINES: [(&str, f64); 3] = [("fried2008", 50e-6), ("tsai2000", 500e-6), ("motion_base", 500e-6)];

/// All at once: each has daemon, plant and source of its own.
#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn every_machine_goes_well() {
    let judged = scope(|threads| {
        let judge = |(machine, largest_rms)| threads.spawn(move || goes_well(machine, largest_rms));
        MACHINES.map(judge).map(|thread| thread.join().unwrap_or_else(|failure| resume_unwind(failure)))
    });
    if judged.contains(&false) {
        not_run(&format!("the host was away for too long in each of {ATTEMPTS} attempts"));
    }
}

/// What a demonstration left behind.
struct Demonstration {
    files: Machine,
    code: Option<i32>,
    /// Output and error output.
    words: [String; 2],
    id: u32,
    wall_s: f64,
    largest_gap: Duration,
}

/// Once, with the machine file as it is. A fault or a poor tracking is the host's if an ordinary thread had no processor for
/// longer than the shortest timeout; then again, with timeouts it does not reach. False if it was in each attempt.
fn goes_well(machine: &str, largest_rms: f64) -> bool {
    for attempt in 1..=ATTEMPTS {
        let shown = demonstrate(machine, attempt > 1);
        let (gap, [output, errors]) = (shown.largest_gap, &shown.words);
        let tracking = Report::read(&shown.report()).map(|report| report.tracking).unwrap_or_default();
        let tracked = tracking.position_rms_m <= largest_rms && tracking.orientation_rms_rad <= largest_rms;
        if shown.code == Some(0) && tracked {
            has_left_what_it_should(machine, &shown);
            return true;
        }
        println!("{machine}, attempt {attempt}: the host was away for {gap:?}; {tracking:?}\n{errors}");
        assert!(gap > SHORTEST_TIMEOUT, "that explains nothing: exit code {:?}\n{output}", shown.code);
    }
    false
}

fn has_left_what_it_should(machine: &str, shown: &Demonstration) {
    let [output, errors] = &shown.words;
    assert!(output.contains("faults           0"), "{output}\n{errors}");
    let json = fs::read_to_string(shown.report()).expect("the report");
    has_exactly_the_fields_of_the_contract(&serde_json::from_str(&json).expect("JSON"));
    let report: Report = serde_json::from_str(&json).expect("the report");
    is_sane(&report, shown.wall_s);
    let Report { tracking, deadline_misses, .. } = &report;
    println!("{machine}: {tracking:?}, {deadline_misses:?}, the host was away for {:?}", shown.largest_gap);
    the_pictures_are_there(&shown.charts());
    let page = shown.charts().join("report.html");
    assert!(output.ends_with(&format!("report           {}\n", page.display())), "{output}");
    let text = fs::read_to_string(page).expect("the page");
    assert!(text.contains("\"name\":\"state\""), "the page must have states");
    let folder = shown.files.folder().join(format!("hexad-demo-{}", shown.id));
    assert!(!folder.exists(), "{} must be gone", folder.display());
}

fn demonstrate(machine: &str, patient: bool) -> Demonstration {
    let mut config = Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(format!("{machine}.toml"));
    let files = Machine::patient("demo");
    if patient {
        let text = fs::read_to_string(config).expect("a machine file");
        config = files.path("patient.toml");
        fs::write(&config, text + PATIENT).expect("a machine file");
    }
    let watchdog = Watchdog::start_ordinary();
    let start = Instant::now();
    let mut command = hexad();
    command.arg("demo").arg("--config").arg(config).args(["--seconds", &SECONDS.to_string()]);
    command.arg("--report").arg(files.path("report.json"));
    command.arg("--pictures").arg("--charts").arg(files.path("charts"));
    command.env("TMPDIR", files.folder());
    let demo = Hexad::spawn(&files, "demo", command);
    let id = demo.id();
    let ended = demo.ends_within(HANG * 2);
    Demonstration {
        files,
        code: ended.status.code(),
        words: [ended.stdout, ended.stderr],
        id,
        wall_s: start.elapsed().as_secs_f64(),
        largest_gap: watchdog.largest(),
    }
}

impl Demonstration {
    fn report(&self) -> PathBuf {
        self.files.path("report.json")
    }

    fn charts(&self) -> PathBuf {
        self.files.path("charts")
    }
}

fn has_exactly_the_fields_of_the_contract(report: &Value) {
    let times = ["count", "max", "mean", "min", "p50", "p90", "p99", "p999", "p9999"];
    let usage = ["allocations", "involuntary_switches", "major_faults", "minor_faults", "voluntary_switches"];
    let fields: [(&str, &[&str]); 9] = [
        ("deadline_misses", &["caught_up", "late_wakeup", "overrun", "skipped"]),
        ("wakeup_ns", &times),
        ("compute_ns", &times),
        ("measured_age_ns", &times),
        ("end_to_end_ns", &times),
        ("tracking", &["orientation_max_rad", "orientation_rms_rad", "position_max_m", "position_rms_m"]),
        ("rt_thread", &usage),
        ("io_thread", &usage),
        ("log_thread", &usage),
    ];
    let mut top = vec!["version", "cycles", "rate_hz", "worst_cycles", "faults", "recording"];
    top.extend(fields.iter().map(|(name, _)| *name));
    top.sort_unstable();
    assert_eq!(keys(report), top);
    for (name, expected) in fields {
        assert_eq!(keys(&report[name]), expected, "{name}");
        assert!(report[name].as_object().is_some_and(|of| of.values().all(Value::is_number)), "{name}");
    }
    assert!(report["cycles"].is_u64() && report["rate_hz"].is_number(), "{report:#}");
    assert_eq!(report["faults"], Value::Array(vec![]));
}

fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<_> = value.as_object().into_iter().flat_map(Map::keys).map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

fn is_sane(report: &Report, wall_s: f64) {
    let Report { cycles, rate_hz, deadline_misses, rt_thread, tracking, .. } = report;
    assert_eq!(*rate_hz, 1000.0);
    let seconds = (cycles + deadline_misses.skipped) as f64 / rate_hz;
    assert!(
        (SECONDS + AROUND_S..wall_s).contains(&seconds),
        "{seconds} s of cycles in {wall_s} s: {report:#?}"
    );
    assert!(*cycles as f64 > 0.9 * SECONDS * rate_hz, "{report:#?}");
    for times in [&report.wakeup_ns, &report.compute_ns, &report.measured_age_ns, &report.end_to_end_ns] {
        let Times { count, min, mean, p50, p90, p99, p999, p9999, max } = *times;
        // A measurement that comes while the io thread is late is younger than the release: 0.
        let rising = [min, p50, p90, p99, p999, p9999, max].is_sorted();
        assert!(rising && max > 0 && (min..=max).contains(&mean) && count <= *cycles, "{report:#?}");
    }
    let worst = &report.worst_cycles;
    assert_eq!(worst.len(), 8);
    assert!(worst.iter().all(|cycle| (1..=*cycles).contains(&cycle.cycle)), "{worst:#?}");
    assert!(worst.is_sorted_by_key(|cycle| u64::MAX - cycle.wakeup_ns - cycle.compute_ns), "{worst:#?}");
    assert!(report.end_to_end_ns.p50 > report.compute_ns.p50, "the way out takes time too: {report:#?}");
    assert_eq!((rt_thread.allocations, rt_thread.major_faults), (0, 0), "{rt_thread:#?}");
    // A sleep each cycle; what makes a cycle without is a wake-up that came late.
    assert!(rt_thread.voluntary_switches > cycles / 2, "{rt_thread:#?}");
    for (rms, max) in [
        (tracking.position_rms_m, tracking.position_max_m),
        (tracking.orientation_rms_rad, tracking.orientation_max_rad),
    ] {
        assert!(0.0 < rms && rms < max && max < 0.01, "{tracking:#?}");
    }
}

fn the_pictures_are_there(folder: &Path) {
    let entries = fs::read_dir(folder).expect("the pictures");
    let mut found: Vec<_> = entries
        .map(|entry| entry.expect("a file").file_name().into_string().expect("a plain name"))
        .collect();
    found.sort_unstable();
    let others = ["recording.mcap", "report.html"];
    assert!(others.iter().all(|name| found.contains(&name.to_string())), "{found:?}");
    found.retain(|name| !others.contains(&name.as_str()));
    assert_eq!(found, PICTURES);
    for name in PICTURES {
        let text = fs::read_to_string(folder.join(name)).expect("a picture");
        assert_eq!(xml::check(&text), Ok(()), "{name}");
        assert!(text.contains("<svg") && text.contains("<polyline"), "{name} must have lines");
        assert!(!text.contains("NaN") && !text.contains("inf"), "{name} must have numbers");
    }
}
