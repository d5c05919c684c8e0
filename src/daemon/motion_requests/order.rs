//! A request for a motion, validated. Each error names field, value, bound and remedy.

use hexad_client::operator::motion_fields::{FrameField, GOTO, HOLD, JOG, RateFields, TargetFields};
use hexad_client::operator::protocol::RequestLine;
use hexad_core::control::signals::limits::Limits;
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::pose_of;
use hexad_core::motion::frames::Frames;
use hexad_core::motion::rotation_order::RotationOrder;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::config::frames::FrameKind;

/// Largest coordinate of a request \[m\], \[rad\]: beyond every machine.
const MAX_COORDINATE: f64 = 1000.0;

/// Bounds of `speed_share` and of `tolerance_m`.
const SPEED: [f64; 2] = [0.01, 1.0];
const TOLERANCE_M: [f64; 2] = [1e-9, 0.1];

/// Excess of a largest rate that is rounding.
const ROUNDING: f64 = 1e-9;

/// A motion with its coordinates.
#[derive(Clone, Debug)]
pub struct MotionOrder {
    /// The motion.
    pub kind: MotionKind,
    /// Coordinates of its numbers.
    pub coordinates: Coordinates,
    /// Whether it goes straight for the tool.
    pub is_straight: bool,
    /// Whether it takes control. A jog does not, because its next line would take control again after a stop.
    pub may_engage: bool,
}

/// What a request moves the platform to.
#[derive(Clone, Copy, Debug)]
pub enum MotionKind {
    /// To a target.
    Goto(GotoOrder),
    /// To rest.
    Hold,
    /// With these rates of the coordinates, while requests arrive \[rad/s\], \[m/s\].
    Jog([f64; 6]),
}

/// Target and options of `goto`.
#[derive(Clone, Copy, Debug)]
pub struct GotoOrder {
    /// Coordinates that are given \[rad\], \[m\].
    pub target: [Option<f64>; 6],
    /// Whether they are added to the target that is held, or to the pose of the platform if none is.
    pub relative: bool,
    /// Whether the others are taken from the home pose.
    pub home: bool,
    /// Share of the limits of autonomous motions.
    pub speed_share: f64,
    /// Distance at which the platform is in position \[m\]; `None` for the value of the machine file.
    pub tolerance_m: Option<f64>,
}

impl MotionOrder {
    /// Whether a request moves the platform.
    pub fn is_named(request: &str) -> bool {
        [GOTO, HOLD, JOG].contains(&request)
    }

    /// The motion of a line, with the frames and limits of a configuration.
    pub fn of_line(line: &RequestLine, config: &Config) -> Result<Self, String> {
        let motion = match line.request.as_str() {
            GOTO => MotionKind::Goto(goto(line)?),
            JOG => MotionKind::Jog(rates(line.rate, &config.deployment.limits.in_force())?),
            _ => MotionKind::Hold,
        };
        let (coordinates, is_straight) = (coordinates(line, config)?, line.tool.is_some());
        Ok(Self { kind: motion, coordinates, is_straight, may_engage: line.engage })
    }
}

fn goto(line: &RequestLine) -> Result<GotoOrder, String> {
    let target = line.target.unwrap_or_default().coordinates();
    let RequestLine { relative, home, tolerance_m, .. } = *line;
    if target == [None; 6] && !home {
        return Err("target: is missing; give coordinates, as {\"x_m\": 0.1}, or home".into());
    }
    if relative && home {
        return Err("relative and home: exclude each other; leave one out".into());
    }
    for (name, value) in TargetFields::NAMES.iter().zip(target) {
        let field = format!("target.{name}");
        check(&field, value, [-MAX_COORDINATE, MAX_COORDINATE], "send m and rad")?;
    }
    check("speed", line.speed, SPEED, "send a share of the limits of autonomous motions")?;
    check("tolerance_m", tolerance_m, TOLERANCE_M, "send a distance in m")?;
    Ok(GotoOrder { target, relative, home, speed_share: line.speed.unwrap_or(1.0), tolerance_m })
}

fn check(field: &str, value: Option<f64>, [low, high]: [f64; 2], remedy: &str) -> Result<(), String> {
    match value {
        Some(value) if !(low..=high).contains(&value) => {
            Err(format!("{field} = {value:?}: must be in [{low:?}, {high:?}]; {remedy}"))
        }
        _ => Ok(()),
    }
}

/// Rates within the velocities of autonomous motions.
fn rates(given: Option<RateFields>, limits: &Limits) -> Result<[f64; 6], String> {
    let rates = given.ok_or("rate: is missing; give rates, as {\"x_m_s\": 0.01}, or {} to rest")?.rates();
    let norm = |rates: &[f64]| rates.iter().map(|rate| rate * rate).sum::<f64>().sqrt();
    let (angular, linear) = rates.split_at(3);
    let largest = [limits.orientation.velocity, limits.position.velocity];
    let parts = [(angular, "alpha, beta, gamma", "rad/s"), (linear, "x, y, z", "m/s")];
    for ((rates, names, unit), largest) in parts.into_iter().zip(largest) {
        let (rate, bound) = (norm(rates), limits.autonomous_scale * largest);
        if !(rate <= bound * (1.0 + ROUNDING)) {
            return Err(format!(
                "rate: norm of {names} = {rate:?} {unit}: must be at most {bound:?} {unit} \
                 (limits.velocity, limits.scale, limits.autonomous_scale); send a smaller rate"
            ));
        }
    }
    Ok(rates)
}

fn coordinates(line: &RequestLine, config: &Config) -> Result<Coordinates, String> {
    let name = line.rotation.as_deref().unwrap_or(RotationOrder::Xyz.name());
    let order = RotationOrder::by_name(name).ok_or_else(|| {
        let names = RotationOrder::ALL.map(RotationOrder::name).join(", ");
        format!("rotation = {name:?}: must be one of {names}")
    })?;
    let default = Frames::default();
    let tool = frame(&line.tool, FrameKind::Tool, config, default.tool)?;
    let work = frame(&line.work, FrameKind::Work, config, default.work)?;
    let is_given = line.tool.is_some() || line.work.is_some();
    let names = [name_of(&line.tool), name_of(&line.work)];
    Ok(Coordinates::new(config, is_given.then_some(Frames { work, tool }), names, order))
}

fn frame(
    field: &Option<FrameField>,
    kind: FrameKind,
    config: &Config,
    default: Pose,
) -> Result<Pose, String> {
    match field {
        None => Ok(default),
        Some(FrameField::Pose(x)) => {
            for value in x {
                check(kind.name(), Some(*value), [-MAX_COORDINATE, MAX_COORDINATE], "send rad and m")?;
            }
            Ok(pose_of(x))
        }
        Some(FrameField::Named(name)) => {
            let names = if kind == FrameKind::Tool { (Some(&**name), None) } else { (None, Some(&**name)) };
            let frames = config.frames_named(names.0, names.1).map_err(|error| error.to_string())?;
            Ok(if kind == FrameKind::Tool { frames.tool } else { frames.work })
        }
    }
}

fn name_of(field: &Option<FrameField>) -> Option<&str> {
    field.as_ref().map(|field| match field {
        FrameField::Named(name) => name,
        FrameField::Pose(_) => "the given frame",
    })
}
