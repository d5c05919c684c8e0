//! Control mode: the errors that feedback acts on, and the terms of the dynamics that are added.

/// Control mode: the errors that feedback acts on, and the terms of the dynamics that are added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ControlMode {
    /// Inverse dynamics at the predicted pose; feedback on pose errors.
    #[default]
    ComputedTorque,
    /// Inverse dynamics of the desired motion; feedback on leg errors.
    FeedforwardJointPd,
    /// Weight at the desired pose; feedback on leg errors.
    GravityJointPd,
    /// Feedback on leg errors only, no dynamics.
    JointPd,
}

impl ControlMode {
    /// All modes, from the one that uses most terms of the model to the one that uses none.
    pub const ALL: [Self; 4] =
        [Self::ComputedTorque, Self::FeedforwardJointPd, Self::GravityJointPd, Self::JointPd];

    /// Name in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::ComputedTorque => "computed_torque",
            Self::FeedforwardJointPd => "feedforward_joint_pd",
            Self::GravityJointPd => "gravity_joint_pd",
            Self::JointPd => "joint_pd",
        }
    }

    /// Whether feedback acts on leg errors.
    pub fn acts_on_legs(self) -> bool {
        self != Self::ComputedTorque
    }

    /// Whether the forces include the inertia forces of the reference motion.
    pub fn includes_inertia(self) -> bool {
        matches!(self, Self::ComputedTorque | Self::FeedforwardJointPd)
    }
}
