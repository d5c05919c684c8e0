//! A client that reads the state, takes control, moves and stops the platform, over QUIC and over TLS.

use crate::{CABLE, Cell};

#[test]
fn eclipse_zenoh_reads_engages_moves_and_stops() {
    for endpoint in [CABLE, "tls/10.77.1.1:7447"] {
        let Some(mut cell) = Cell::open("moves") else { return };
        cell.start(endpoint);
        cell.start_client("moves", endpoint, "studio");
        if !cell.reaches("moves", "end of moves") {
            return;
        }
        eprintln!("{endpoint}\n{}", cell.hosts.log("moves"));
        // The daemon names the remote side.
        let log = cell.hosts.log("daemon");
        let request = log.lines().find(|line| line.contains("request: stop")).unwrap();
        assert!(request.contains("remote=\"studio\""), "{request}");
    }
}

#[test]
fn a_request_right_after_the_connection_is_answered() {
    let Some(mut cell) = Cell::open("hurried") else { return };
    cell.start(CABLE);
    cell.start_client("hurried", CABLE, "studio");
    cell.reaches("hurried", "end of hurried");
}

#[test]
fn a_motion_ends_with_the_token_of_its_client() {
    let Some(mut cell) = Cell::open("motions") else { return };
    cell.start(CABLE);
    cell.start_client("motions", CABLE, "studio");
    if cell.reaches("motions", "end of motions") {
        cell.hosts.wait_for("bridge", "has ended, and with it its motion");
    }
}

#[test]
fn a_motion_ends_with_its_session_and_only_with_it() {
    let Some(mut cell) = Cell::open("sessions") else { return };
    cell.start(CABLE);
    cell.start_client("sessions", CABLE, "studio");
    cell.reaches("sessions", "end of sessions");
}

#[test]
fn a_killed_bridge_is_a_lost_source() {
    let Some(mut cell) = Cell::open("killed") else { return };
    cell.start(CABLE);
    cell.start_client("follows", CABLE, "studio");
    if cell.reaches("follows", "began") {
        cell.hosts.kill("bridge");
        // What the state chart says of a source that ends in motion (docs/operator.md).
        cell.hosts.wait_for("daemon", "code=11");
    }
}
