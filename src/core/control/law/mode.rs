//! Control mode: the errors that feedback acts on, and the terms of the dynamics that are added.

crate::named! {
    /// Control mode: the errors that feedback acts on, and the terms of the dynamics that are added.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum ControlMode {
        /// Inverse dynamics at the predicted pose; feedback on pose errors.
        #[default]
        ComputedTorque => "computed_torque",
        /// Inverse dynamics of the desired motion; feedback on leg errors.
        FeedforwardJointPd => "feedforward_joint_pd",
        /// Weight at the desired pose; feedback on leg errors.
        GravityJointPd => "gravity_joint_pd",
        /// Feedback on leg errors only, no dynamics.
        JointPd => "joint_pd",
    }
}

impl ControlMode {
    /// Whether feedback acts on leg errors.
    pub fn acts_on_legs(self) -> bool {
        self != Self::ComputedTorque
    }

    /// Whether the forces include the inertia forces of the reference motion.
    pub fn includes_inertia(self) -> bool {
        matches!(self, Self::ComputedTorque | Self::FeedforwardJointPd)
    }
}
