//! `hexad doctor` on the host that runs the tests, whatever it offers: text, JSON and exit code agree, and
//! what is lacking comes with its remedy.
//!
//! A measurement takes the processors from tests without FIFO priority. Controllers of others
//! may run on the host all the same, so these measure beside them.

use hexad::commands::doctor::Diagnosis;
use hexad::commands::doctor::facts::{Assessment, Fact};
use hexad::commands::doctor::verdict::Feasibility;
use hexad::realtime::cyclic::ReleaseMode;

use crate::support::children::{Ended, Hexad, run};
use crate::support::machine::Machine;
use crate::support::nobody::{AS_NOBODY, NO_LIMITS_RAISED, cannot, wrapped};

/// Runs it for a second, before the words of `more`.
fn doctor(machine: &Machine, more: &[&str]) -> Ended {
    let report = machine.path("doctor.json").display().to_string();
    let arguments = ["doctor", "--seconds", "1", "--disturb", "--report", &report];
    run(machine, &[&arguments, more].concat())
}

fn diagnosis(machine: &Machine) -> Diagnosis {
    let text = std::fs::read_to_string(machine.path("doctor.json")).expect("the report");
    serde_json::from_str(&text).expect("JSON")
}

/// As one line, however it was wrapped.
fn unwrapped(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn fact<'a>(diagnosis: &'a Diagnosis, name: &str) -> &'a Fact {
    let named = diagnosis.facts.iter().find(|fact| fact.name == name);
    named.unwrap_or_else(|| panic!("{name} must be among {:#?}", diagnosis.facts))
}

#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn text_and_json_and_exit_code_agree() {
    let machine = Machine::patient("doctor");
    let Ended { status, stdout, stderr } = doctor(&machine, &[]);
    let diagnosis = diagnosis(&machine);
    let possible = diagnosis.verdict != Some(Feasibility::Impossible);
    assert_eq!(status.code(), Some(if possible { 0 } else { 1 }), "{stdout}\n{stderr}");
    let complaint = "hexad: 1000 Hz by sleep is not possible on this host\n";
    assert_eq!(stderr, if possible { "" } else { complaint });

    let text = unwrapped(&stdout);
    assert!(text.starts_with("fried2008: 1000 Hz by sleep, on any CPU"), "{stdout}");
    assert!(diagnosis.facts.len() > 10, "{:#?}", diagnosis.facts);
    for Fact { name, assessment, found, remedy } in &diagnosis.facts {
        assert!(
            text.contains(&unwrapped(&format!("{name} {found}"))),
            "{name}: {found} must be in\n{stdout}"
        );
        let remedy_shown = remedy.as_ref().is_none_or(|remedy| text.contains(&format!("-> {remedy}")));
        assert!(remedy_shown, "{remedy:?} must be in\n{stdout}");
        assert!(
            remedy.is_some() || [Assessment::Good, Assessment::Unknown].contains(assessment),
            "{name} has no remedy"
        );
    }
    assert_eq!(diagnosis.rates.len(), 10);
    for rate in &diagnosis.rates {
        let latency = &rate.latency;
        let times = latency.wakeup_ns;
        let ordered = [times.min, times.p50, times.p99, times.p999, times.p9999, times.max];
        assert!(ordered.is_sorted(), "{times:?}");
        assert!(times.count > 0);
        assert_eq!(latency.thread.allocations, 0, "{latency:?}");
        assert!(!rate.reasons.is_empty());
        for reason in &rate.reasons {
            assert!(text.contains(reason.as_str()), "{reason} must be in\n{stdout}");
        }
    }
    let word = serde_json::to_value(diagnosis.verdict).expect("a word");
    let last = format!("1000 Hz by sleep, in 1 s: {}", word.as_str().expect("a word"));
    assert!(stdout.contains(&last), "{last} must be in\n{stdout}");
    assert!(stdout.lines().all(|line| line.chars().count() <= 80), "as wide as a terminal:\n{stdout}");
    assert!(!stdout.contains('\u{1b}'), "no colours in a file:\n{stdout}");
}

#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn what_is_configured_is_what_is_judged() {
    let machine = Machine::with(
        "doctor-configured",
        "[realtime]\nrate_hz = 500\nrelease = \"hybrid\"\nmax_lead_us = 300\ncpu = 0\nlate_wakeup_us = 700",
    );
    let ended = doctor(&machine, &["--config", machine.file.to_str().expect("a plain name")]);
    let diagnosis = diagnosis(&machine);
    assert_eq!((diagnosis.rate_hz, diagnosis.release, diagnosis.cpu), (500.0, ReleaseMode::Hybrid, Some(0)));
    assert_eq!(diagnosis.rates.len(), 12, "{}", ended.stdout);
    for rate in &diagnosis.rates {
        let latency = &rate.latency;
        let half_ns = (0.5e9 / latency.rate_hz) as u64;
        assert_eq!(latency.late_wakeup_ns, half_ns.min(700_000));
        assert_eq!(latency.lead_ns > 0, latency.release == ReleaseMode::Hybrid);
        assert!(latency.lead_ns <= half_ns.min(300_000));
    }
    let releases = |rate_hz, release| {
        let rate =
            diagnosis.rates.iter().find(|rate| rate.latency.is_of(rate_hz, release)).expect("measured");
        rate.latency.wakeup_ns.count + rate.latency.missed
    };
    // It has 4 of the 15 parts of that second, the others one each.
    assert_eq!(releases(500.0, ReleaseMode::Hybrid), 134, "{}", ended.stdout);
    assert_eq!(releases(500.0, ReleaseMode::Sleep), 34, "{}", ended.stdout);
}

#[test]
#[ignore = "second tier: measures, so it runs alone"]
#[apply(alone)]
fn nobody_is_told_what_is_lacking() {
    let nobody = [NO_LIMITS_RAISED, AS_NOBODY];
    if cannot(&nobody) {
        return;
    }
    let machine = Machine::with("doctor-nobody", "[realtime]\nrequire_realtime = true\nlate_wakeup_us = 400");
    let mut command = wrapped(&machine, &nobody);
    command.args(["doctor", "--seconds", "1", "--disturb", "--config"]).arg(&machine.file);
    command.arg("--report").arg(machine.path("doctor.json"));
    let Ended { status, stderr, .. } = Hexad::spawn(&machine, "doctor", command).ends();
    assert_eq!(status.code(), Some(1), "{stderr}");
    assert_eq!(stderr, "hexad: 1000 Hz by sleep is not possible on this host\n");
    let diagnosis = diagnosis(&machine);
    for (name, found, remedy) in [
        ("scheduling", "no FIFO priority 80: no CAP_SYS_NICE, and RLIMIT_RTPRIO is 0", "LimitRTPRIO=80"),
        ("locked memory", "no locked memory: no CAP_IPC_LOCK, and RLIMIT_MEMLOCK is 64 kB", "LimitMEMLOCK="),
    ] {
        let fact = fact(&diagnosis, name);
        assert_eq!(fact.assessment, Assessment::Bad, "{fact:?}");
        assert!(fact.found.starts_with(found), "{fact:?}");
        assert!(fact.remedy.as_ref().is_some_and(|words| words.contains(remedy)), "{fact:?}");
    }
    for rate in &diagnosis.rates {
        assert_eq!(rate.verdict, Feasibility::Impossible);
        let why = "the daemon would not start: realtime.require_realtime, and no FIFO priority 80, no ";
        assert!(rate.reasons[0].starts_with(why), "{rate:?}");
    }
}
