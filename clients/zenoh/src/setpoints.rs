//! Setpoints from Zenoh: the bytes, and the life of their source.

use std::collections::BTreeMap;

use hexad_bridge::rejection::Rejection;
use hexad_bridge::setpoint_relay::SetpointRelay;
use hexad_client::messages::cdr;
use hexad_client::messages::layout::Declared;
use hexad_client::messages::{Message, SetpointMessage};
use hexad_core::control::signals::inputs::{Setpoint, SetpointKind};
use hexad_core::model::task::TaskState;
use zenoh::bytes::ZBytes;

/// A setpoint as it has arrived.
pub struct Arrival {
    /// Name of the certificate of its source.
    pub client: String,
    /// Instant of the arrival \[ns\].
    pub arrival_ns: u64,
    /// Content, or why it is no setpoint.
    pub message: Result<SetpointMessage, Rejection>,
}

/// One life of a source: name of the certificate, and instant at which the source began.
type Life = (String, u64);

/// Setpoints of all sources, checked and relayed to the machine.
pub struct Setpoints<'a> {
    /// Relay to the machine.
    pub relay: SetpointRelay<'a, Life>,
    /// The newest life of each source.
    epochs: BTreeMap<String, u64>,
}

/// Reads a setpoint.
pub fn decode(payload: &ZBytes) -> Result<SetpointMessage, Rejection> {
    let size = cdr::HEADER.len() + size_of::<SetpointMessage>();
    if payload.len() != size {
        return Err(Rejection::Format(format!("it has {} bytes instead of {size}", payload.len())));
    }
    let bytes = payload.to_bytes();
    let message = cdr::content(&bytes).and_then(SetpointMessage::from_bytes);
    let message = message.ok_or_else(|| Rejection::Format("it is no CDR of this order of bytes".into()))?;
    let (schema, known) = (message.header.schema, SetpointMessage::SCHEMA);
    if schema != known {
        return Err(Rejection::Format(format!("its schema is {schema} instead of {known}")));
    }
    Ok(message)
}

impl<'a> Setpoints<'a> {
    /// Setpoints for a relay, without a source.
    pub fn new(relay: SetpointRelay<'a, Life>) -> Self {
        Self { relay, epochs: BTreeMap::new() }
    }

    /// Accepts a setpoint of the newest life of its source.
    pub fn add(&mut self, arrival: &Arrival) -> Result<(), Rejection> {
        let message = arrival.message.as_ref().map_err(Clone::clone)?;
        let (epoch, stamp_ns) = (message.header.epoch, message.header.time_ns as i64);
        let newest = self.epochs.get(&arrival.client).copied().unwrap_or(epoch);
        if epoch < newest {
            return Err(Rejection::PastEpoch(epoch, newest));
        }
        let life = (arrival.client.clone(), epoch);
        self.relay.add(&life, stamp_ns, arrival.arrival_ns, || {
            let setpoint = Setpoint::from(message);
            match setpoint.kind {
                SetpointKind::Motion => Ok((SetpointKind::Motion, setpoint.task, 0)),
                // Rates of a pose mean nothing, and need not be numbers.
                SetpointKind::Pose => Ok((SetpointKind::Pose, TaskState::at_rest(message.x), 0)),
                _ => Err(Rejection::Kind(message.kind)),
            }
        })?;
        self.epochs.insert(arrival.client.clone(), epoch);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use hexad_client::messages::Header;
    use hexad_client::messages::cdr::CdrWriter;
    use hexad_machine::config::Config;

    use super::*;
    use hexad_client::messages::source_clock::NoInstant;

    fn message(epoch: u64, stamp_ms: u64) -> SetpointMessage {
        let header = Header {
            schema: SetpointMessage::SCHEMA,
            epoch,
            time_ns: stamp_ms * 1_000_000,
            ..Header::default()
        };
        SetpointMessage { header, kind: 1, x: [0.0, 0.0, 0.0, 0.0, 0.0, 1.25], ..Default::default() }
    }

    #[test]
    fn bytes_of_another_size_order_or_schema_are_no_setpoint() {
        let bytes = |message: &SetpointMessage| CdrWriter::new(vec![]).bytes(message.bytes()).finish();
        let good = message(1, 1);
        assert_eq!(decode(&bytes(&good).into()), Ok(good));
        let mut swapped = bytes(&good);
        swapped[1] ^= 1;
        let old = SetpointMessage { header: Header { schema: 6, ..good.header }, ..good };
        for (bytes, words) in [
            (vec![0; 60_000], "it has 60000 bytes instead of 196"),
            (swapped, "order of bytes"),
            (bytes(&old), "its schema is 6 instead of 7"),
        ] {
            let error = decode(&bytes.into()).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn a_capture_that_is_replayed_is_rejected() {
        let text = include_str!("../../../config/motion_base.toml");
        let sections = "\n[setpoint]\non_violation = \"limit\"\n[timeouts]\nsetpoint_ms = 100\n";
        let config = Config::parse(&format!("{text}{sections}"), "a test").unwrap();
        let mut setpoints = Setpoints::new(SetpointRelay::new(&config));
        let mut add = |message, arrival_ms: u64| {
            let arrival =
                Arrival { client: "studio".into(), arrival_ns: arrival_ms * 1_000_000, message: Ok(message) };
            setpoints.add(&arrival)
        };
        assert_eq!(add(message(5, 100), 9000), Ok(()));
        assert_eq!(add(message(5, 110), 9010), Ok(()));
        // Of the same life, while it is followed and afterwards; of an earlier life.
        assert_eq!(add(message(5, 100), 9020), Err(Rejection::Clock(NoInstant::Late(100.0))));
        assert_eq!(add(message(5, 110), 9500), Err(Rejection::Clock(NoInstant::Repeated)));
        assert_eq!(add(message(4, 999), 9500), Err(Rejection::PastEpoch(4, 5)));
        assert_eq!(add(message(6, 1), 9500), Ok(()));
        let target = SetpointMessage { kind: 2, ..message(6, 2) };
        assert_eq!(add(target, 9510), Err(Rejection::Kind(2)));
    }
}
