//! Control mode: on which errors feedback acts, and with which terms of the dynamics.

/// Control mode: on which errors feedback acts, and with which terms of the dynamics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ControlMode {
    /// Inverse dynamics at the measured pose, with feedback on errors of the pose.
    #[default]
    ComputedTorque,
    /// Inverse dynamics of the desired motion, with feedback on errors of the legs.
    FeedforwardJointPd,
    /// Weight at the desired pose, with feedback on errors of the legs.
    GravityJointPd,
    /// Feedback on errors of the legs alone, without the dynamics.
    JointPd,
}

impl ControlMode {
    /// Every mode, in descending order of the terms of the model it uses.
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

    /// Whether its errors are those of the legs.
    pub fn acts_on_legs(self) -> bool {
        self != Self::ComputedTorque
    }

    /// Whether its forces include those that accelerate the platform along the reference.
    pub fn includes_inertia(self) -> bool {
        matches!(self, Self::ComputedTorque | Self::FeedforwardJointPd)
    }
}
