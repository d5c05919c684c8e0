//! What the stream looks like before anybody rides it: how far it goes, how fast, and whether its units can be right.

use nalgebra::Vector6;

use hexad_core::control::constants::Constants;
use hexad_core::control::signals::time::seconds_since_or_0;
use hexad_core::model::rigid::Twist;
use hexad_core::model::task::pose_of;
use hexad_machine::analysis::target_motion::{ExceededBound, check_target};
use hexad_machine::text::numbers::{AXES, axis_unit, percent, significant};

/// Shortest stream of which units are judged \[s\].
const LEAST_S: f64 = 2.0;

/// Longest time between two poses whose difference counts as a velocity \[s\].
const MAX_STEP_S: f64 = 0.25;

/// Fewest poses by which they are judged.
const LEAST_POSES: f64 = 9.0;

/// Largest share of poses outside of the workspace that is a matter of scale, not of units.
const MAX_OUTSIDE: f64 = 0.05;

/// Poses of a stream, the newest with the most weight.
#[derive(Clone, Debug, Default)]
pub struct StreamSurvey {
    /// Time after which a pose has lost most of its weight \[s\].
    memory_s: f64,
    poses: f64,
    last: Option<(u64, [f64; 6])>,
    /// Lowest and highest coordinates, about home.
    pub range: Option<[[f64; 6]; 2]>,
    /// Poses outside of the workspace, and the bound that one exceeds.
    outside: f64,
    bound: Option<ExceededBound>,
    /// Way \[m\] and angle \[rad\] in the time of the steps \[s\].
    way: f64,
    angle: f64,
    time_s: f64,
    /// Limits of velocity \[m/s\], \[rad/s\].
    limits: [f64; 2],
}

impl StreamSurvey {
    /// Survey of the last seconds.
    pub fn over(memory_s: f64) -> Self {
        Self { memory_s, ..Self::default() }
    }

    /// Adds a pose that arrived at an instant \[ns\].
    pub fn add(&mut self, constants: &Constants, arrival_ns: u64, x: &[f64; 6]) {
        let limits = &constants.parameters.limits;
        self.limits = [limits.position.velocity, limits.orientation.velocity];
        let new = Vector6::from(*x) - Vector6::from(constants.machine().home);
        let [low, high] = self.range.unwrap_or([new.into(); 2]).map(Vector6::from);
        self.range = Some([low.inf(&new).into(), high.sup(&new).into()]);
        let before = self.last.replace((arrival_ns, *x));
        if let Some((before_ns, _)) = before {
            let kept = (-seconds_since_or_0(before_ns, arrival_ns) / self.memory_s).exp();
            for sum in [&mut self.poses, &mut self.outside, &mut self.way, &mut self.angle, &mut self.time_s]
            {
                *sum *= kept;
            }
        }
        self.poses += 1.0;
        if let Err(bound) = check_target(constants, &pose_of(x)) {
            (self.outside, self.bound) = (self.outside + 1.0, Some(bound));
        }
        if let Some((before_ns, before)) = before {
            let step_s = seconds_since_or_0(before_ns, arrival_ns);
            if step_s < MAX_STEP_S {
                let Twist { angular, linear } = pose_of(&before).displacement_to(&pose_of(x));
                (self.way, self.angle) = (self.way + linear.norm(), self.angle + angular.norm());
                self.time_s += step_s;
            }
        }
    }

    /// Whether enough has been seen to judge the units.
    pub fn is_long_enough(&self) -> bool {
        self.time_s > LEAST_S
    }

    /// Why the units of the stream are hardly those of its format.
    pub fn warning(&self) -> Option<String> {
        let share = self.outside / self.poses.max(1.0);
        let [way, angle] = [self.way, self.angle].map(|moved| moved / self.time_s.max(LEAST_S));
        let outside = self.bound.filter(|_| share > MAX_OUTSIDE && self.poses > LEAST_POSES).map(|bound| {
            format!("{} of its last poses are outside of the workspace, as by {bound}", percent(share))
        });
        let fast = |value: f64, limit: f64, unit: &str| {
            let [value, limit] = [value, limit].map(significant);
            format!("of late it moves at {value} {unit}, limit {limit} {unit}")
        };
        let [slow, calm] = self.limits;
        let reason = outside
            .or_else(|| (way > slow).then(|| fast(1e3 * way, 1e3 * slow, "mm/s")))
            .or_else(|| (angle > calm).then(|| fast(angle.to_degrees(), calm.to_degrees(), "deg/s")))?;
        Some(format!(
            "do its units, or its scale, differ from its format? {reason}; until now, about home, {}",
            self.ranges()
        ))
    }

    /// The ranges of position and orientation, for people.
    fn ranges(&self) -> String {
        let [low, high] = self.range.unwrap_or_default();
        let ranges = AXES.iter().enumerate().zip(low.iter().zip(high)).filter(|(_, (low, high))| high > *low);
        let ranges = ranges.map(|((k, axis), (low, high))| {
            let (factor, unit) = axis_unit(k);
            let [low, high] = [*low, high].map(|value| significant(factor * value));
            format!("{axis} {low} to {high} {unit}")
        });
        ranges.collect::<Vec<_>>().join(", ")
    }
}
