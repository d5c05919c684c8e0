//! `hexad view`: the page live, for those with its token alone.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::children::{HANG, Hexad};
use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::engage;
use crate::support::trio::{Trio, start_daemon, start_setpoints};
use hexad_support::browser::Browser;

const TIP: &str = "\n[[frame]]\nname = 'tip'\nkind = 'tool'\npose = [0.0, 0.0, 0.0, 0.3, 0.0, 0.0]\n";

/// A running `hexad view`, with its port and its token.
struct View {
    process: Hexad,
    port: String,
    token: String,
}

impl View {
    fn start(machine: &Machine, more: &[&str]) -> Self {
        let process = Hexad::start(machine, "view", more);
        let start = Instant::now();
        loop {
            assert!(start.elapsed() < HANG, "no address: {}", process.words());
            let line = process.printed();
            if let Some((host, token)) =
                line.trim_end_matches('\n').split_once("/?token=").filter(|_| line.ends_with('\n'))
            {
                let port = host.strip_prefix("http://127.0.0.1:").expect("the loopback").to_string();
                return Self { process, port, token: token.into() };
            }
            sleep(Duration::from_millis(5));
        }
    }

    /// Sends a head, and returns the whole reply.
    fn send(&self, head: &str) -> String {
        let mut stream = TcpStream::connect(format!("127.0.0.1:{}", self.port)).unwrap();
        stream.set_read_timeout(Some(HANG)).unwrap();
        write!(stream, "{head}\r\nHost: 127.0.0.1:{}\r\n\r\n", self.port).unwrap();
        let mut reply = String::new();
        stream.read_to_string(&mut reply).unwrap();
        reply
    }

    fn data(&self, after: u64) -> Value {
        let reply = self.send(&format!("GET /data?token={}&after={after} HTTP/1.1", self.token));
        let (head, body) = reply.split_once("\r\n\r\n").unwrap();
        assert!(head.starts_with("HTTP/1.1 200 OK\r\n") && head.contains("no-store"), "{head}");
        serde_json::from_str(body).unwrap()
    }

    /// Data, once it satisfies a condition.
    fn until(&self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let data = self.data(0);
            if is_so(&data) {
                return data;
            }
            assert!(start.elapsed() < HANG, "{what} must be shown: {:?}", data["facts"]);
            sleep(Duration::from_millis(20));
        }
    }
}

fn states(data: &Value) -> Vec<&str> {
    let tracks = data["tracks"].as_array().unwrap();
    let states = tracks.iter().filter(|track| track["name"] == "state");
    states
        .flat_map(|track| track["intervals"].as_array().unwrap())
        .filter_map(|it| it["text"].as_str())
        .collect()
}

#[test]
#[ignore = "second tier: needs Chromium"]
#[apply(beside_others)]
fn without_its_token_nothing_is_shown_and_with_it_nothing_can_be_changed() {
    let machine = Machine::with("view-token", &format!("{PATIENT}{TIP}"));
    let mut view = View::start(&machine, &[]);
    let token = view.token.clone();
    assert!(token.len() == 32 && token.bytes().all(|digit| digit.is_ascii_hexdigit()), "{token}");
    let wrong = "0".repeat(32);
    for target in
        ["/", "/data", "/data?after=0", &format!("/?token={wrong}"), &format!("/data?token={}", &token[1..])]
    {
        let reply = view.send(&format!("GET {target} HTTP/1.1"));
        assert!(reply.starts_with("HTTP/1.1 403 Forbidden\r\n"), "{target}: {reply}");
        assert!(!reply.contains(&machine.name) && !reply.contains(&token), "{reply}");
    }
    for method in ["POST", "PUT", "DELETE"] {
        let reply = view.send(&format!("{method} /?token={token} HTTP/1.1"));
        assert!(reply.starts_with("HTTP/1.1 405 "), "{reply}");
    }
    let page = view.send(&format!("GET /?token={token} HTTP/1.1"));
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n") && page.contains(&machine.name));
    assert!(!page.contains(&token), "a saved page has no token");
    // It is in no list of processes, and each start has another one.
    let line = fs::read_to_string(format!("/proc/{}/cmdline", view.process.id())).unwrap();
    assert!(!line.contains(&token));
    let of_tool = View::start(&machine, &["--tool", "tip"]);
    assert_ne!(of_tool.token, token);
    let words = "\"coordinates\":\"coordinates of tip in the base frame\"";
    let page_of_tool = of_tool.send(&format!("GET /?token={} HTTP/1.1", of_tool.token));
    assert_eq!([&page, &page_of_tool].map(|page| page.contains(words)), [false, true]);
    // A browser that says nothing does not hold it up, and it stops in order.
    let _silent: Vec<_> =
        (0..8).map(|_| TcpStream::connect(format!("127.0.0.1:{}", view.port)).unwrap()).collect();
    assert_eq!(view.data(0)["length_s"], 0.0);
    view.process.must_run();
    view.process.stops_on("INT", HANG);
}

#[test]
#[ignore = "second tier: needs Chromium"]
#[apply(beside_others)]
fn a_running_machine_is_shown_also_after_the_daemon_has_started_again() {
    let Trio { setpoints, mut daemon, plant, recorder, machine } = Trio::in_motion("view-live");
    let view = View::start(&machine, &[]);
    let data = view.until("an active platform", |data| {
        states(data) == ["active"]
            && data["first"].as_u64() == Some(0)
            && data["silence"] == ""
            && data["samples"].as_str().unwrap().len() > 90_000
    });
    assert_eq!(data["step_s"], 0.01);
    let later = view.data(40);
    assert_eq!(later["first"], 40);
    if let Some(browser) = Browser::find() {
        let found = browser_shows(&browser, &view);
        assert!(found["samples"].as_u64().unwrap() > 100 && found["error"].is_null(), "{found}");
        assert_eq!(
            (found["charts"].as_u64(), found["state"].as_str()),
            (Some(18), Some("active")),
            "{found}"
        );
        assert!(found["age"].as_str().unwrap().starts_with("live, newest data 0."), "{found}");
        assert_eq!([&found["alert"], &found["opacity"]], ["", "1"], "{found}");
    }
    let run = view.data(0)["run"].as_u64().unwrap();
    let silent = |words: &str| view.until(words, |data| data["silence"].as_str().unwrap().contains(words));
    daemon.hold();
    silent(&format!("the daemon (process {}) sends nothing: it is starting, paused", daemon.id()));
    daemon.kill();
    let data = silent("no daemon of ");
    assert!(data["age_s"].as_f64().unwrap() > 1.0 && states(&data).contains(&"active"), "{data}");
    if let Some(browser) = Browser::find() {
        let found = browser_shows(&browser, &view);
        let [age, alert] = ["age", "alert"].map(|key| found[key].as_str().unwrap());
        assert!(age.starts_with("not live, no new data for "), "{found}");
        let since = alert.strip_prefix("No new data since ").and_then(|rest| rest.get(..10)).unwrap();
        let digits = since.replace(|it: char| it.is_ascii_digit(), "0");
        assert!(digits == "00:00:00: " && alert.contains("it has ended, was killed"), "{found}");
        assert_eq!((found["opacity"].as_str(), found["error"].as_str()), (Some("0.45"), None), "{found}");
    }
    drop(setpoints);
    let daemon = start_daemon(&machine);
    let setpoints = start_setpoints(&machine);
    engage(&machine);
    let data = view.until("the second daemon", |data| {
        data["run"].as_u64() > Some(run) && states(data).contains(&"active") && data["silence"] == ""
    });
    assert!(states(&data).len() < 8, "{:?}", states(&data));
    if let Some(browser) = Browser::find() {
        let found = browser_shows(&browser, &view);
        assert_eq!([&found["alert"], &found["opacity"]], ["", "1"], "{found}");
    }
    view.process.stops();
    drop((setpoints, daemon, plant, recorder));
}

#[test]
#[apply(beside_others)]
fn simulated_time_that_stands_still_is_said() {
    let machine = Machine::with("view-simulated", "[realtime]\nrelease = \"lockstep\"");
    let view = View::start(&machine, &[]);
    let [plant, _daemon] = ["plant", "run"].map(|command| Hexad::start::<&str>(&machine, command, &[]));
    let _source = start_setpoints(&machine);
    view.until("simulated time", |data| data["length_s"].as_f64() > Some(0.5) && data["silence"] == "");
    plant.hold();
    view.until("that it stands still", |data| {
        data["silence"].as_str().unwrap().starts_with("simulated time stands still")
    });
}

/// Result that the live page leaves in the document by itself.
fn browser_shows(browser: &Browser, view: &View) -> Value {
    browser
        .open(&format!("http://127.0.0.1:{}/?token={}", view.port, view.token), "--virtual-time-budget=8000")
}
