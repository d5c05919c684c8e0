//! Plan of a `goto`: the target, and the whole motion to it, computed before anything moves.

use super::order::GotoOrder;
use super::tool_stream::ToolStream;
use crate::target_source::{Observation, TargetError, is_reached, reachable_target, reason};
use hexad_core::control::constants::Constants;
use hexad_core::control::supervision::in_position::InPositionWindow;
use hexad_core::model::task::pose_of;
use hexad_core::motion::tool_path::ToolPath;
use hexad_machine::analysis::target_motion::{TargetMotion, TargetRefusal, target_motion};
use hexad_machine::analysis::tool_motion::ToolMotion;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::coordinate_rows::CoordinateFormat;
use hexad_machine::text::units::MotionUnits;

/// Motion to a target.
#[derive(Clone, Debug)]
pub struct GotoPlan {
    /// X of the platform before and after.
    pub from: [f64; 6],
    /// See [`Self::from`].
    pub to: [f64; 6],
    /// Its duration and largest quantities.
    pub motion: TargetMotion,
    /// Setpoints along the straight path of a tool; `None` if the reference chooses the path.
    pub stream: Option<ToolStream>,
}

impl GotoPlan {
    /// Plans from the observed platform. A motion from a target that is reached begins there, without the noise of its
    /// measurement. `go_on` says whether to go on.
    pub fn new(
        config: &Config,
        constants: &Constants,
        order: &GotoOrder,
        coordinates: &Coordinates,
        is_straight: bool,
        seen: &Observation,
        go_on: impl Fn() -> bool,
    ) -> Result<Self, TargetError> {
        let x = seen.reference_or_measured_x.ok_or_else(|| TargetError::UnknownPose(reason(&seen.text)))?;
        let held = reachable_target(constants, seen).unwrap_or(x);
        let from = if is_reached(&x, &held) { held } else { x };
        let base = if order.home { config.machine.home } else { held };
        let mut wanted = coordinates.tool_x(&base);
        for (x, given) in wanted.iter_mut().zip(order.target) {
            *x = given.map_or(*x, |given| if order.relative { *x + given } else { given });
        }
        let to = coordinates.platform_x(&wanted);
        let refused = |refusal: TargetRefusal| match coordinates.is_empty() {
            _ if refusal == TargetRefusal::Interrupted => TargetError::Refused(refusal),
            true => TargetError::Refused(refusal),
            false => TargetError::RefusedInFrames(refusal, both_coordinates(config, coordinates, &to)),
        };
        let poses = [from, to].map(|x| pose_of(&x));
        let [start, end] = &poses;
        if !is_straight {
            let motion =
                target_motion(constants, start, end, order.speed_share, |_, _| go_on()).map_err(refused)?;
            return Ok(Self { from, to, motion, stream: None });
        }
        let path = ToolPath::new(coordinates.frames(), start, end);
        let fastest = ToolMotion::fastest(constants, path, order.speed_share).map_err(refused)?;
        let stream = ToolStream::new(config, fastest, go_on)?;
        Ok(Self { from, to, motion: stream.motion().survey(constants), stream: Some(stream) })
    }
}

/// When the platform counts as arrived.
pub fn window(config: &Config, wanted_m: Option<f64>) -> InPositionWindow {
    let InPositionWindow { tolerance_m, tolerance_rad, settling_ns } = config.deployment.in_position;
    let wanted_m = wanted_m.unwrap_or(tolerance_m);
    let tolerance_rad = tolerance_rad * wanted_m / tolerance_m;
    InPositionWindow { tolerance_m: wanted_m, tolerance_rad, settling_ns }
}

/// X of the platform in the base frame and of the tool in the work frame, below a refusal, whose bounds are of the first.
fn both_coordinates(config: &Config, coordinates: &Coordinates, platform: &[f64; 6]) -> String {
    let format = CoordinateFormat::new(MotionUnits::default(), config.resolution());
    let table = |label: &str, x: [f64; 6]| format.table(label, &[("target", Some(x), 0)]);
    let text = table("coordinates of the platform in the base frame", *platform)
        + &table(&coordinates.label, coordinates.tool_x(platform));
    text.trim_end().into()
}
