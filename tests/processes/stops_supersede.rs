//! After a confirmed stop nothing takes control that was asked for before it, wherever it waited; and each request has one answer.

use std::time::Instant;

use serde_json::json;

use crate::support::children::Hexad;
use crate::support::machine::{Machine, PATIENT};
use crate::support::operator::{clear, does};
use crate::support::recorder::Recorder;
use crate::support::rules;
use crate::support::socket::Client;
use crate::support::trio::{Trio, player_ended, start_daemon, start_plant};

const WHY: &str =
    "a stop came after it was asked for, or the daemon began anew; ask again if it is still wanted";

fn waiting_player(machine: &Machine) -> Hexad {
    let player =
        Hexad::start(machine, "move", &["--engage", "--motion", "sines", "--seconds", "1", "--within", "40"]);
    player.says("waiting: the pose of the platform is unknown: ");
    player
}

/// The ways of a person to stop, without a measurement.
fn stop_by(way: &str, machine: &Machine, daemon: &Hexad) {
    match way {
        "SIGUSR2" => daemon.signal("USR2"),
        "park" => {
            drop(machine.hexad("park", &["--within", "1"]).fails(1, "park was refused: no measurement"))
        }
        "estop" => {
            does(machine, "estop", &[], &["fault"]);
            clear(machine);
        }
        way => does(machine, way, &[], &["off"]),
    }
}

/// The player waits because the driver has not started. Whether it sees the stop while it waits, or is held until the driver
/// runs: it moves nothing.
#[test]
#[apply(beside_others)]
fn who_waits_for_a_driver_hears_every_stop() {
    let machine = Machine::patient("heard");
    let recorder = Recorder::start(&machine.name);
    let daemon = start_daemon(&machine);
    daemon.says("off: no measurement");
    let mut held = vec![];
    for way in ["park", "SIGUSR2", "off", "stop", "estop"] {
        let sees = waiting_player(&machine);
        // The topic has places for four.
        if held.len() < 3 {
            held.push(waiting_player(&machine));
        }
        held.iter().for_each(Hexad::hold);
        stop_by(way, &machine, &daemon);
        sees.ends().fails(1, WHY);
    }
    let plant = start_plant(&machine);
    daemon.says("standby: ");
    for player in held {
        player.signal("CONT");
        player.ends().fails(1, WHY);
    }
    daemon.stops();
    plant.stops();
    let recording = recorder.finish();
    rules::hold(&recording);
    assert!(recording.forces.iter().all(|force| force.valid == 0), "nothing has taken control");
}

/// The daemon has begun anew since the player was asked to move: a stop of its last life counts, too.
#[test]
#[apply(beside_others)]
fn a_new_daemon_obeys_nothing_that_was_asked_of_the_last_one() {
    let machine = Machine::patient("anew");
    let daemon = start_daemon(&machine);
    daemon.says("off: no measurement");
    let player = waiting_player(&machine);
    player.hold();
    does(&machine, "stop", &[], &["off"]);
    daemon.stops();
    let (daemon, plant) = (start_daemon(&machine), start_plant(&machine));
    daemon.says("standby: no setpoint");
    player.signal("CONT");
    player.ends().fails(1, WHY);
    daemon.stops();
    plant.stops();
}

/// The request with a number that is not the newest is refused, and any line that asks for a stop is one.
#[test]
#[apply(beside_others)]
fn a_stop_needs_no_number_and_no_right_form() {
    let mut trio = Trio::in_motion("any-form");
    let mut client = Client::connect(&trio.daemon);
    let number = |client: &mut Client| client.ask("status", &json!({}))["status"]["stops"].clone();
    let before = number(&mut client);
    client.send("{\"version\": 7, \"request\": \"stop\", \"id\": 3, \"gently\": true}\n");
    let answer = client.answer();
    assert_eq!((&answer["id"], &answer["result"]), (&json!(3), &json!("accepted")), "{answer}");
    trio.daemon.says("standby: requested by the operator");
    trio.setpoints.take().into_iter().for_each(player_ended);
    let after = number(&mut client);
    assert_eq!(after["count"], json!(before["count"].as_u64().unwrap() + 1));
    for (stops, result) in [(&before, "superseded"), (&after, "refused")] {
        let answer = client.ask("engage", &json!({"stops": stops, "id": 4}));
        assert_eq!((&answer["id"], answer["result"].as_str()), (&json!(4), Some(result)), "{answer}");
    }
    let answer = client.ask("engage", &json!({"id": 5, "gently": true}));
    assert_eq!((&answer["id"], answer["result"].as_str()), (&json!(5), Some("invalid")), "{answer}");
    drop(client);
    trio.finish();
}

/// Answers come in another order than requests; each has the number of its request, and there is one for each.
#[test]
#[apply(beside_others)]
fn each_request_has_one_answer_with_its_number() {
    let trio = Trio::standing(Machine::patient("numbers"));
    let mut client = Client::connect(&trio.daemon);
    // Waits for setpoints until the next one replaces it.
    let waits = json!({"wait": true, "until_ready": true, "within_s": 40.0});
    let requests = [
        ("engage", waits.clone()),
        ("status", json!({})),
        ("goto", json!({"target": {}})),
        ("dance", json!({})),
        ("engage", waits),
        ("reload", json!({})),
        ("reload", json!({})),
        ("record", json!({})),
        ("goto", json!({"target": {"x_m": 1.2}, "wait": true})),
        ("park", json!({"wait": true})),
        ("stop", json!({"wait": true})),
    ];
    for (id, (name, more)) in requests.iter().enumerate() {
        let mut line = more.clone();
        line["id"] = json!(id);
        client.request(name, &line);
    }
    let mut answered: Vec<_> = (0..requests.len()).map(|_| client.answer()).collect();
    let last = client.ask("status", &json!({"id": requests.len()}));
    assert_eq!(last["id"], json!(requests.len()), "no further answer: {last}");
    answered.sort_by_key(|answer| answer["id"].as_u64());
    for (id, (answer, (name, _))) in answered.iter().zip(&requests).enumerate() {
        assert_eq!(answer["id"], json!(id), "{answered:?}");
        let named = answer["request"].as_str().unwrap();
        assert!(named == *name || named.is_empty(), "{answer} to {name}");
    }
    let results: Vec<_> = answered.iter().map(|answer| answer["result"].as_str().unwrap()).collect();
    assert_eq!(&results[..4], ["superseded", "done", "invalid", "invalid"], "{answered:?}");
    assert_eq!(results[4], "superseded");
    drop(client);
    trio.finish();
}

/// At a slow speed the plan of a motion takes long. It ends with its request, or with a stop, and not only when it is complete.
#[test]
#[apply(beside_others)]
fn a_plan_ends_with_its_request() {
    let trio =
        Trio::standing(Machine::with("plan", &("[limits]\nvelocity_m_s = 0.001\n".to_owned() + PATIENT)));
    let mut client = Client::connect(&trio.daemon);
    let goto = |x_m: f64| json!({"target": {"x_m": x_m}, "speed": 0.01, "wait": true, "engage": true});
    let answer = client.ask("goto", &goto(1.2));
    let text = answer["text"].as_str().unwrap();
    assert_eq!(answer["result"], "invalid", "{answer}");
    assert!(
        text.starts_with("the motion takes ") && text.contains("bound 3600 s; raise the speed"),
        "{text}"
    );
    let began = Instant::now();
    trio.machine.hexad("goto", &["--x", "1.103m", "--speed", "1%", "--dry-run"]).succeeds();
    let whole = began.elapsed();
    for request in ["stop", "hold"] {
        // The host can hold one of them.
        let shortest = (0..3).map(|_| {
            client.request("goto", &goto(1.103));
            let began = Instant::now();
            let answer = client.ask(request, &json!({"wait": true}));
            let superseded = (&json!("goto"), &json!("superseded"));
            assert_eq!((&answer["request"], &answer["result"]), superseded, "{answer}");
            assert_eq!(client.answer()["request"], request);
            began.elapsed()
        });
        let shortest = shortest.min().unwrap();
        assert!(3 * shortest < whole, "{request} has taken {shortest:?} of a plan of {whole:?}");
    }
    drop(client);
    trio.finish();
}
