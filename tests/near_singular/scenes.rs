//! Poses on their way to a singular one.

use super::*;

/// A motion through a pose.
pub struct Scene {
    pub family: &'static str,
    pub model: InverseDynamics,
    pub motion: Motion,
    /// For `twist_from_rates`.
    pub rates: Vector6<f64>,
    pub condition: f64,
}

/// A direction that is nowhere that of a leg.
fn axis(random: &mut Random) -> Vector3<f64> {
    (vector(random) + Vector3::new(0.1, 0.2, 0.3)).normalize()
}

/// A straight way of the platform: rotation vector and displacement per unit of s.
struct Way {
    start: Pose,
    turn: Vector3<f64>,
    shift: Vector3<f64>,
}

impl Way {
    fn at(&self, s: f64) -> Pose {
        Pose {
            rotation: exp(&(self.turn * s)) * self.start.rotation,
            position: self.start.position + self.shift * s,
        }
    }

    /// Where `f` changes its sign first, if it does before s = 1.
    fn crossing(&self, f: impl Fn(&Pose) -> f64) -> Option<f64> {
        let steps = 40;
        let mut last = f(&self.at(0.0));
        for k in 1..=steps {
            let s = f64::from(k) / f64::from(steps);
            let now = f(&self.at(s));
            if (now > 0.0) != (last > 0.0) {
                let (mut low, mut high) = (s - 1.0 / f64::from(steps), s);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    if (f(&self.at(middle)) > 0.0) == (last > 0.0) { low = middle } else { high = middle }
                }
                return Some(high);
            }
            last = now;
        }
        None
    }
}

/// Random joints on the machine's masses, laid out for a pose that is not the one to come.
fn random_layout(random: &mut Random) -> Machine {
    let mut machine = machine("scattered");
    let legs = Legs {
        base: core::array::from_fn(|_| vector(random)),
        platform: core::array::from_fn(|_| vector(random) * 0.6),
        universal_axis: core::array::from_fn(|_| axis(random)),
    };
    machine.home = [0.0, 0.0, 0.0, 0.2 * random.signed(), 0.2 * random.signed(), 1.0 + 0.5 * random.signed()];
    machine.joints = legs.joints(&machine.home);
    machine
}

/// At home three legs point to one point P, and three lie in a plane through P: two motions are free, so two singular values
/// become small together, while the directions of the legs stay independent.
fn two_free_motions(random: &mut Random) -> Machine {
    let mut machine = machine("scattered");
    let center = Vector3::new(0.0, 0.0, 1.0);
    let [point, normal] = [vector(random) + center * 2.0, vector(random).normalize()];
    let in_plane = |v: Vector3<f64>| v - normal * normal.dot(&(v - point));
    let base: [_; 6] = core::array::from_fn(|k| {
        let joint = vector(random);
        if k < 3 { joint } else { in_plane(joint) }
    });
    let platform = core::array::from_fn(|k| {
        let joint = if k < 3 {
            base[k].lerp(&point, 0.5 + 0.2 * random.signed())
        } else {
            in_plane(center + vector(random) * 0.6)
        };
        joint - center
    });
    let universal_axis = core::array::from_fn(|_| axis(random));
    machine.home = [0.0, 0.0, 0.0, center.x, center.y, center.z];
    machine.joints = Legs { base, platform, universal_axis }.joints(&machine.home);
    machine
}

/// Motions near the poses of a way, closer and closer to `s`.
fn approach(
    family: &'static str,
    machine: &Machine,
    way: &Way,
    s: f64,
    random: &mut Random,
    visit: &mut dyn FnMut(&Scene),
) {
    let model = InverseDynamics::new(machine);
    let dynamics = ForwardDynamics::new(machine);
    for power in 0..28 {
        for _ in 0..2 {
            let distance = 10f64.powf(-0.5 * f64::from(power) + 0.25 * random.signed());
            let pose = way.at(s - distance);
            let condition = condition(machine, &pose);
            if !(condition < 1e13) {
                continue;
            }
            let r = machine.joints.radius_m;
            let twist = Twist { angular: vector(random), linear: vector(random) * r };
            // A load without regard to the pose, and one that moderate forces balance.
            let any = Acceleration { angular: vector(random) * 10.0, linear: vector(random) * 10.0 * r };
            let force = Vector6::from_fn(|_, _| random.signed()) * (10.0 * machine.platform.mass_kg);
            let smooth = dynamics.acceleration(&pose, &twist, &force.into());
            let rates = Vector6::from_fn(|_, _| random.signed());
            let moderate = leg_wrenches(machine, &pose).transpose() * twist.vector();
            let motion = |acceleration| Motion { pose, twist, acceleration };
            let mut visit =
                |motion, rates| visit(&Scene { family, model: model.clone(), motion, rates, condition });
            visit(motion(any), rates);
            if let Some(smooth) = smooth {
                visit(motion(smooth), moderate);
            }
        }
    }
}

/// Motions near the first pose of a way where a determinant vanishes: that of all directions, or of those of three legs.
fn approach_crossings(
    family: &'static str,
    machine: &Machine,
    way: &Way,
    random: &mut Random,
    visit: &mut dyn FnMut(&Scene),
) {
    if let Some(s) = way.crossing(|pose| leg_wrenches(machine, pose).determinant()) {
        approach(family, machine, way, s, random, visit);
    }
    if let Some(s) = way.crossing(|pose| determinants(machine, pose).0) {
        approach("coplanar A", machine, way, s, random, visit);
    }
}

/// All of them.
pub fn scenes(visit: &mut dyn FnMut(&Scene)) {
    let random = &mut Random::new(2008);
    for name in MACHINES {
        let machine = machine(name);
        let r = machine.joints.radius_m;
        let start = machine.home_pose();
        let up = start.rotation.column(2).into_owned();
        // Turns about the vertical, about axes across it, screws.
        let mut ways = vec![(up, Vector3::zeros()), (-up, Vector3::zeros())];
        ways.extend(
            [Vector3::x(), Vector3::y(), -Vector3::x(), -Vector3::y()]
                .map(|axis| (start.rotation * axis, Vector3::zeros())),
        );
        ways.extend((0..30).map(|_| (vector(random).normalize(), vector(random) * r * 0.3)));
        for (k, (axis, shift)) in ways.into_iter().enumerate() {
            let way = Way { start, turn: axis * 2.6, shift };
            let family =
                ["vertical turn", "roll or pitch", "screw"][usize::from(k >= 2) + usize::from(k >= 6)];
            approach_crossings(family, &machine, &way, random, visit);
        }
        // The platform sinks into the plane of its base (for flat ones a rank of three).
        let legs = Legs::of(&machine);
        let sink = legs.base.iter().sum::<Vector3<f64>>() / 6.0
            - start.position
            - start.rotation * (legs.platform.iter().sum::<Vector3<f64>>() / 6.0);
        let depth = start.rotation.column(2).dot(&sink);
        let way = Way { start, turn: Vector3::zeros(), shift: start.rotation.column(2) * depth };
        approach("coplanar legs", &machine, &way, 1.0, random, visit);
    }
    for _ in 0..100 {
        let machine = two_free_motions(random);
        let way = Way { start: machine.home_pose(), turn: vector(random), shift: vector(random) * 0.3 };
        approach("two free motions", &machine, &way, 0.0, random, visit);
    }
    for _ in 0..150 {
        let machine = random_layout(random);
        let way = Way { start: machine.home_pose(), turn: vector(random) * 3.0, shift: vector(random) * 0.3 };
        approach_crossings("random layout", &machine, &way, random, visit);
    }
}
