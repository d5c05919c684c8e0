//! Target moved by keys. It leads the reference by at most the reference's stopping distance, and stays in
//! the workspace.

use crate::analysis::target_motion::{TargetRefusal, WorkspaceBound, check_target};
use crate::commands::coordinates::Coordinates;
use crate::commands::jog::keys::Key;
use crate::commands::target::pose_of;
use crate::control::constants::Constants;
use crate::control::signals::limits::DerivativeLimits;
use crate::model::rigid::Pose;
use crate::output::numbers::MotionDigits;

/// Velocities, as shares of the velocity of autonomous motions.
const SHARES: [f64; 7] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0];
const FIRST_SHARE: usize = 3;

/// Steps of a coordinate, over the last digit that is shown of it.
const STEPS: [f64; 4] = [1e1, 1e2, 1e3, 1e4];
const FIRST_STEP: usize = 2;

/// Age of the reference that is compared with the target \[s\]. It comes from a status report; this is twice
/// the report interval.
const REFERENCE_AGE_S: f64 = 0.15;

/// Motion of the target by a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// While keys arrive, with this velocity of position and of angles \[m/s\], \[rad/s\].
    Continuous([f64; 2]),
    /// One step per key \[m\], \[rad\].
    Step([f64; 2]),
}

/// Target of a jog.
pub struct JogTarget<'a> {
    constants: &'a Constants,
    digits: MotionDigits,
    coordinates: &'a Coordinates,
    /// X of the tool in the work frame.
    x: [f64; 6],
    is_continuous: bool,
    share: usize,
    step: usize,
    /// The last bound that stopped the target.
    blocked: Option<WorkspaceBound>,
}

impl<'a> JogTarget<'a> {
    /// Target at X of the platform, in continuous motion. Keys move the tool.
    pub fn new(
        constants: &'a Constants,
        coordinates: &'a Coordinates,
        digits: MotionDigits,
        platform: [f64; 6],
    ) -> Self {
        let x = coordinates.tool_x(&platform);
        Self {
            constants,
            coordinates,
            digits,
            x,
            is_continuous: true,
            share: FIRST_SHARE,
            step: FIRST_STEP,
            blocked: None,
        }
    }

    /// X of the platform.
    pub fn x(&self) -> [f64; 6] {
        self.coordinates.platform_x(&self.x)
    }

    pub fn blocked(&self) -> Option<&WorkspaceBound> {
        self.blocked.as_ref()
    }

    pub fn pace(&self) -> Pace {
        if self.is_continuous { Pace::Continuous(self.velocities()) } else { Pace::Step(self.steps()) }
    }

    fn velocities(&self) -> [f64; 2] {
        let limits = &self.constants.parameters.limits;
        let share = limits.autonomous_scale * SHARES.get(self.share).copied().unwrap_or_default();
        [share * limits.position.velocity, share * limits.orientation.velocity]
    }

    /// Step of a position \[m\] and of an angle \[rad\].
    fn steps(&self) -> [f64; 2] {
        let step = STEPS.get(self.step).copied().unwrap_or_default();
        let MotionDigits { mm, deg } = self.digits;
        let [position_mm, angle_deg] = [mm, deg].map(|digits| step * 0.1_f64.powi(digits as i32));
        [1e-3 * position_mm, angle_deg.to_radians()]
    }

    /// Applies a key. Returns the key if the motion continues while it is held.
    pub fn press(&mut self, key: Key, reference: &Pose) -> Option<Key> {
        match (key, self.is_continuous) {
            (Key::Move { .. }, true) => return Some(key),
            (Key::Move { axis, sign }, false) => {
                let [position, angle] = self.steps();
                self.shift(axis, sign * if axis < 3 { angle } else { position }, reference);
            }
            (Key::Faster, true) => self.share = (self.share + 1).min(SHARES.len() - 1),
            (Key::Slower, true) => self.share = self.share.saturating_sub(1),
            (Key::Faster, false) => self.step = (self.step + 1).min(STEPS.len() - 1),
            (Key::Slower, false) => self.step = self.step.saturating_sub(1),
            (Key::Mode, _) => self.is_continuous = !self.is_continuous,
            (Key::Stop | Key::Leave, _) => {}
        }
        None
    }

    /// Moves a coordinate for a signed time \[s\].
    pub fn advance(&mut self, axis: usize, time_s: f64, reference: &Pose) {
        let [position, angle] = self.velocities();
        self.shift(axis, time_s * if axis < 3 { angle } else { position }, reference);
    }

    fn shift(&mut self, axis: usize, by: f64, reference: &Pose) {
        let mut x = self.x;
        if let Some(x) = x.get_mut(axis) {
            *x += by;
        }
        let pose = pose_of(&self.coordinates.platform_x(&x));
        let step = if self.is_continuous { 0.0 } else { by.abs() };
        if self.distance_ratio(reference, &pose, step) > 1.0 {
            return;
        }
        match check_target(self.constants, &pose) {
            Ok(()) => (self.x, self.blocked) = (x, None),
            Err(
                TargetRefusal::Target(bound) | TargetRefusal::Way { bound, .. } | TargetRefusal::Start(bound),
            ) => {
                self.blocked = Some(bound);
            }
        }
    }

    /// Distance of a target from the reference, as a ratio of the largest allowed. Allowed is the reference's
    /// stopping distance plus its motion since the report, at least one step.
    fn distance_ratio(&self, reference: &Pose, target: &Pose, step: f64) -> f64 {
        let limits = &self.constants.parameters.limits;
        let left = reference.displacement_to(target);
        let [position, angle] = self.velocities();
        let allowed = |velocity: f64, limits: &DerivativeLimits| {
            let DerivativeLimits { acceleration, jerk, .. } =
                limits.scaled(self.constants.parameters.limits.autonomous_scale);
            let braking =
                velocity * (REFERENCE_AGE_S + velocity / (2.0 * acceleration) + acceleration / jerk);
            braking.max(step) * (1.0 + 1e-9)
        };
        let linear = left.linear.norm() / allowed(position, &limits.position);
        linear.max(left.angular.norm() / allowed(angle, &limits.orientation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use crate::commands::target::constants;
    use crate::config::Config;

    const UP: Key = Key::Move { axis: 5, sign: 1.0 };

    #[test]
    fn a_target_stays_near_its_reference_and_in_the_workspace() {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let (constants, coordinates) = (constants(&config), Coordinates::default());
        let home = config.machine.home;
        let mut target =
            JogTarget::new(&constants, &coordinates, MotionDigits::new(config.resolution()), home);
        let reference = pose_of(&home);
        for _ in 0..10_000 {
            assert_eq!(target.press(UP, &reference), Some(UP));
            target.advance(5, 0.01, &reference);
        }
        // 10 % of 0.2 m/s, times the sum of 0.15 s, v / 2a and a / j.
        let ahead = target.x()[5] - home[5];
        assert!(ahead > 0.002 && ahead < 0.01, "{ahead} m ahead of a platform that does not move");
        assert!(target.blocked().is_none());
        // A platform that follows the target to the end of the workspace.
        for _ in 0..10_000 {
            let reference = pose_of(&target.x());
            target.advance(5, 0.01, &reference);
        }
        let end = pose_of(&target.x());
        assert!(check_target(&constants, &end).is_ok() && target.blocked().is_some());
        assert!(target.x()[5] - home[5] > 0.2, "{:?}", target.x());
    }

    #[test]
    fn a_step_is_one_step() {
        let config = Config::parse(DEFAULT_CONFIG, "a test").unwrap();
        let (constants, coordinates) = (constants(&config), Coordinates::default());
        let home = config.machine.home;
        let mut target =
            JogTarget::new(&constants, &coordinates, MotionDigits::new(config.resolution()), home);
        assert_eq!(target.press(Key::Mode, &pose_of(&home)), None);
        assert_eq!(target.press(Key::Faster, &pose_of(&home)), None);
        let Pace::Step([position, angle]) = target.pace() else { panic!("{:?}", target.pace()) };
        assert!((position - 1e-2).abs() < 1e-12 && (angle - 1.0_f64.to_radians()).abs() < 1e-12);
        assert_eq!(target.press(UP, &pose_of(&home)), None);
        assert!((target.x()[5] - home[5] - 1e-2).abs() < 1e-12);
        // The next step is possible when the platform has arrived.
        assert_eq!(target.press(UP, &pose_of(&home)), None);
        assert!((target.x()[5] - home[5] - 1e-2).abs() < 1e-12);
    }

    #[test]
    fn the_smallest_step_is_of_the_size_of_the_machine() {
        let files = [
            (DEFAULT_CONFIG, 1e-5),
            (include_str!("../../../tests/data/telescope_m2.toml"), 1e-6),
            (include_str!("../../../tests/data/piezo.toml"), 1e-8),
        ];
        for (text, step) in files {
            let config = Config::parse(text, "a test").unwrap();
            let (constants, coordinates) = (constants(&config), Coordinates::default());
            let home = config.machine.home;
            let mut target =
                JogTarget::new(&constants, &coordinates, MotionDigits::new(config.resolution()), home);
            for key in [Key::Mode, Key::Slower, Key::Slower, Key::Slower, UP] {
                assert_eq!(target.press(key, &pose_of(&home)), None);
            }
            assert!((target.x()[5] - home[5] - step).abs() < 1e-9 * step + 1e-15, "{step}: {:?}", target.x());
        }
    }
}
