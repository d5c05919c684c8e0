//! Whether the platform has arrived: within a tolerance of a setpoint that does not change, for a settling time.

use crate::model::rigid::Twist;

/// Section `[in_position]` of the machine file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InPositionWindow {
    /// Largest distance of C from the setpoint \[m\].
    pub tolerance_m: f64,
    /// Largest angle between the measured orientation and the orientation of the setpoint \[rad\].
    pub tolerance_rad: f64,
    /// Time for which both must hold \[ns\].
    pub settling_ns: u64,
}

impl InPositionWindow {
    /// Whether an error, setpoint minus measured pose, is within the tolerance.
    pub fn contains(&self, error: &Twist) -> bool {
        error.linear.norm() <= self.tolerance_m && error.angular.norm() <= self.tolerance_rad
    }
}

/// Observer of one platform. It only reports: no state of the controller depends on it.
#[derive(Clone, Copy, Debug, Default)]
pub struct InPosition {
    /// X of the setpoint.
    x: [f64; 6],
    /// Instant since which the platform has been within the tolerance of it \[ns\].
    since_ns: Option<u64>,
}

impl InPosition {
    /// Whether the platform is in position at an instant \[ns\]. `error` is the setpoint minus the measured pose while the
    /// setpoint is followed; `None` otherwise.
    pub fn update(
        &mut self,
        window: &InPositionWindow,
        time_ns: u64,
        x: &[f64; 6],
        error: Option<&Twist>,
    ) -> bool {
        let is_within = error.is_some_and(|error| window.contains(error));
        let since_ns = self.since_ns.filter(|_| self.x == *x).unwrap_or(time_ns);
        *self = Self { x: *x, since_ns: is_within.then_some(since_ns) };
        is_within && time_ns.saturating_sub(since_ns) >= window.settling_ns
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    const WINDOW: InPositionWindow =
        InPositionWindow { tolerance_m: 0.1, tolerance_rad: 0.2, settling_ns: 100 };
    const X: [f64; 6] = [1.0; 6];

    fn error(linear: f64, angular: f64) -> Twist {
        Twist { linear: Vector3::x() * linear, angular: Vector3::y() * angular }
    }

    #[test]
    fn it_is_in_position_after_the_settling_time_and_not_beyond_either_tolerance() {
        let mut observer = InPosition::default();
        let mut at = |time_ns, error: Option<Twist>| observer.update(&WINDOW, time_ns, &X, error.as_ref());
        let within = Some(error(0.1, 0.2));
        assert!(!at(1000, within) && !at(1099, within) && at(1100, within) && at(1200, within));
        for beyond in [Some(error(0.11, 0.0)), Some(error(0.0, 0.21)), Some(error(f64::NAN, 0.0)), None] {
            assert!(!at(1300, beyond) && !at(1400, within) && at(1500, within), "{beyond:?}");
        }
    }

    #[test]
    fn another_setpoint_begins_anew() {
        let mut observer = InPosition::default();
        let within = error(0.0, 0.0);
        let mut at = |time_ns, x| observer.update(&WINDOW, time_ns, &[x; 6], Some(&within));
        assert!(!at(1000, 1.0) && at(1100, 1.0) && !at(1101, 2.0) && !at(1200, 2.0) && at(1201, 2.0));
    }
}
