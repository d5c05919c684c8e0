//! Change of coordinates between the platform in the base frame and a tool in a work frame: `hexad_core::motion::frames`.

use ::hexad_client::messages::SetpointMessage;
use ::hexad_core::model::rigid::{Acceleration, Motion, Pose, Twist};
use ::hexad_core::model::task::{TaskState, task_coordinates};
use ::hexad_core::motion::frames::Frames;

use crate::outcome::hexad_result::{self, HEXAD_INVALID, HEXAD_OK};
use crate::outcome::{Failure, guard};
use crate::{read, write};

/// A tool frame and a work frame, as [[frame]] of the machine file: X of their axes and origins. Zeros: the platform, the base.
#[allow(non_camel_case_types, reason = "a name of C")]
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct hexad_frames {
    /// The tool frame in the platform frame. [rad, m]
    pub tool: [f64; 6],
    /// The work frame in the base frame. [rad, m]
    pub work: [f64; 6],
}

/// Motion at one instant, of the platform in the base frame or of a tool in a work frame, in the axes of that frame.
#[allow(non_camel_case_types, reason = "a name of C")]
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct hexad_motion {
    /// X: alpha, beta, gamma, then the origin. [rad, m]
    pub x: [f64; 6],
    /// omega, then the velocity of the origin. [rad/s, m/s]
    pub twist: [f64; 6],
    /// omega', then the acceleration of the origin. [rad/s^2, m/s^2]
    pub acceleration: [f64; 6],
}

impl hexad_motion {
    fn motion(&self) -> Motion {
        Motion {
            pose: pose(&self.x),
            twist: Twist::from_vector(&self.twist.into()),
            acceleration: Acceleration::from_vector(&self.acceleration.into()),
        }
    }

    fn of(motion: &Motion) -> Self {
        Self {
            x: task_coordinates(&motion.pose, &[0.0; 6]),
            twist: motion.twist.vector().into(),
            acceleration: motion.acceleration.vector().into(),
        }
    }
}

fn pose(x: &[f64; 6]) -> Pose {
    TaskState::at_rest(*x).motion().pose
}

impl hexad_frames {
    fn frames(&self) -> Frames {
        Frames { tool: pose(&self.tool), work: pose(&self.work) }
    }
}

/// Motion of the tool in the work frame while the platform moves so in the base frame. The angles are those nearest to zero.
///
/// # Safety
///
/// `frames` is NULL or frames, `platform` is NULL or a motion, `tool` is NULL or room for one; both may be the same.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_tool_motion(
    frames: *const hexad_frames,
    platform: *const hexad_motion,
    tool: *mut hexad_motion,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let (frames, platform) = unsafe { (read(frames, "frames")?, read(platform, "platform")?) };
        let found = hexad_motion::of(&frames.frames().tool_motion(&platform.motion()));
        // SAFETY: the caller's promise.
        unsafe { write(tool, found, "tool") }.map(|()| HEXAD_OK)
    })
}

/// Motion of the platform in the base frame with which the tool moves so in the work frame: the inverse of hexad_tool_motion.
///
/// # Safety
///
/// `frames` is NULL or frames, `tool` is NULL or a motion, `platform` is NULL or room for one; both may be the same.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_platform_motion(
    frames: *const hexad_frames,
    tool: *const hexad_motion,
    platform: *mut hexad_motion,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let (frames, tool) = unsafe { (read(frames, "frames")?, read(tool, "tool")?) };
        let found = hexad_motion::of(&frames.frames().platform_motion(&tool.motion()));
        // SAFETY: the caller's promise.
        unsafe { write(platform, found, "platform") }.map(|()| HEXAD_OK)
    })
}

/// Fills in x, x_rate and x_accel of a setpoint, and leaves the rest. HEXAD_INVALID at beta = 90 deg, where angles have no rates.
///
/// # Safety
///
/// `motion` is NULL or a motion; `setpoint` is NULL or a message.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_setpoint_of_motion(
    motion: *const hexad_motion,
    setpoint: *mut SetpointMessage,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let (motion, message) =
            unsafe { (read(motion, "motion")?, read(setpoint.cast_const(), "setpoint")?) };
        let state = TaskState::of_motion(&motion.motion(), &motion.x).ok_or_else(|| {
            let [_, beta, ..] = motion.x;
            Failure::new(
                HEXAD_INVALID,
                format!("beta = {beta} rad must not be 90 deg, where angles have no rates; send poses"),
            )
        })?;
        let [x, x_rate, x_accel] = [state.x, state.xd, state.xdd].map(Into::into);
        // SAFETY: the caller's promise.
        unsafe { write(setpoint, SetpointMessage { x, x_rate, x_accel, ..message }, "setpoint") }
            .map(|()| HEXAD_OK)
    })
}

/// Motion of a setpoint: the inverse of hexad_setpoint_of_motion.
///
/// # Safety
///
/// `setpoint` is NULL or a message; `motion` is NULL or room for a motion.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_motion_of_setpoint(
    setpoint: *const SetpointMessage,
    motion: *mut hexad_motion,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let SetpointMessage { x, x_rate, x_accel, .. } = unsafe { read(setpoint, "setpoint") }?;
        let state = TaskState { x: x.into(), xd: x_rate.into(), xdd: x_accel.into() };
        let found = hexad_motion { x, ..hexad_motion::of(&state.motion()) };
        // SAFETY: the caller's promise.
        unsafe { write(motion, found, "motion") }.map(|()| HEXAD_OK)
    })
}
