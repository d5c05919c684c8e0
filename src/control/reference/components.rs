//! Whether translation and rotation approach the target at once.
//!
//! At a bound that both together would violate, each alone may lead away from it: the limits of jerk turn the direction of
//! the first steps. So after a step that no verified stop allows, one of them waits, along the stop, for some steps.

/// Steps in which one component moves, before both are tried again.
const STEPS: u32 = 20;

/// Components that approach the target; after so many accepted steps.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "daemon", derive(serde::Serialize, serde::Deserialize))]
pub(super) enum Components {
    #[default]
    Both,
    Translation {
        steps: u32,
    },
    Rotation {
        steps: u32,
    },
}

impl Components {
    /// Those of the next step, after one that was accepted or not.
    pub fn after(self, is_accepted: bool) -> Self {
        match (self, is_accepted) {
            (Self::Both, true) => Self::Both,
            (Self::Both, false) => Self::Translation { steps: 0 },
            (Self::Translation { steps }, true) if steps < STEPS => Self::Translation { steps: steps + 1 },
            (Self::Translation { .. }, false) => Self::Rotation { steps: 0 },
            (Self::Rotation { steps }, true) if steps < STEPS => Self::Rotation { steps: steps + 1 },
            (Self::Translation { .. }, true) | (Self::Rotation { .. }, _) => Self::Both,
        }
    }
}
