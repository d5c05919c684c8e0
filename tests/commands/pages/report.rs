//! `hexad report`: the page of an hour, and of a run in two files.

use std::fs;
use std::ops::Range;

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::sensing::localization::PlatformState;
use hexad::control::signals::diagnostic::{Diagnostic, DiagnosticCode};
use hexad::control::signals::errors::PoseError;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad::control::signals::state::State;
use hexad::messages::CycleMessage;
use hexad::model::inverse_geometry::leg_lengths;
use hexad::model::rigid::Twist;
use hexad::model::task::TaskState;
use hexad::recording::file::RecordingFile;
use hexad::recording::reader::Recording;
use hexad::recording::{Item, RunInfo};
use serde_json::{Value, json};

use super::super::{Folder, has};
use hexad_support::browser::Browser;

/// Slow cycles, so that an hour is a small file.
pub(super) const RATE_HZ: u64 = 20;
const PERIOD_NS: u64 = 1_000_000_000 / RATE_HZ;
const CYCLES: u64 = 3600 * RATE_HZ;

/// First cycle of a fault, and how many it lasts.
pub(super) const FAULT: u64 = CYCLES / 3;
const FAULT_CYCLES: u64 = 100;

/// Cycle with a single extreme force, far from every event \[N\].
const PEAK: u64 = CYCLES / 2 + 12_345;
const PEAK_N: f64 = 900.0;

/// Cycles that are missing.
const MISSING: Range<u64> = CYCLES - 500..CYCLES - 490;

/// Uses the page as a person does.
const SCRIPT: &str = concat!(include_str!("is_drawn.js"), include_str!("drive.js"));

/// A machine with slow cycles.
pub(super) fn machine() -> Folder {
    Folder::new(&format!("[realtime]\nrate_hz = {RATE_HZ}\n"))
}

/// A cycle of a platform that moves slowly.
pub(super) fn cycle(config: &Config, number: u64) -> CycleMessage {
    let t = (number - 1) as f64 / RATE_HZ as f64;
    let mut x = config.machine.home;
    x[2] += 0.1 * (0.01 * t).sin();
    x[4] += 0.05 * (0.02 * t).cos();
    let pose = TaskState::at_rest(x).motion().pose;
    let lengths = leg_lengths(&config.machine, &pose);
    let release_ns = 1_000_000_000 + number * PERIOD_NS;
    let is_fault = (FAULT..FAULT + FAULT_CYCLES).contains(&number);
    let lost = Diagnostic::new(DiagnosticCode::MeasurementLost, 0.25, 0.2);
    let peak = if number == PEAK { PEAK_N } else { 0.0 };
    let error = Twist { linear: [3e-6, 0.0, 4e-6].into(), ..Twist::default() };
    let output = Output {
        state: if is_fault { State::Fault } else { State::Active },
        diagnostic: if is_fault { lost } else { Diagnostic::default() },
        command_n: core::array::from_fn(|leg| 10.0 * (leg as f64 + t.sin()) + peak),
        platform: Some(PlatformState {
            pose,
            twist: Twist::default(),
            condition: 8.0,
            time_to_singularity_s: f64::INFINITY,
        }),
        error: Some(PoseError { pose: error, twist: Twist::default() }),
        reference: Some(TaskState::at_rest(x).motion()),
        ..Output::default()
    };
    let measurement = Measurement {
        time_ns: release_ns - 500_000,
        length_m: lengths,
        rate_m_s: Some([0.0; 6]),
        ..Measurement::default()
    };
    let task = TaskState::at_rest(x);
    let setpoint = Setpoint::motion(release_ns, task);
    let input =
        Input { release_ns, setpoint: Some(setpoint), measurement: Some(measurement), ..Input::default() };
    CycleMessage {
        cycle: number,
        due_ns: release_ns,
        wakeup_ns: 20_000 + number % 97 * 100,
        compute_ns: 2_000 + number % 89 * 10,
        ..CycleMessage::new(&input, &output)
    }
}

/// Writes cycles of the run of a daemon that has started at an instant to a file of a folder.
fn write(folder: &Folder, name: &str, config: &Config, clock_offset_ns: u64, part: Range<u64>) {
    let info = RunInfo {
        name: "an-hour".into(),
        configuration: config.text.clone(),
        clock_offset_ns,
        ..RunInfo::default()
    };
    let mut file = RecordingFile::create(&folder.path(name), &info, None).unwrap();
    for number in part.filter(|number| !MISSING.contains(number)) {
        file.write_cycle(&cycle(config, number)).unwrap();
    }
    file.finish().unwrap();
}

fn seconds(number: u64) -> f64 {
    (number - 1) as f64 / RATE_HZ as f64
}

#[test]
#[ignore = "second tier: needs Chromium"]
fn an_hour_opens_shows_everything_and_zooms_to_single_cycles_of_a_fault() {
    let Some(browser) = Browser::find() else { return };
    let folder = machine();
    let (config, page) = (folder.config(), folder.path("report.html"));
    let middle = CYCLES / 2;
    write(&folder, "2.mcap", &config, 1, middle..CYCLES + 1);
    write(&folder, "1.mcap", &config, 1, 1..middle);
    // The files in the wrong order.
    let printed = folder.says("report -o @/report.html @/2.mcap @/1.mcap");
    has(&printed, &[&format!("{} cycles", CYCLES - 10), "in every 300"]);
    let bytes = fs::metadata(&page).unwrap().len();
    assert!((12_000_000..18_000_000).contains(&bytes), "{bytes} bytes");

    // Instants in windows where every cycle is kept: around the fault and at the start.
    let kept = [FAULT - 3, FAULT + 5, 4];
    let instants: Vec<f64> = kept.into_iter().map(seconds).collect();
    let script = SCRIPT.replace("INSTANTS", &json!(instants).to_string());
    let found = browser.run(&page, &script.replace("FAULT_S", &seconds(FAULT).to_string()));
    assert_eq!([&found["error"], &found["distribution"]], [&Value::Null, &json!(true)]);
    assert_eq!((found["charts"].as_u64(), found["drawn"].as_u64()), (Some(18), Some(18)));
    for (number, shown) in kept.into_iter().zip(found["at"].as_array().unwrap()) {
        let cycle = cycle(&config, number);
        let force = cycle.output().filter(|output| output.state.has_control()).map(|_| cycle.force_n[0]);
        let recorded = [Some(cycle.position_m[0]), Some(cycle.measured_length_m[0]), force];
        // JSON does not keep the last bit.
        let shown = [0, 1, 2].map(|k: usize| shown[k].as_f64().map(|number| number as f32));
        let recorded = recorded.map(|number| number.map(|number| number as f32));
        assert_eq!(shown, recorded, "cycle {number}");
    }
    let largest = found["largest"].as_f64().unwrap() as f32;
    let peak = cycle(&config, PEAK).force_n[0] as f32;
    assert_eq!(largest, peak, "a single cycle of {PEAK_N} N must be seen in an hour");
    assert_eq!([&found["moves"], &found["turns"], &found["focus"]], [true; 3]);
    assert_eq!(found["cursors"], 1, "all charts show the same instant");
    let middle_s = 0.5 * seconds(CYCLES);
    assert!((found["pointer"].as_f64().unwrap() - middle_s).abs() < 0.01 * middle_s, "{found}");
    let length = |name: &str| found[name].as_f64().unwrap();
    assert!((length("zoomed") - middle_s).abs() < 1.0 && (length("whole") - 2.0 * middle_s).abs() < 1e-6);
    assert!((length("step") - 1.0 / RATE_HZ as f64).abs() < 1e-6, "{found}");
    let sentence = "measurement lost: age 0.25 s exceeds timeouts.measured_ms 0.2 s";
    assert!(found["text"].as_str().unwrap().contains(&format!("fault · {sentence}")), "{found}");
    let facts = found["facts"].to_string();
    for words in [
        "1 h 0 min 0 s at 20 Hz",
        // The run begins with the Unix time, in this test.
        &format!("one: at {:.3} s (", seconds(FAULT)),
        &format!(" UTC) {sentence}"),
        "position 5.00 µm RMS, 5.00 µm largest",
        "10: these cycles are not in the recording",
        "overruns: 0",
    ] {
        assert!(facts.contains(words), "{words} must be in {facts}");
    }
}

#[test]
fn files_of_two_runs_are_refused() {
    let folder = machine();
    write(&folder, "1.mcap", &folder.config(), 1, 1..5);
    write(&folder, "2.mcap", &folder.config(), 2, 10..15);
    folder.refuses("report -o @/report.html @/1.mcap @/2.mcap", &["report each run alone"]);
    assert!(!folder.path("report.html").exists());
}

/// What a full disk or a crash leaves is named, and hides nothing.
#[test]
fn files_without_a_cycle_are_left_out_and_one_with_damaged_cycles_is_not() {
    let folder = machine();
    folder.write("1.mcap", "");
    write(&folder, "2.mcap", &folder.config(), 1, 1..1);
    for refused in ["report -o @/report.html @/1.mcap @/2.mcap", "identify @/1.mcap @/2.mcap"] {
        folder.refuses(refused, &["/1.mcap: no complete cycle is in it"]);
    }
    folder.refuses("convert @/1.mcap --csv @/1.csv", &["/1.mcap: no complete cycle is in it"]);
    write(&folder, "3.mcap", &folder.config(), 1, 1..5);
    let line = "report -o @/report.html @/1.mcap @/2.mcap @/3.mcap";
    let (code, output, errors) = folder.run(line);
    assert_eq!((code, errors.lines().count()), (Some(0), 2), "{errors}");
    has(&output, &["4 cycles"]);
    has(
        &errors,
        &["/1.mcap: it is left out: no complete cycle", "/2.mcap: it is left out: no complete cycle"],
    );
    let mut damaged = fs::read(folder.path("3.mcap")).unwrap();
    let at = damaged.len() / 2;
    damaged[at] ^= 1;
    folder.write("4.mcap", damaged);
    folder.refuses(&format!("{line} @/4.mcap"), &["/4.mcap: "]);
}

/// A page of a file that broke off never claims that it is whole, not even once the file is completed; and it says so without scripts.
#[test]
fn a_file_that_broke_off_is_unfinished_until_another_goes_on() {
    let folder = machine();
    let config = folder.config();
    write(&folder, "whole.mcap", &config, 1, FAULT - 50..FAULT + 450);
    let whole = fs::read(folder.path("whole.mcap")).unwrap();
    folder.write("cut.mcap", &whole[..whole.len() * 7 / 10]);
    folder.execute("recover @/cut.mcap --output @/recovered.mcap").unwrap();
    let mut last = 0;
    let cut = Recording::open(&folder.path("cut.mcap")).unwrap();
    cut.each(|item| {
        if let Item::Cycle(cycle) = item {
            last = cycle.cycle
        }
    })
    .unwrap();
    assert!((FAULT + 200..FAULT + 440).contains(&last), "{last}");
    write(&folder, "next.mcap", &config, 1, last + 1..FAULT + 450);
    let sentence =
        "one: at 2.500 s (00:20:01 UTC) measurement lost: age 0.25 s exceeds timeouts.measured_ms 0.2 s";
    let [cut_s, end_s] = [last, FAULT + 449].map(|number| seconds(number) - seconds(FAULT - 50));
    let complete = format!("\nEnd: at {end_s:.3} s (00:20:23 UTC) in state active; the file is complete\n");
    let unfinished = format!("\nEnd: unfinished, the last cycle is at {cut_s:.3} s (");
    for (files, is_unfinished) in [
        ("@/whole.mcap", false),
        ("@/cut.mcap", true),
        ("@/recovered.mcap", true),
        ("@/next.mcap @/cut.mcap", false),
    ] {
        folder.execute(&format!("report -o @/report.html {files}")).unwrap();
        let page = folder.read("report.html");
        let (_, summary) = page.split_once("<pre id=\"summary\">").unwrap();
        let summary = summary.split("</pre>").next().unwrap();
        has(
            summary,
            &["an-hour: recording", ", from 1970-01-01 00:19:58 UTC\nRun: ", sentence, "\nStates: active "],
        );
        for (words, is_there) in
            [(&*unfinished, is_unfinished), (") in state active; what followed is unknown", is_unfinished)]
                .into_iter()
                .chain([(&*complete, !is_unfinished), ("every cycle is in the recording", !is_unfinished)])
        {
            assert_eq!(summary.contains(words), is_there, "{files}: {words:?} in {summary}");
        }
        assert_eq!(page.contains("<title>an-hour: recording, unfinished</title>"), is_unfinished, "{files}");
        assert!(page.contains(&format!("\"is_unfinished\":{is_unfinished},")), "{files}");
    }
}

/// Files on both sides of two reloads, in any order, are one page that shows both.
#[test]
fn a_run_over_reloads_is_one_page() {
    let folder = machine();
    let old = folder.config();
    let text = format!("{}\n[control]\nposition_bandwidth_hz = 1.0\n", old.text);
    let new = Config::parse(&text, "the test").unwrap();
    write(&folder, "1.mcap", &new, 1, 300..600);
    write(&folder, "2.mcap", &old, 1, 1..100);
    write(&folder, "3.mcap", &old, 1, 600..800);
    write(&folder, "4.mcap", &old, 1, 100..300);
    has(&folder.says("report -o @/report.html @/1.mcap @/2.mcap @/3.mcap @/4.mcap"), &["799 cycles"]);
    let text = folder.read("report.html");
    let (_, head) = text.split_once("id=\"head\">").unwrap();
    let head: Value = serde_json::from_str(head.split("</script>").next().unwrap()).unwrap();
    let fact = head["facts"].as_array().unwrap().iter().find(|fact| fact["name"] == "Reloads").unwrap();
    let (there, back) =
        ("control.position_bandwidth_hz: default -> 1.0", "control.position_bandwidth_hz: 1.0 -> default");
    let [to_new, to_old] = [300, 600].map(|number| format!("at {:.3} s (cycle {number})", seconds(number)));
    assert_eq!(fact["text"], format!("{to_new} {there}. Then {to_old} {back}"));
    let track = head["tracks"].as_array().unwrap().iter().find(|it| it["group"] == "configuration").unwrap();
    let shown: Vec<_> = track["intervals"]
        .as_array()
        .unwrap()
        .iter()
        .map(|it| (format!("{:.6}", it["from"].as_f64().unwrap()), it["text"].as_str().unwrap()))
        .collect();
    let expected =
        [(1, "as started"), (300, &*format!("reloaded: {there}")), (600, &*format!("reloaded: {back}"))];
    assert_eq!(shown, expected.map(|(number, text)| (format!("{:.6}", seconds(number)), text)));
    let texts = head["configuration"].as_str().unwrap();
    for (k, number) in [(1, 1), (2, 300), (3, 600)] {
        let line = format!("# Configuration {k}, from {:.3} s (cycle {number})", seconds(number));
        assert!(texts.contains(&line), "{line}");
    }
}
