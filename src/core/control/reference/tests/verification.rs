//! Tests of verified stops: each stop is played in fine steps, next to the bound with which it was just
//! accepted.

use crate::control::reference::tests::*;

/// Time between the poses that are played \[s\].
const PLAY_STEP_S: f64 = 2e-4;
/// Distance by which a length may exceed its bound between knots, as a part of the stroke. An angle may
/// exceed its bound by as much at the outermost joint.
pub(super) const ROOM_RATIO: f64 = 2.6e-5;

/// Extreme values along a stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extremes {
    pub shortest: [f64; LEGS],
    pub longest: [f64; LEGS],
    pub rate: f64,
    pub lowest: [f64; 6],
    pub highest: [f64; 6],
    /// Smallest inverse condition, with the sign of the determinant.
    pub inverse_condition: f64,
    pub speeds: [f64; 2],
    /// Speeds at the start of the step.
    begin: [f64; 2],
}

impl Extremes {
    fn add(&mut self, constants: &Constants, pose: &Pose, twist: &Twist) {
        let machine = constants.machine();
        let (lengths, rates) = leg_lengths_and_rates(machine, pose, twist);
        let x = task_coordinates(pose, &machine.home);
        for leg in 0..LEGS {
            self.shortest[leg] = self.shortest[leg].min(lengths[leg]);
            self.longest[leg] = self.longest[leg].max(lengths[leg]);
            self.rate = self.rate.max(rates[leg].abs());
            self.lowest[leg] = self.lowest[leg].min(x[leg]);
            self.highest[leg] = self.highest[leg].max(x[leg]);
        }
        let state = KinematicState::new(machine, *pose);
        let sensitivity = state.sensitivity();
        let side = (sensitivity.determinant * constants.home.sensitivity().determinant).signum();
        self.inverse_condition = self.inverse_condition.min(side / sensitivity.condition);
        let speeds = [twist.linear.norm(), twist.angular.norm()];
        self.speeds = [self.speeds[0].max(speeds[0]), self.speeds[1].max(speeds[1])];
    }
}

/// Plays a step backward and a stop forward. The attitude is integrated in short steps, by the angular
/// velocity in the middle of each.
fn play(constants: &Constants, motion: &Motion, step: &PlayedStep, kind: StopKind) -> Extremes {
    let infinite = [f64::INFINITY; 6];
    let mut extremes = Extremes {
        shortest: infinite,
        longest: [0.0; 6],
        rate: 0.0,
        lowest: infinite,
        highest: infinite.map(|x| -x),
        inverse_condition: 1.0,
        speeds: [0.0; 2],
        begin: [0.0; 2],
    };
    let stop = PoseStop::new(kind, motion, &constants.parameters.limits);
    let count = (stop.duration() / PLAY_STEP_S).ceil().max(1.0);
    let dt = stop.duration() / count;
    let mut pose = motion.pose;
    extremes.add(constants, &pose, &motion.twist);
    for k in 0..count as u32 {
        let middle = stop.state_at(Level::new(), (f64::from(k) + 0.5) * dt);
        let end = stop.state_at(Level::new(), f64::from(k + 1) * dt);
        pose = Pose {
            rotation: exp(&(middle.orientation.velocity * dt)) * pose.rotation,
            position: motion.pose.position + end.position.displacement,
        };
        let twist = Twist { angular: end.orientation.velocity, linear: end.position.velocity };
        extremes.add(constants, &pose, &twist);
    }
    for k in 1..=16 {
        let t = -step.duration * f64::from(k) / 16.0;
        let along = |v: &Vector3<f64>, a: &Vector3<f64>, j: &Vector3<f64>| v + a * t + j * (0.5 * t * t);
        let jerk = step.jerk;
        let (twist, a) = (&motion.twist, &motion.acceleration);
        let twist = Twist {
            angular: along(&twist.angular, &a.angular, &jerk.angular),
            linear: along(&twist.linear, &a.linear, &jerk.linear),
        };
        let speeds = [twist.linear.norm(), twist.angular.norm()];
        if k == 16 {
            extremes.begin = speeds;
        } else {
            extremes.speeds = [0, 1].map(|part| extremes.speeds[part].max(speeds[part]));
        }
    }
    extremes
}

/// Step before the motion.
pub(super) struct PlayedStep {
    pub from: Option<Pose>,
    pub duration: f64,
    pub jerk: Acceleration,
}

impl PlayedStep {
    /// The step that ends with a motion.
    fn step(&self, end: &Motion) -> Step<'_> {
        let inner_speeds = inner_speeds(&self.begin(end), end, self.duration);
        Step { from: self.from.as_ref(), duration_s: self.duration, inner_speeds, ..Step::default() }
    }

    /// Twist and acceleration at its start.
    fn begin(&self, end: &Motion) -> Motion {
        let (h, a) = (self.duration, end.acceleration.vector());
        let jerk = self.jerk.vector();
        let twist = Twist::from_vector(&(end.twist.vector() - a * h + jerk * (0.5 * h * h)));
        Motion { pose: end.pose, twist, acceleration: Acceleration::from_vector(&(a - jerk * h)) }
    }
}

/// Motion within the limits, often within a fraction of them.
fn motion(samples: &mut RandomVectors, constants: &Constants) -> (Motion, PlayedStep) {
    let Limits { position, orientation, .. } = constants.parameters.limits;
    let part = 10.0_f64.powf(-samples.uniform());
    let turning = if samples.below(3) == 0 { 0.0 } else { part };
    let shifting = if samples.below(3) == 0 && turning > 0.0 { 0.0 } else { part };
    let twist = Twist {
        angular: samples.vector(0.95 * turning * orientation.velocity),
        linear: samples.vector(0.95 * shifting * position.velocity),
    };
    let acceleration = Acceleration {
        angular: samples.vector(turning * orientation.acceleration),
        linear: samples.vector(shifting * position.acceleration),
    };
    let jerk = Acceleration {
        angular: samples.vector(turning * orientation.jerk),
        linear: samples.vector(shifting * position.jerk),
    };
    let pose = pose(samples, constants);
    let step = PlayedStep { from: None, duration: if samples.below(3) == 0 { 0.01 } else { 1e-3 }, jerk };
    (Motion { twist, acceleration, ..at_rest(&pose) }, step)
}

/// Scene in which every bound is so wide that any stop is accepted. A test bisects one bound.
pub(super) struct Scene {
    pub constants: Constants,
    pub bounds: PoseBounds,
    pub motion: Motion,
    pub step: PlayedStep,
    /// Whether only stops in free space are accepted, which are not examined at knots.
    pub is_free: bool,
}

impl Scene {
    pub fn new(samples: &mut RandomVectors) -> Self {
        let mut machine = machine(samples);
        machine.actuator.max_rate_m_s = 100.0;
        let mut parameters = parameters(&machine);
        parameters.envelope = Some(Envelope { lowest: [-10.0; 6], highest: [10.0; 6] });
        if samples.below(2) == 0 {
            // Long stops have knots far apart.
            for limits in [&mut parameters.limits.position, &mut parameters.limits.orientation] {
                limits.acceleration *= 0.2;
                limits.jerk *= 0.1;
            }
        }
        let mut constants = Constants::new(&machine, parameters);
        let (motion, step) = motion(samples, &constants);
        constants.max_reference_condition = 1e4;
        let mut bounds = PoseBounds::configured(&constants);
        (bounds.shortest_m, bounds.longest_m) = ([0.0; LEGS], [100.0; LEGS]);
        Self { constants, bounds, motion, step, is_free: samples.below(3) == 0 }
    }

    pub fn set_max_rate(&mut self, rate: f64) {
        let mut machine = self.constants.machine().clone();
        machine.actuator.max_rate_m_s = rate;
        let condition = self.constants.max_reference_condition;
        self.constants = Constants::new(&machine, self.constants.parameters);
        self.constants.max_reference_condition = condition;
    }

    /// Verifies the stop, in up to three cycles that share its effort.
    pub fn verify(&self) -> Result<StopKind, Refusal> {
        let (mut verifier, mut brake_at_once) = (Verifier::default(), PoseStop::default());
        let mut verify = || {
            verifier.verify(
                &self.constants,
                &self.bounds,
                &self.motion,
                &self.step.step(&self.motion),
                &mut brake_at_once,
            )
        };
        match verify().or_else(|_| verify()).or_else(|_| verify())? {
            StopKind::BrakeAtOnce if self.is_free => Err(Limit::Stroke.into()),
            kind => Ok(kind),
        }
    }

    pub fn play(&self, kind: StopKind) -> Extremes {
        play(&self.constants, &self.motion, &self.step, kind)
    }

    /// Bisects a bound between a value with which the stop is accepted, and one with which it is not. Returns the
    /// extremes of the stop at the last accepted value, and this value.
    pub fn tightened(&mut self, bound: Bound) -> Option<(Extremes, f64)> {
        let [wide, narrow] = bound.range();
        bound.set(self, wide);
        self.verify().ok()?;
        let value = bisected(wide, narrow, |value| {
            bound.set(self, value);
            self.verify().is_ok()
        });
        bound.set(self, value);
        self.verify().ok().map(|kind| (self.play(kind), value))
    }

    /// Distance of the stop beyond a bound with which it is just accepted, at most the distance between knots.
    pub fn excess(&mut self, bound: Bound) -> Option<f64> {
        let (extremes, value) = self.tightened(bound)?;
        let excess = bound.excess(&extremes, value)?;
        assert!(excess <= bound.room(&self.constants), "{bound:?}: {excess} {:?}", self.motion);
        Some(excess)
    }
}

/// One bound of a stop. The rate, the condition and the speeds are compared as ratios.
#[derive(Clone, Copy, Debug)]
pub(super) enum Bound {
    Longest(usize),
    Shortest(usize),
    Rate,
    Highest(usize),
    Lowest(usize),
    Condition,
    ReferenceCondition,
    /// Of translation, of rotation.
    Speed(usize),
}

impl Bound {
    /// A value with which any stop is accepted, and one with which none is.
    fn range(self) -> [f64; 2] {
        match self {
            Self::Longest(_) | Self::Rate | Self::Speed(_) => [100.0, 0.0],
            Self::Shortest(_) => [0.0, 100.0],
            Self::Highest(_) => [10.0, -9.0],
            Self::Lowest(_) => [-10.0, 9.0],
            Self::Condition | Self::ReferenceCondition => [1e4, 1.0],
        }
    }

    fn set(self, scene: &mut Scene, value: f64) {
        let (constants, bounds) = (&mut scene.constants, &mut scene.bounds);
        match self {
            Self::Longest(leg) => bounds.longest_m[leg] = value,
            Self::Shortest(leg) => bounds.shortest_m[leg] = value,
            Self::Rate => scene.set_max_rate(value),
            Self::Highest(axis) => bounds.envelope.as_mut().unwrap().highest[axis] = value,
            Self::Lowest(axis) => bounds.envelope.as_mut().unwrap().lowest[axis] = value,
            Self::Condition => {
                (constants.max_reference_condition, constants.parameters.max_condition) = (value, value);
            }
            Self::ReferenceCondition => constants.max_reference_condition = value,
            Self::Speed(0) => constants.parameters.limits.position.velocity = value,
            Self::Speed(_) => constants.parameters.limits.orientation.velocity = value,
        }
    }

    /// None for a motion that was beyond the limit before the step, which would not have been accepted.
    fn excess(self, extremes: &Extremes, value: f64) -> Option<f64> {
        Some(match self {
            Self::Longest(leg) => extremes.longest[leg] - value,
            Self::Shortest(leg) => value - extremes.shortest[leg],
            Self::Rate => extremes.rate / value - 1.0,
            Self::Highest(axis) => extremes.highest[axis] - value,
            Self::Lowest(axis) => value - extremes.lowest[axis],
            Self::Condition | Self::ReferenceCondition => {
                assert!(extremes.inverse_condition > 0.0, "beyond a singular pose");
                1.0 / extremes.inverse_condition / value - 1.0
            }
            Self::Speed(part) if extremes.begin[part] > value => return None,
            Self::Speed(part) => extremes.speeds[part] / value - 1.0,
        })
    }

    /// Distance by which the bound may be exceeded between knots.
    fn room(self, constants: &Constants) -> f64 {
        let room = ROOM_RATIO * constants.machine().actuator.stroke();
        match self {
            Self::Longest(_) | Self::Shortest(_) => room,
            Self::Highest(0..3) | Self::Lowest(0..3) => room / constants.arm_m,
            Self::Speed(_) => 2e-9,
            _ => 1e-9,
        }
    }
}

/// Use of a bound: the number of all, and the number near the bound.
#[derive(Debug, Default)]
struct Uses {
    count: u32,
    near: u32,
}

impl Uses {
    /// Adds the use with a distance `excess` beyond the bound. It is near if it is less than `near` short of
    /// the bound.
    fn add(&mut self, excess: Option<f64>, near: f64) {
        self.count += u32::from(excess.is_some());
        self.near += u32::from(excess.is_some_and(|excess| excess > -near));
    }
}

#[test]
fn lengths_stay_within_bounds_that_are_just_accepted() {
    let mut samples = RandomVectors::new(21);
    let mut uses = Uses::default();
    for k in 0..600 {
        let mut scene = Scene::new(&mut samples);
        let end = if samples.below(2) == 0 { Bound::Longest } else { Bound::Shortest };
        uses.add(scene.excess(end(k % LEGS)), 1e-4);
    }
    assert!(uses.count > 400 && uses.near > 300, "{uses:?}");
}

#[test]
fn coordinates_stay_within_an_envelope_that_is_just_accepted() {
    let mut samples = RandomVectors::new(23);
    let mut uses = [Uses::default(), Uses::default()];
    for k in 0..900 {
        let mut scene = Scene::new(&mut samples);
        // Steep angles, whose rates are larger.
        if samples.below(2) == 0 {
            let tilt = Vector3::y() * (1.0 * samples.uniform());
            scene.motion.pose.rotation = exp(&tilt);
            scene.constants.max_reference_condition = 1e9;
        }
        let (axis, end) = (k % 6, if samples.below(2) == 0 { Bound::Highest } else { Bound::Lowest });
        uses[axis / 3].add(scene.excess(end(axis)), 1e-4);
    }
    assert!(uses.iter().all(|uses| uses.count > 250 && uses.near > 150), "{uses:?}");
}

#[test]
fn rates_condition_and_speeds_stay_within_limits_that_are_just_accepted() {
    for (seed, bound, near, least) in [
        (22, Bound::Rate, 0.02, [300, 150]),
        (24, Bound::Condition, 0.3, [300, 200]),
        (25, Bound::Speed(0), 1e-3, [200, 100]),
        (26, Bound::Speed(1), 1e-3, [200, 100]),
    ] {
        let mut samples = RandomVectors::new(seed);
        let mut uses = Uses::default();
        (0..400).for_each(|_| uses.add(Scene::new(&mut samples).excess(bound), near));
        assert!(uses.count > least[0] && uses.near > least[1], "{bound:?}: {uses:?}");
    }
}
