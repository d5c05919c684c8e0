//! The lines of a picture, from the samples of a recording.

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::State;
use hexad::model::rigid::{Motion, Pose, Twist};

use super::recording::Sample;
use super::world::World;

pub type Line = Vec<(f64, f64)>;

/// Positions and speeds change little from cycle to cycle: about so many points of a line are drawn.
const SMOOTH_POINTS: usize = 600;

/// A state is drawn at least this long, as a share of the picture, or a state of one cycle would not be seen.
const SHORTEST_STATE: f64 = 0.005;

/// Where something is along z about home, and how fast it moves in all axes. Each is a line with gaps.
pub struct Course {
    pub z_mm: Vec<Line>,
    pub speed: Vec<Line>,
}

pub struct Curves {
    pub window_s: [f64; 2],
    pub setpoint: Course,
    pub reference: Course,
    pub platform: Course,
    /// Magnitude of the reference's \[m/s^2\].
    pub wanted: Vec<Line>,
    /// Magnitude, by the drives \[m/s^2\].
    pub acceleration: Vec<Line>,
    /// Magnitude, while the brakes are closed \[m/s^2\].
    pub braking: Vec<Line>,
    /// Magnitude of the reference's jerk, mean over each cycle \[m/s^3\].
    pub jerk: Vec<Line>,
    /// Of the setpoint from the platform.
    pub distance_mm: Vec<Line>,
    pub states: [Vec<Line>; 7],
    /// Vertical lines at refused requests.
    pub refusals: Vec<Line>,
}

/// Samples of a window, and their times in the recording.
struct Window<'a> {
    samples: &'a [Sample],
    begin_ns: u64,
    period_s: f64,
}

impl Curves {
    pub fn new(world: &World, [from, to]: [f64; 2]) -> Self {
        let all = &world.recording.samples;
        let period_s = world.parameters.period_ns as f64 * 1e-9;
        let window = Window { samples: all, begin_ns: all[0].time_ns, period_s };
        let at = |t: f64| all.partition_point(|sample| window.seconds(sample) < t);
        let window = Window { samples: &all[at(from)..at(to)], ..window };
        let [first, last] = [window.samples.first(), window.samples.last()].map(Option::unwrap);
        let home = world.machine.home[5];
        let z_mm = |pose: &Pose| 1e3 * (pose.position.z - home);
        let course = |delay: f64, of: &dyn Fn(&Sample) -> Option<Motion>| Course {
            z_mm: window.smooth(delay, |at| of(at).map(|motion| z_mm(&motion.pose))),
            speed: window.smooth(delay, |at| of(at).map(|motion| motion.twist.linear.norm())),
        };
        let platform =
            |at: &Sample| Motion { pose: at.pose, twist: at.twist, acceleration: Default::default() };
        let speed_up = |before: &Twist, now: &Twist| (now.linear - before.linear).norm() / period_s;
        let reference = |at: &Sample| at.output.reference.map(|reference| reference.acceleration.linear);
        Self {
            window_s: [window.seconds(first), window.seconds(last) + 1.5 * period_s],
            // Setpoints are of the begin of the cycle, the platform is of its end, references half a period later.
            setpoint: course(0.0, &|at| at.setpoint.map(|task| task.motion())),
            platform: course(1.0, &|at| Some(platform(at))),
            reference: course(1.5, &|at| at.output.reference),
            wanted: window.pairwise(1.5, |_, now| reference(now).map(|a| a.norm())),
            acceleration: window.pairwise(1.0, |_, now| now.acceleration.map(|a| a.linear.norm())),
            braking: window.pairwise(1.0, |before, now| {
                now.acceleration.is_none().then(|| speed_up(&before.twist, &now.twist))
            }),
            jerk: window
                .pairwise(1.5, |before, now| Some((reference(now)? - reference(before)?).norm() / period_s)),
            distance_mm: window.pairwise(1.0, |_, now| {
                let setpoint = now.setpoint?.motion().pose.position;
                Some(1e3 * (setpoint - now.pose.position).norm())
            }),
            states: State::ALL.map(|state| window.steps(state)),
            refusals: window.refusals(),
        }
    }
}

impl Window<'_> {
    fn seconds(&self, sample: &Sample) -> f64 {
        (sample.time_ns - self.begin_ns) as f64 * 1e-9
    }

    /// Some of the samples, `delay` periods after the begin of each.
    fn smooth(&self, delay: f64, of: impl Fn(&Sample) -> Option<f64>) -> Vec<Line> {
        let step = self.samples.len().div_ceil(SMOOTH_POINTS);
        let samples = self.samples.iter().step_by(step);
        split(samples.map(|at| (self.seconds(at) + delay * self.period_s, of(at))))
    }

    /// Each sample with the one before it.
    fn pairwise(&self, delay: f64, of: impl Fn(&Sample, &Sample) -> Option<f64>) -> Vec<Line> {
        let pairs = self.samples.windows(2);
        split(pairs.map(|pair| (self.seconds(&pair[1]) + delay * self.period_s, of(&pair[0], &pair[1]))))
    }

    /// Where the controller is in this state.
    fn steps(&self, state: State) -> Vec<Line> {
        let count = self.samples.len() as f64;
        self.pairwise(0.0, |_, now| {
            (now.has_daemon && now.output.state == state).then_some(f64::from(state as u32))
        })
        .into_iter()
        .map(|piece| {
            let (end, level) = *piece.last().unwrap();
            let end = (end + self.period_s).max(piece[0].0 + SHORTEST_STATE * self.period_s * count);
            vec![piece[0], (end, level)]
        })
        .collect()
    }

    fn refusals(&self) -> Vec<Line> {
        let code = |at: &Sample| at.output.request_diagnostic.code;
        let refused = |pair: &&[Sample]| {
            code(&pair[1]) != DiagnosticCode::None
                && pair[1].output.answered_message != pair[0].output.answered_message
        };
        self.samples
            .windows(2)
            .filter(refused)
            .map(|pair| [0.0, 6.0].map(|level| (self.seconds(&pair[1]), level)).into())
            .collect()
    }
}

/// Runs of points that are there.
fn split(points: impl Iterator<Item = (f64, Option<f64>)>) -> Vec<Line> {
    let mut pieces: Vec<Line> = vec![];
    let mut gap = true;
    for (t, value) in points {
        match value {
            Some(value) if gap => pieces.push(vec![(t, value)]),
            Some(value) => pieces.last_mut().unwrap().push((t, value)),
            None => {}
        }
        gap = value.is_none();
    }
    pieces
}
