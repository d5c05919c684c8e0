//! Closed loop in lock-step: driver and segment may add little to the tracking error of the same loop without them.

use hexad_client::realtime::allocation::{CountingAllocator, allocator_calls_of_this_thread};
use hexad_core::control::signals::inputs::Measurement;
use hexad_core::control::signals::state::{Request, State};
use hexad_core::model::LEGS;
use hexad_core::motion::built_in::BuiltInMotion;
use hexad_ethercat::bus::Frames;
use hexad_ethercat::drives_file::DrivesFile;
use hexad_ethercat::simulation;

use super::common::*;
use super::rig::{Rig, TestDaemon};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Position error \[m\]: square sum, maximum, count.
#[derive(Default)]
struct Errors(f64, f64, f64);

impl Errors {
    fn add(&mut self, error: f64) {
        *self = Self(self.0 + error * error, self.1.max(error), self.2 + 1.0);
    }

    fn rms(&self) -> f64 {
        (self.0 / self.2).sqrt()
    }
}

/// Errors of the loop of plant and controller alone, with the steps of torque of `file` if `is_stepped`: a force acts one
/// period after its measurement.
fn plant_alone(file: &DrivesFile, is_stepped: bool, motion: BuiltInMotion, seconds: f64) -> Errors {
    let mut machine = machine();
    if is_stepped {
        let step_n = file.legs[0].units().newtons_per_permille();
        machine.deployment.plant.imperfections.drive.force_step_n = step_n;
    }
    let (mut daemon, mut plant) =
        (TestDaemon::new(&machine, motion, seconds), machine.deployment.plant.hardware(&machine.machine));
    let (mut now_ns, mut force, mut errors) = (START_NS, None::<[f64; LEGS]>, Errors::default());
    let mut cycle = 0;
    loop {
        let measurement =
            Measurement { time_ns: now_ns, length_m: plant.measure().0, ..Measurement::default() };
        let output = daemon.respond(now_ns, measurement);
        if cycle == 300 {
            daemon.ask(Request::Engage);
        }
        if output.state == State::Active {
            let start_ns = *daemon.motion_ns.get_or_insert(now_ns);
            if (now_ns - start_ns) as f64 * 1e-9 > daemon.seconds() - 0.1 {
                return errors;
            }
            let desired = daemon.task(now_ns).motion().pose.position;
            errors.add((plant.simulator().state().pose.position - desired).norm());
        }
        plant.advance(1_000_000, force);
        force = output.state.has_control().then_some(output.command_n);
        now_ns += 1_000_000;
        cycle += 1;
        assert!(daemon.motion_ns.is_some() || cycle < 3000, "{:?}", output.diagnostic);
    }
}

/// The same with driver, bus and drives.
fn with_drives(file: &DrivesFile, motion: BuiltInMotion, seconds: f64) -> Errors {
    let frames = Frames::new();
    let segment = simulation::segment(file, &machine(), START_NS);
    let mut rig = Rig::with_motion(&frames, file, segment, motion, seconds);
    rig.engage();
    let (cycles, mut errors) = ((rig.driver.daemon.seconds() * 1000.0) as u32 - 100, Errors::default());
    for _ in 0..cycles {
        rig.cycles(1);
        assert_eq!(rig.state(), State::Active, "{:?}", rig.driver.daemon.output.diagnostic);
        let desired = rig.driver.daemon.task(rig.driver.daemon.stamp_ns).motion().pose.position;
        errors.add((rig.simulator().state().pose.position - desired).norm());
    }
    let counts = rig.driver.counts;
    assert_eq!((counts.unanswered, counts.late, counts.stops), (0, 0, 0), "{counts:?}");
    assert_eq!(rig.driver.data.lost_frames, 0);
    errors
}

/// Drives with 0.6 N instead of 6.8 N for a thousandth, and an encoder whose range of 32 bits is just longer than the stroke.
fn fine_drives() -> DrivesFile {
    let text = DRIVES
        .replace("rated_torque_n_m = 24.0", "rated_torque_n_m = 2.4")
        .replace("max_torque_permille = 3000", "max_torque_permille = 30000")
        .replace("counts_per_rev = 1048576", "counts_per_rev = 67108864");
    DrivesFile::parse(&text, "fine").unwrap()
}

#[test]
fn tracking_is_that_of_the_plant_alone() {
    for (file, is_stepped) in [(drives(), true), (fine_drives(), false)] {
        for motion in [BuiltInMotion::Sines, BuiltInMotion::MinimumJerk] {
            let alone = plant_alone(&file, is_stepped, motion, 8.0);
            let driven = with_drives(&file, motion, 8.0);
            let name = motion.name();
            println!("{name}: {:.1} nm RMS, {:.1} with the drives", alone.rms() * 1e9, driven.rms() * 1e9);
            assert!(driven.rms() < 1.2 * alone.rms(), "{name}: {:e}, {:e} m", driven.rms(), alone.rms());
        }
    }
}

/// A million cycles with `HEXAD_LONG=1`.
#[test]
fn a_long_run_has_no_fault() {
    let frames = Frames::new();
    let mut rig = Rig::new(&frames, &drives(), segment());
    rig.engage();
    let cycles = if std::env::var_os("HEXAD_LONG").is_some() { 1_000_000 } else { 20_000 };
    for _ in 0..cycles {
        rig.cycles(1);
        assert_eq!(rig.state(), State::Active, "{:?}", rig.driver.daemon.output.diagnostic);
    }
}

#[test]
fn a_cycle_allocates_nothing() {
    let frames = Frames::new();
    let mut rig = Rig::new(&frames, &drives(), segment());
    rig.engage_and_move();
    let before = allocator_calls_of_this_thread();
    rig.cycles(500);
    assert_eq!(allocator_calls_of_this_thread() - before, 0);
}
