//! The daemon controls a platform that nobody here wrote, for a setpoint source that nobody here compiled: the
//! clients of `tests/clients` on the package `hexad`.

use std::panic::{catch_unwind, resume_unwind};
use std::time::{Duration, Instant};

use hexad::messages::{Bus, Publisher, Subscriber};
use hexad::messages::{ForceMessage, MeasuredMessage};
use hexad::model::task::task_coordinates;
use hexad::motion::built_in::BuiltInMotion;

use super::stage::{LOCKSTEP, PERIOD_NS, PERIOD_S, Period, Run, Stage, turn};
use super::{DEPLOYED, python};
use hexad_support::process::{HANG, Process};
use hexad_support::stalls::Watchdog;

/// Of the motion \[s\].
const SECONDS: f64 = 4.0;

/// Timeouts that hardly a stall of the host reaches, but for the driver's own.
const REAL_TIME: &str = "
[realtime]
release = \"external\"
[timeouts]
setpoint_ms = 200.0
measured_ms = 200.0
allow_unstable_age = true
";

/// What a run in real time does not surely survive, as the last force is held over it, and how often it is tried.
const HELD: Duration = Duration::from_millis(10);
const ATTEMPTS: u32 = 5;

/// A setpoint source of the stage's own machine.
fn source(stage: &Stage) -> Process {
    stage.source(&stage.config.machine, BuiltInMotion::Sines, SECONDS)
}

/// All of a run with MuJoCo in the plant's place.
fn with_mujoco(stage: &Stage) -> Run {
    stage.with_mujoco(&stage.path("machine.toml"), &[], &[], || source(stage));
    stage.judge(&stage.periods())
}

/// The same with our own plant, in lock-step.
fn with_ours(stage: &Stage) -> Run {
    let daemon = stage.daemon(&[]);
    let bus = Bus::join_simulated(&stage.name).unwrap();
    let mut measured = bus.publisher::<MeasuredMessage>().unwrap();
    let mut forces = bus.subscriber::<ForceMessage>(8).unwrap();
    let source = source(stage);
    let mut hardware = stage.config.deployment.plant.hardware(&stage.config.machine);
    let mut periods = vec![];
    for time_ns in (0..).step_by(PERIOD_NS as usize) {
        let (length_m, length_rate_m_s) = hardware.measure();
        let state = *hardware.simulator().state();
        let x = task_coordinates(&state.pose, &stage.config.machine.home);
        let message =
            MeasuredMessage { length_m, length_rate_m_s, rates_valid: 1, ..MeasuredMessage::default() };
        let force = ask(&mut measured, &mut forces, time_ns, message);
        let force = force.may_be_applied(force.header.time_ns, 0).then_some(force.force_n);
        periods.push(Period { time_ns, x: x.into(), twist: state.twist.vector(), force });
        hardware.advance(PERIOD_NS, force);
        if force.is_none() && periods.iter().any(|period| period.force.is_some()) {
            break;
        }
    }
    source.ends_well();
    daemon.stops();
    stage.judge(&periods)
}

/// Publishes a measurement until it is answered.
fn ask(
    measured: &mut Publisher<MeasuredMessage>,
    forces: &mut Subscriber<ForceMessage>,
    time_ns: u64,
    message: MeasuredMessage,
) -> ForceMessage {
    let began = Instant::now();
    loop {
        measured.publish(time_ns, message).unwrap();
        let said = Instant::now();
        while said.elapsed() < Duration::from_millis(100) {
            match forces.receive_latest() {
                Some(force) if force.release_ns == time_ns => return force,
                _ => std::thread::yield_now(),
            }
        }
        assert!(began.elapsed() < HANG, "no force for {time_ns}");
    }
}

/// Largest error \[m\], \[rad\] in MuJoCo. Its forces differ by up to 3e-4 from inverse dynamics, as its joints are held by
/// constraints with a time constant: 3e-4 of gravity over the stiffness of the loop, 3948 / s^2, is 0.7e-6.
const LARGEST_ERROR: f64 = 1.2e-6;

/// Daemon and plant have the same parameters, so what is off is what a period makes of a force, and what the engine does.
#[test]
fn a_platform_in_mujoco_tracks_as_well_as_our_own() {
    if python::is_lacking() {
        return;
    }
    let _turn = turn();
    for machine in DEPLOYED {
        let [mujoco, ours] = ["mujoco", "ours"].map(|who| Stage::new(machine, who, LOCKSTEP));
        let (mujoco, ours) = (with_mujoco(&mujoco), with_ours(&ours));
        mujoco.print(&format!("{machine} in MuJoCo"));
        ours.print(&format!("{machine} in our plant"));
        assert!(ours.periods > (SECONDS / PERIOD_S) as usize && mujoco.periods == ours.periods);
        for (what, mujoco, ours) in [
            ("position", mujoco.position, ours.position),
            ("orientation", mujoco.orientation, ours.orientation),
        ] {
            for (mujoco, ours) in [(mujoco.rms(), ours.rms()), (mujoco.max, ours.max)] {
                assert!(
                    mujoco > 0.5 * ours && mujoco < LARGEST_ERROR,
                    "{machine}, {what}: {mujoco}, {ours} in our plant"
                );
            }
        }
        // Not zero: the other engine is there.
        assert!((1e-6..0.01).contains(&mujoco.force.max), "{machine}: forces {:?}", mujoco.force);
        assert!((1e-9..1e-5).contains(&ours.force.max), "{machine}: forces of our plant {:?}", ours.force);
    }
}

/// The drives are the clock, and time is everybody's. While the host holds somebody the platform drifts, rightly: the
/// typical error counts. How many periods an engine and a driver in Python manage is the host's speed: where it was too slow for
/// half of them the run is repeated, and the last one needs a tenth.
#[test]
fn a_platform_in_mujoco_moves_in_real_time() {
    if python::is_lacking() {
        return;
    }
    let _turn = turn();
    for attempt in 1.. {
        let host = Watchdog::start_ordinary();
        let stage = Stage::new("fried2008", &format!("real{attempt}"), REAL_TIME);
        let run = catch_unwind(|| with_mujoco(&stage));
        let held = host.largest();
        let share = if attempt < ATTEMPTS { 2 } else { 10 };
        let enough = (SECONDS / PERIOD_S) as usize / share;
        match run {
            Ok(run) if run.periods <= enough && attempt < ATTEMPTS => {
                println!("attempt {attempt}: {} periods", run.periods);
            }
            Ok(run) => {
                run.print("fried2008 in MuJoCo, in real time");
                println!("typically {:.1e} m off; the host held somebody for {held:?}", run.typical_position);
                assert!(run.periods > enough, "{} periods", run.periods);
                assert!((1e-8..20e-6).contains(&run.typical_position), "{} m", run.typical_position);
                assert!((1e-6..0.01).contains(&run.force.max), "forces {:?}", run.force);
                return;
            }
            Err(failure) if held < HELD || attempt == ATTEMPTS => resume_unwind(failure),
            Err(_) => println!("attempt {attempt} failed; the host held somebody for {held:?}"),
        }
    }
}
