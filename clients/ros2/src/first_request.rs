//! Fast repair of a new client's first request.
//!
//! A client of Fast DDS may send its request before rustdds has matched the client's writer; rustdds discards the request. The
//! ACKNACK that rustdds sends at the match has base 1. Fast DDS answers at once only to base 0, else after its heartbeat period
//! of 3 s. After a heartbeat rustdds requests missing samples at once. So the bridge sends a heartbeat to itself.

use std::io;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::Duration;

use ros2_client::dds::rustdds::{DomainParticipant, GUID};

/// Prefix of the DDS topics with requests of ROS 2 services.
const REQUEST_TOPICS: &str = "rq/";

/// Time after the last event until the heartbeat is repeated: Fast DDS ignores requests while it still sends the sample.
const REPETITION_DELAY: Duration = Duration::from_millis(20);

/// Starts a thread that repairs first requests after each event of discovery that the returned sender signals.
pub fn repair_first_requests(participant: DomainParticipant) -> io::Result<Sender<()>> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    // Port of user traffic (RTPS 9.6.2.3).
    let port = 7411 + 250 * participant.domain_id() + 2 * participant.participant_id();
    socket.connect((Ipv4Addr::LOCALHOST, port))?;
    let (sender, events) = channel();
    thread::spawn(move || {
        while events.recv().is_ok() {
            send_heartbeats(&participant, &socket, 1);
            while events.recv_timeout(REPETITION_DELAY).is_ok() {
                send_heartbeats(&participant, &socket, 1);
            }
            send_heartbeats(&participant, &socket, 2);
        }
    });
    Ok(sender)
}

/// Sends a heartbeat for each client's writer. rustdds ignores one whose `count` is not above the last one of the writer.
fn send_heartbeats(participant: &DomainParticipant, socket: &UdpSocket, count: u8) {
    for writer in participant.discovered_writers() {
        if writer.publication_topic_data.topic_name.starts_with(REQUEST_TOPICS) {
            // If it is lost, the heartbeat of the client remains.
            let _ = socket.send(&first_heartbeat(writer.writer_proxy.remote_writer_guid, count));
        }
    }
}

/// RTPS message: header without a participant, INFO_SRC, and HEARTBEAT of the samples 1 to 1.
fn first_heartbeat(writer: GUID, count: u8) -> Vec<u8> {
    let id = writer.to_bytes();
    let (participant, writer) = id.split_at(12);
    [
        &b"RTPS\x02\x04\0\0"[..],
        &[0; 12],
        b"\x0c\x01\x14\0\0\0\0\0\x02\x04\0\0",
        participant,
        b"\x07\x03\x1c\0\0\0\0\0",
        writer,
        b"\0\0\0\0\x01\0\0\0\0\0\0\0\x01\0\0\0",
        &[count, 0, 0, 0],
    ]
    .concat()
}
