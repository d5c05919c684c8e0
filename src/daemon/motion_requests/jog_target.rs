//! Target moved by requests. It leads the reference by at most the reference's stopping distance, and stays in
//! the workspace.

use hexad_core::control::constants::Constants;
use hexad_core::control::signals::limits::DerivativeLimits;
use hexad_core::model::rigid::{Pose, Twist};
use hexad_core::model::task::pose_of;
use hexad_machine::analysis::target_motion::{ExceededBound, check_target};
use hexad_machine::config::coordinates::Coordinates;

/// Age of the reference that is compared with the target \[s\]: of a snapshot on a busy host.
const REFERENCE_AGE_S: f64 = 0.05;

/// Share of the limit of velocity below which a target does not move: many times the rounding of a pose.
const STANDSTILL_SHARE: f64 = 1e-9;

/// Target of a jog.
pub struct JogTarget<'a> {
    constants: &'a Constants,
    /// X of the platform.
    x: [f64; 6],
    /// The last bound that stopped the target.
    blocked: Option<ExceededBound>,
}

impl<'a> JogTarget<'a> {
    /// Target at X of the platform.
    pub fn new(constants: &'a Constants, x: [f64; 6]) -> Self {
        Self { constants, x, blocked: None }
    }

    /// X of the platform.
    pub fn x(&self) -> [f64; 6] {
        self.x
    }

    /// The bound that stops the target.
    pub fn blocked(&self) -> Option<ExceededBound> {
        self.blocked
    }

    /// Moves the coordinates with rates for a time \[s\], unless the target is too far ahead of the reference, or leaves the workspace.
    pub fn advance(&mut self, coordinates: &Coordinates, rates: &[f64; 6], time_s: f64, reference: &Pose) {
        let mut wanted = coordinates.tool_x(&self.x);
        wanted.iter_mut().zip(rates).for_each(|(x, rate)| *x += rate * time_s);
        let x = coordinates.platform_x(&wanted);
        let pose = pose_of(&x);
        let moved = pose_of(&self.x).displacement_to(&pose);
        if self.lead(reference, &pose, &moved, time_s) > 1.0 {
            return;
        }
        self.blocked = check_target(self.constants, &pose).err();
        if self.blocked.is_none() {
            self.x = x;
        }
    }

    /// Distance of a target from the reference, as a ratio of the largest allowed: the reference's stopping distance from the
    /// velocity of the target, plus its motion since the snapshot.
    fn lead(&self, reference: &Pose, target: &Pose, moved: &Twist, time_s: f64) -> f64 {
        let limits = &self.constants.parameters.limits;
        let ratio = |left: f64, moved: f64, limits: &DerivativeLimits| {
            let DerivativeLimits { acceleration, jerk, .. } =
                limits.scaled(self.constants.parameters.limits.autonomous_scale);
            let velocity = moved / time_s;
            // The other part does not move: it may be on its way.
            if !(velocity > STANDSTILL_SHARE * limits.velocity) {
                return 0.0;
            }
            left / (velocity * (REFERENCE_AGE_S + velocity / (2.0 * acceleration) + acceleration / jerk))
        };
        let left = reference.displacement_to(target);
        let linear = ratio(left.linear.norm(), moved.linear.norm(), &limits.position);
        linear.max(ratio(left.angular.norm(), moved.angular.norm(), &limits.orientation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants;
    use hexad_machine::config::Config;

    const MACHINE: &str = include_str!("../../../config/fried2008.toml");

    /// Upwards with a tenth of the velocity of autonomous motions.
    const UP: [f64; 6] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.02];

    #[test]
    fn a_target_stays_near_its_reference_and_in_the_workspace() {
        let config = Config::parse(MACHINE, "a test").unwrap();
        let (constants, coordinates) = (constants(&config), Coordinates::default());
        let home = config.machine.home;
        let mut target = JogTarget::new(&constants, home);
        let reference = pose_of(&home);
        for _ in 0..10_000 {
            target.advance(&coordinates, &UP, 0.01, &reference);
        }
        // 10 % of 0.2 m/s, times the sum of 0.05 s, v / 2a and a / j.
        let ahead = target.x()[5] - home[5];
        assert!(ahead > 0.001 && ahead < 0.004, "{ahead} m ahead of a platform that does not move");
        assert!(target.blocked().is_none());
        // A platform that follows the target to the end of the workspace.
        for _ in 0..10_000 {
            let reference = pose_of(&target.x());
            target.advance(&coordinates, &UP, 0.01, &reference);
        }
        let end = pose_of(&target.x());
        assert!(check_target(&constants, &end).is_ok() && target.blocked().is_some());
        assert!(target.x()[5] - home[5] > 0.2, "{:?}", target.x());
    }

    /// The platform is still on its way to the orientation of an earlier request.
    #[test]
    fn a_part_that_does_not_move_blocks_no_other() {
        let config = Config::parse(MACHINE, "a test").unwrap();
        let (constants, home) = (constants(&config), config.machine.home);
        let mut target = JogTarget::new(&constants, home);
        let mut behind = home;
        behind[2] -= 0.05;
        target.advance(&Coordinates::default(), &UP, 0.01, &pose_of(&behind));
        assert!(target.x()[5] > home[5], "{:?}", target.x());
    }
}
