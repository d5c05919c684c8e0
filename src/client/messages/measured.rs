//! The measured message.

use iceoryx2::prelude::ZeroCopySend;

use super::layout::message;
use hexad_core::control::signals::inputs::DriveStatus;
use hexad_core::control::signals::inputs::Measurement;

message! {
    /// Measured leg lengths and rates, and optionally a measured pose.
    MeasuredMessage = "hexad_measured" on "measured" schema 7 {
        /// Schema version, publisher, sequence number and time stamp.
        header: super::Header,
        /// L.
        length_m: [f64; 6] ["m"],
        /// L'; used if `rates_valid`.
        length_rate_m_s: [f64; 6] ["m/s"],
        /// 1 if `x` and `twist` are those of a sensor of their own (a tracker, a second encoder), with which the daemon compares
        /// the lengths; 2 if they are the truth of a simulator, for those who record; else 0.
        pose_valid: u32,
        /// 1 if `length_rate_m_s` is filled in by a sensor of its own, else 0. The daemon then estimates the rates: it does so
        /// better than a driver that takes differences of lengths.
        rates_valid: u32,
        /// X.
        x: [f64; 6] ["rad, m"],
        /// omega, then v, base axes.
        twist: [f64; 6] ["rad/s, m/s"],
        /// What of the drives is filled in, a sum: 1 `drive_enabled`, 2 `brake_open`, 4 `drive_fault`, 8 `force_n`.
        drive_valid: u32,
        /// A bit for each drive that is enabled, the lowest for leg 1.
        drive_enabled: u32,
        /// A bit for each brake that is open.
        brake_open: u32,
        /// A bit for each drive with a fault. Bit 6: the bus to the drives failed, and the lengths are no measurement.
        drive_fault: u32,
        /// Forces that act; positive pushes the platform away from the base.
        force_n: [f64; 6] ["N"],
    }
}

impl From<&MeasuredMessage> for Measurement {
    fn from(message: &MeasuredMessage) -> Self {
        Self {
            time_ns: message.header.time_ns,
            length_m: message.length_m,
            rate_m_s: (message.rates_valid == 1).then_some(message.length_rate_m_s),
            pose: (message.pose_valid == 1).then_some(message.x),
            drives: DriveStatus {
                enabled: message.reported(1, message.drive_enabled),
                brake_open: message.reported(2, message.brake_open),
                fault: message.reported(4, message.drive_fault),
                force_n: message.reported(8, message.force_n),
            },
        }
    }
}

impl MeasuredMessage {
    /// A field of the drives, if its bit of `drive_valid` is set.
    fn reported<T>(&self, bit: u32, field: T) -> Option<T> {
        (self.drive_valid & bit != 0).then_some(field)
    }
}

impl From<&Measurement> for MeasuredMessage {
    fn from(measurement: &Measurement) -> Self {
        let drives = &measurement.drives;
        Self {
            length_m: measurement.length_m,
            length_rate_m_s: measurement.rate_m_s.unwrap_or_default(),
            rates_valid: u32::from(measurement.rate_m_s.is_some()),
            pose_valid: u32::from(measurement.pose.is_some()),
            x: measurement.pose.unwrap_or_default(),
            drive_valid: u32::from(drives.enabled.is_some())
                | u32::from(drives.brake_open.is_some()) << 1
                | u32::from(drives.fault.is_some()) << 2
                | u32::from(drives.force_n.is_some()) << 3,
            drive_enabled: drives.enabled.unwrap_or_default(),
            brake_open: drives.brake_open.unwrap_or_default(),
            drive_fault: drives.fault.unwrap_or_default(),
            force_n: drives.force_n.unwrap_or_default(),
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_measurement_contains_the_numbers_of_the_message() {
        let some = DriveStatus { enabled: Some(1), brake_open: None, fault: Some(3), force_n: None };
        let others = DriveStatus { enabled: None, brake_open: Some(2), fault: None, force_n: Some([4.0; 6]) };
        for (rate_m_s, drives) in [(None, some), (Some([7.0, 8.0, 9.0, 10.0, 11.0, 12.0]), others)] {
            let length_m = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
            let measurement = Measurement { time_ns: 42, length_m, rate_m_s, pose: rate_m_s, drives };
            let mut message = MeasuredMessage::from(&measurement);
            message.header.time_ns = 42;
            assert_eq!(Measurement::from(&message), measurement);
        }
    }

    #[test]
    fn a_pose_and_rates_count_only_where_their_mark_is_one() {
        for mark in [0, 2, u32::MAX] {
            let message = MeasuredMessage { rates_valid: mark, pose_valid: mark, ..Default::default() };
            let found = Measurement::from(&message);
            assert_eq!((found.rate_m_s, found.pose), (None, None), "{mark}");
        }
    }
}
