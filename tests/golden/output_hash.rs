//! Hash of all bits of outputs, whatever the names of its types and fields.
//!
//! FNV-1a with 64 bits over 64-bit words, the lowest byte first: from 0xcbf29ce484222325, for each byte exclusive or, then times
//! 0x100000001b3. Words are the bits of an `f64` (every NaN is that of [`f64::NAN`], as processors and compilers choose its sign and
//! payload), integers, numbers of an enumeration; for an optional part 1 and its words, or 0. Matrices go column by column.

use hexad::control::controller::Output;
use hexad::control::sensing::localization::PlatformState;
use hexad::control::signals::diagnostic::Diagnostic;
use hexad::control::signals::errors::PoseError;
use hexad::control::signals::limits::LimitSet;
use hexad::control::signals::state::MessageId;
use hexad::model::rigid::{Acceleration, Motion, Pose, Twist, Wrench};

/// Hash of the outputs so far.
pub struct OutputHash(pub u64);

impl Default for OutputHash {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl OutputHash {
    /// Adds every field. A new field does not compile here: it is either added, which changes every hash, or named as left out
    /// with the reason.
    pub fn add(&mut self, output: &Output) {
        let Output {
            state,
            diagnostic,
            answered_message: MessageId { epoch, sequence },
            request_diagnostic,
            command_n,
            wrench_error: Wrench { torque, force: wrench_force },
            active_limits: LimitSet(limits),
            missed_measurements,
            missed_setpoints,
            platform,
            error,
            reference,
        } = output;
        self.word(*state as u64);
        self.diagnostic(diagnostic);
        self.word(*epoch);
        self.word(*sequence);
        self.diagnostic(request_diagnostic);
        self.numbers(command_n.iter().chain(torque).chain(wrench_force));
        self.word((*limits).into());
        self.word(*missed_measurements);
        self.word(*missed_setpoints);
        self.optional(platform.as_ref(), |hash, platform| {
            let PlatformState { pose, twist, condition, time_to_singularity_s } = platform;
            hash.pose(pose);
            hash.twist(twist);
            hash.numbers([condition, time_to_singularity_s]);
        });
        self.optional(error.as_ref(), |hash, PoseError { pose, twist }| {
            hash.twist(pose);
            hash.twist(twist);
        });
        self.optional(reference.as_ref(), |hash, Motion { pose, twist, acceleration }| {
            let Acceleration { angular, linear } = acceleration;
            hash.pose(pose);
            hash.twist(twist);
            hash.numbers(angular.iter().chain(linear));
        });
    }

    fn word(&mut self, word: u64) {
        for byte in word.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn numbers<'a>(&mut self, numbers: impl IntoIterator<Item = &'a f64>) {
        let numbers = numbers.into_iter().map(|number| if number.is_nan() { f64::NAN } else { *number });
        numbers.for_each(|number| self.word(number.to_bits()));
    }

    fn optional<T>(&mut self, part: Option<T>, add: impl FnOnce(&mut Self, T)) {
        self.word(part.is_some().into());
        if let Some(part) = part {
            add(self, part);
        }
    }

    fn diagnostic(&mut self, Diagnostic { code, value, bound, index }: &Diagnostic) {
        self.word(*code as u64);
        self.numbers([value, bound]);
        self.word((*index).into());
    }

    fn pose(&mut self, Pose { rotation, position }: &Pose) {
        self.numbers(rotation.iter().chain(position));
    }

    fn twist(&mut self, Twist { angular, linear }: &Twist) {
        self.numbers(angular.iter().chain(linear));
    }
}
