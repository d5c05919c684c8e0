//! What happens on ordinary and on bad days, from beginning to end: the reference keeps its limits, acceleration and
//! jerk of the platform stay near them in every cycle under control, and forces have no steps.
//!
//! With `HEXAD_CHARTS=FOLDER` each is drawn into a picture.

use super::cells::{Bounds, GENTLE};
use super::pictures::{Picture, draw};
use super::recording::Peaks;
use super::situations::{Situation, machine};
use super::world::{Source, World};
use hexad::control::law::ControlMode;
use hexad::control::parameters::ViolationPolicy;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::state::{Request, State};
use hexad::model::task::TaskState;
use hexad_support::rig::{Rates, Rig, parameters};
use nalgebra::Vector6;

mod engaging;
mod losses;
mod requests;
mod sources;

/// Way of the motions, about and along the axes: 150 mm up, aside and turning \[rad, m\].
const WAY: [f64; 6] = [0.0, 0.0, 0.1, 0.05, 0.0, 0.15];
/// Up to 0.2 m/s.
const SLOW_S: f64 = 1.5;
/// Up to 0.4 m/s. Faster, the policy `limit` slows down before the ends of the stroke.
const FAST_S: f64 = 0.75;

type Path = [(State, DiagnosticCode)];

fn standby() -> World {
    standby_under(ViolationPolicy::default())
}

fn standby_under(policy: ViolationPolicy) -> World {
    let (mut config, _) = machine(ControlMode::default());
    config.deployment.setpoint.on_violation = policy;
    let parameters = parameters(&config);
    let mut world = World::new(Rig::new(&config, &config.machine), &config.machine, parameters);
    world.run(200);
    world
}

/// Engages where the platform stands, and is on the way upward for so many cycles.
fn moving(policy: ViolationPolicy, seconds: f64, cycles: u32) -> World {
    let mut world = standby_under(policy);
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    let from = world.x();
    world.source = Source::Moves([from, from + Vector6::from(WAY)], world.rig.now_ns, seconds);
    world.run(cycles);
    world
}

/// Past the middle of a slow motion, at 0.18 m/s.
fn moving_slowly() -> World {
    moving(ViolationPolicy::default(), SLOW_S, 900)
}

/// In the middle of a fast motion, at 0.4 m/s.
fn moving_fast(policy: ViolationPolicy) -> World {
    moving(policy, FAST_S, 375)
}

fn still(x: Vector6<f64>) -> Source {
    Source::Still(TaskState::at_rest(x.into()))
}

fn along_z(metres: f64) -> Vector6<f64> {
    Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, metres)
}

/// From a fault: clear, engage where it stands, and move again.
fn begins_again(world: &mut World) {
    world.source_at_platform();
    world.run(100);
    world.ask(Request::Clear);
    world.run(100);
    world.ask(Request::Engage);
    world.until(|output| output.state == State::Active);
    world.run(100);
    let from = world.x();
    world.source = Source::Moves([from, world.machine.home.into()], world.rig.now_ns, SLOW_S);
    world.run(1600);
}

/// The limits are kept, the states are these, and no force is cut.
fn assert_smooth(picture: Picture, world: &World, expected: &Path) {
    let peaks = assert_within(&GENTLE, picture, world, expected);
    assert!(peaks.force_rate < 1.0, "never cut: {peaks:?}");
}

/// What rounding makes of the limits of the reference.
const ROUNDING: f64 = 1e-6;

fn assert_within(bounds: &Bounds, picture: Picture, world: &World, expected: &Path) -> Peaks {
    let peaks = world.recording.peaks(&world.parameters, world.machine.actuator.max_force_n);
    println!("{}: {:?} {peaks:?}", picture.name, changes(world));
    draw(&picture, world);
    // The reference keeps the limits exactly, the platform but for what held forces add.
    assert!(peaks.reference_acceleration <= 1.0 + ROUNDING, "{peaks:?}");
    assert!(peaks.reference_jerk <= 1.0 + ROUNDING, "{peaks:?}");
    let Bounds { acceleration, jerk, .. } = *bounds;
    assert!(peaks.acceleration <= acceleration && peaks.jerk <= jerk && peaks.force < 1.0, "{peaks:?}");
    let path = world.recording.path();
    let states = path.iter().filter(|(state, cause)| {
        state.has_control() || cause.is_fault() || *cause == DiagnosticCode::SetpointTooFar
    });
    let mut states: Vec<_> = states.copied().collect();
    states.dedup();
    assert_eq!(states, expected);
    peaks
}

/// States and when they begin \[s\].
fn changes(world: &World) -> Vec<(f64, State)> {
    let samples = &world.recording.samples;
    let seconds = |time_ns: u64| (time_ns - samples[0].time_ns) as f64 * 1e-9;
    let mut changes: Vec<_> = samples.iter().map(|at| (seconds(at.time_ns), at.output.state)).collect();
    changes.dedup_by_key(|(_, state)| *state);
    changes
}

const ENGAGES: [(State, DiagnosticCode); 2] =
    [(State::Engaging, DiagnosticCode::None), (State::Active, DiagnosticCode::None)];

/// Engages, loses control in these states, and engages again.
fn twice(between: &Path) -> Vec<(State, DiagnosticCode)> {
    [&ENGAGES[..], between, &ENGAGES[..]].concat()
}

/// None of this is worth anything if the worlds it begins with are not what they say.
#[test]
fn situations_are_what_they_say() {
    for mode in ControlMode::ALL {
        for situation in Situation::ALL {
            let mut world = situation.world(mode, ViolationPolicy::default(), Rates::Always);
            let output = world.cycle(|_, _| {});
            assert_eq!(output.state, situation.state());
            assert_eq!(output.command_n != [0.0; 6], situation.state().has_control());
        }
    }
}
