//! Table of failures during motion: what becomes of the drives, and how far the platform still moves.

use hexad_client::realtime::allocation::allocator_calls_of_this_thread;
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::inputs::Measurement;
use hexad_core::control::signals::state::{Request, State};
use hexad_core::model::LEGS;
use hexad_core::model::task::task_coordinates;
use hexad_ethercat::al_state::{ERROR, OP, SAFE_OP};
use hexad_ethercat::bus::Frames;
use hexad_ethercat::cia402::DriveState;
use hexad_ethercat::cycle::DevicesLost;
use hexad_ethercat::link::Link;
use hexad_ethercat::process_data::StopCause;
use hexad_ethercat::segment::Segment;
use hexad_ethercat::segment::device::DeviceModel;

use super::common::*;
use super::rig::Rig;

/// Speed of the platform at the failure \[m/s\].
const SPEED_M_S: std::ops::Range<f64> = 0.45..0.5;
/// Largest way of the platform from a failure to rest \[mm\], where the drives stop within two cycles: closing brakes take 10 mm
/// at 9.81 m/s^2.
const MAX_PROMPT_WAY_MM: f64 = 11.0;
/// The same where a watchdog stops them, after 20 ms.
const MAX_WAY_MM: f64 = 20.5;

/// Way of the platform from now until it rests \[mm\], over so many milliseconds.
fn way_mm(rig: &mut Rig, mut pass: impl FnMut(&mut Rig)) -> f64 {
    let before = rig.simulator().state().pose.position;
    let speed = rig.simulator().state().twist.linear.norm();
    assert!(SPEED_M_S.contains(&speed), "{speed} m/s");
    let (mut way, calls) = (0.0f64, allocator_calls_of_this_thread());
    for _ in 0..150 {
        pass(rig);
        way = way.max((rig.simulator().state().pose.position - before).norm() * 1e3);
    }
    assert_eq!(allocator_calls_of_this_thread() - calls, 0, "no cycle allocates");
    let rest = rig.simulator().state().twist.linear.norm();
    assert_eq!(rest, 0.0, "the platform rests");
    println!("{way:.2} mm at {speed:.2} m/s");
    way
}

/// The driver has stopped the drives for a cause in these words, and to the daemon the bus is the first cause.
fn names_the_bus(rig: &Rig, words: &str) {
    let cause = rig.driver.counts.stop_cause.map(|cause: StopCause| cause.to_string()).unwrap_or_default();
    assert!(cause.starts_with(words), "{words:?} is not in {cause:?}");
    let output = rig.driver.daemon.output;
    assert_eq!((output.state, output.diagnostic.code), (State::Fault, DiagnosticCode::DriveBusFailed));
    assert_eq!(rig.driver.counts.stops, 1);
}

/// A rig where the platform moves fast.
fn moving(frames: &Frames) -> Rig<'_> {
    let mut rig = Rig::new(frames, &drives(), segment());
    rig.engage_and_move();
    rig
}

fn all_stopped(states: [DriveState; LEGS]) -> bool {
    states.iter().all(|state| *state != DriveState::OperationEnabled)
}

/// Cycles until the drives stop, and the way of the platform \[mm\].
fn stop(rig: &mut Rig) -> (u32, f64) {
    let (mut cycles, mut stopped) = (0, None);
    let way = way_mm(rig, |rig| {
        rig.cycles(1);
        cycles += 1;
        if stopped.is_none() && all_stopped(rig.drive_states()) {
            stopped = Some(cycles);
        }
    });
    (stopped.unwrap(), way)
}

#[test]
fn an_emergency_stop_is_a_quick_stop_within_two_cycles() {
    let frames = Frames::new();
    let mut rig = moving(&frames);
    rig.driver.daemon.ask(Request::Estop);
    let (cycles, way) = stop(&mut rig);
    assert!(cycles <= 2 && way < MAX_PROMPT_WAY_MM, "{cycles} cycles, {way} mm");
}

#[test]
fn a_fault_of_any_drive_stops_the_others_within_two_cycles() {
    for leg in 0..LEGS {
        let frames = Frames::new();
        let mut rig = moving(&frames);
        rig.segment().devices[leg].trip(0x2310);
        let (cycles, way) = stop(&mut rig);
        assert!(cycles <= 2 && way < MAX_PROMPT_WAY_MM, "leg {leg}: {cycles} cycles, {way} mm");
        let states = rig.drive_states();
        assert_eq!(states[leg], DriveState::Fault);
        assert_eq!(rig.driver.daemon.measured.drive_fault, 1 << leg);
        assert_eq!(rig.state(), State::Fault);
        assert_eq!(rig.driver.counts.stops, 1);
    }
}

#[test]
fn a_fault_is_acknowledged_when_an_operator_clears_the_daemon() {
    let frames = Frames::new();
    let mut rig = moving(&frames);
    rig.segment().devices[3].trip(0x2310);
    rig.cycles(1000);
    assert_eq!(rig.drive_states()[3], DriveState::Fault, "by itself it stays");
    rig.driver.daemon.motion_ns = None;
    rig.driver.daemon.ask(Request::Clear);
    rig.cycles(100);
    assert_eq!(rig.drive_states()[3], DriveState::SwitchOnDisabled);
    assert_eq!(rig.driver.daemon.measured.drive_fault, 0);
}

/// A drive trips under control, and the driver is started anew.
#[test]
fn a_fault_is_acknowledged_whether_it_is_cleared_before_or_after_the_driver_is_back() {
    for is_cleared_before in [true, false] {
        let frames = Frames::new();
        let mut rig = moving(&frames);
        rig.segment().devices[3].trip(0x2310);
        rig.cycles(1000);
        assert_eq!(rig.state(), State::Fault);
        let daemon = &mut rig.driver.daemon;
        daemon.motion_ns = None;
        if is_cleared_before {
            daemon.ask(Request::Clear);
            daemon.respond(daemon.stamp_ns + 1_000_000, Measurement::from(&daemon.measured));
            assert_eq!(daemon.output.state, State::Off);
        }
        rig = rig.with_new_driver();
        rig.cycles(100);
        if !is_cleared_before {
            assert_eq!(rig.drive_states()[3], DriveState::Fault, "by itself it stays");
            rig.driver.daemon.ask(Request::Clear);
            rig.cycles(100);
        }
        assert_eq!(rig.drive_states()[3], DriveState::SwitchOnDisabled);
        // In standby no fault is there to clear: it is refused with the reason.
        rig.segment().devices[3].trip(0x2310);
        rig.cycles(100);
        rig.driver.daemon.ask(Request::Clear);
        rig.cycles(100);
        let refusal = rig.driver.daemon.output.request_diagnostic;
        assert_eq!((refusal.code, rig.drive_states()[3]), (DiagnosticCode::DriveFault, DriveState::Fault));
    }
}

#[test]
fn a_cut_before_any_device_stops_all() {
    for reachable in 0..LEGS {
        let frames = Frames::new();
        let mut rig = moving(&frames);
        rig.segment().reachable = reachable;
        let way = way_mm(&mut rig, |rig| rig.cycles(1));
        let bound = if reachable > 0 { MAX_PROMPT_WAY_MM } else { MAX_WAY_MM };
        assert!(way < bound, "{reachable}: {way} mm");
        for (position, device) in rig.segment().devices.iter().enumerate() {
            assert_ne!(device.drive.state, DriveState::OperationEnabled, "{position}");
            // Devices behind the cut are stopped by their watchdog.
            let status = if position < reachable { OP } else { SAFE_OP | ERROR };
            assert_eq!(device.al_status(), status, "cut before {reachable}, device {position}");
        }
        match reachable {
            0 => names_the_bus(
                &rig,
                "3 frames in a row are lost or late: look at the cable to the first drive",
            ),
            _ => {
                let states: Vec<_> =
                    (0..LEGS).map(|position| if position < reachable { 8 } else { 0 }).collect();
                let found = 3 * reachable;
                names_the_bus(
                    &rig,
                    &format!(
                        "working counter {found}, must be 18: a drive is missing; states by position {states:?}"
                    ),
                );
            }
        }
        let lost = (0..200).find_map(|_| rig.cycle().err());
        assert_eq!(lost, Some(DevicesLost { reachable }));
    }
}

/// Frames sent within this time are lost \[ns\].
fn lose_for(rig: &mut Rig, duration_ns: u64) {
    let until_ns = rig.bus.wire.link.now_ns() + duration_ns;
    rig.bus.wire.link.loses = Some(Box::new(move |now_ns| now_ns < until_ns));
}

#[test]
fn single_lost_frames_change_nothing() {
    let frames = Frames::new();
    let mut rig = moving(&frames);
    let mut random = 1u64;
    rig.bus.wire.link.loses = Some(Box::new(move |_| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (random >> 33).is_multiple_of(100)
    }));
    rig.cycles(20_000);
    assert_eq!(rig.state(), State::Active, "{:?}", rig.driver.daemon.output.diagnostic);
    let counts = rig.driver.counts;
    assert!(rig.driver.data.lost_frames > 200 && counts.stops == 0, "{counts:?}");
}

/// The driver may be paused between sending a frame and receiving it: the inputs belong to another SYNC0 than the clock of the
/// computer suggests.
#[test]
fn pauses_of_the_host_give_no_measurement_a_wrong_stamp() {
    let frames = Frames::new();
    let mut rig = moving(&frames);
    let mut random = 1u64;
    rig.bus.wire.link.pauses = Some(Box::new(move |_| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let is_paused = (random >> 33).is_multiple_of(300);
        if is_paused { (random >> 40) % 3_000_000 } else { 0 }
    }));
    for _ in 0..6000 {
        let cycles = rig.driver.data.lost_frames;
        rig.cycles(1);
        assert_eq!(rig.state(), State::Active, "{:?} {cycles}", rig.driver.daemon.output.diagnostic);
    }
    assert!(rig.driver.counts.unanswered + rig.driver.counts.late > 20, "{:?}", rig.driver.counts);
}

#[test]
fn frames_lost_in_a_row_stop_all_and_the_bus_recovers() {
    let frames = Frames::new();
    let mut rig = moving(&frames);
    lose_for(&mut rig, 50_000_000);
    let way = way_mm(&mut rig, |rig| rig.cycles(1));
    assert!(way < MAX_WAY_MM, "{way} mm");
    rig.cycles(200);
    names_the_bus(&rig, "3 frames in a row are lost");
    for device in &rig.segment().devices {
        assert_eq!((device.al_status(), device.drive.state), (OP, DriveState::Fault));
    }
    assert_eq!(rig.state(), State::Fault);
    // An operator clears the fault, the drives' with it, and engages anew: no restart.
    rig.driver.daemon.motion_ns = None;
    rig.driver.daemon.ask(Request::Clear);
    rig.cycles(100);
    let pose = rig.driver.daemon.output.platform.unwrap().pose;
    rig.driver.daemon.hold(task_coordinates(&pose, &machine().machine.home));
    rig.engage();
    assert_eq!(rig.drive_states(), [DriveState::OperationEnabled; LEGS]);
}

/// The frames are back before the daemon could miss a measurement: the drives stop all the same, which would look like an impact.
#[test]
fn a_short_failure_of_the_bus_is_the_first_cause() {
    for (reachable, lost_us, words) in
        [(2, 0, "working counter 6, must be 18"), (LEGS, 3500, "3 frames in a row are lost")]
    {
        let frames = Frames::new();
        let mut rig = moving(&frames);
        rig.segment().reachable = reachable;
        lose_for(&mut rig, lost_us * 1000);
        let mut cycles = 0;
        way_mm(&mut rig, |rig| {
            rig.cycles(1);
            cycles += 1;
            if cycles == 1 {
                rig.segment().reachable = LEGS;
            }
        });
        names_the_bus(&rig, words);
        assert!(rig.driver.daemon.output.platform.is_some(), "the lengths are back");
        assert_eq!(rig.driver.daemon.measured.drive_fault, 0);
    }
}

#[test]
fn a_driver_that_is_killed_or_hangs_is_replaced_by_the_watchdogs() {
    let frames = Frames::new();
    let mut rig = moving(&frames);
    let way = way_mm(&mut rig, |rig| {
        let until_ns = rig.bus.wire.link.now_ns() + 1_000_000;
        rig.bus.wire.link.sleep_until(until_ns);
    });
    assert!(way < MAX_WAY_MM, "{way} mm");
    for device in &rig.segment().devices {
        assert_eq!((device.al_status(), device.al_status_code()), (SAFE_OP | ERROR, 0x1b));
        assert_eq!(device.drive.state, DriveState::Fault);
    }
    // Continued: no force of before the pause acts.
    rig.cycles(300);
    assert!(all_stopped(rig.drive_states()), "{:?}", rig.drive_states());
}

#[test]
fn a_daemon_that_is_killed_or_hangs_ends_the_forces() {
    let frames = Frames::new();
    let mut rig = moving(&frames);
    rig.driver.daemon.is_hung = true;
    let (cycles, way) = stop(&mut rig);
    assert!(cycles <= 22 && way < MAX_WAY_MM, "{cycles} cycles, {way} mm");
    rig.driver.daemon.is_hung = false;
    rig.cycles(100);
    assert!(all_stopped(rig.drive_states()), "a daemon that continues needs an operator");
    assert_eq!(rig.state(), State::Fault);
}

#[test]
fn a_daemon_that_stalls_for_a_moment_changes_nothing() {
    let frames = Frames::new();
    let mut rig = moving(&frames);
    rig.driver.daemon.is_hung = true;
    rig.cycles(5);
    rig.driver.daemon.is_hung = false;
    rig.cycles(1000);
    assert_eq!((rig.state(), rig.driver.counts.unanswered), (State::Active, 5));
}

#[test]
fn an_encoder_may_wrap_in_the_middle_of_the_stroke() {
    let home_m = hexad_core::model::inverse_geometry::leg_lengths(
        &machine().machine,
        &hexad_core::model::task::TaskState::at_rest(machine().machine.home).motion().pose,
    )[0];
    // 17 bits single-turn and 12 bits multi-turn, zero-extended to the 32 bits of the object.
    let of_29_bits = DRIVES.replace("= 1048576", "= 131072\nposition_bits = 29");
    for (text, half_range_m) in [(DRIVES, 40.96), (&of_29_bits, 40.96), (&of_29_bits, 81.92)] {
        let text = text.replace("offset_m = 1.2", &format!("offset_m = {}", home_m + 0.001 - half_range_m));
        let file = hexad_ethercat::drives_file::DrivesFile::parse(&text, "wrapping").unwrap();
        let frames = Frames::new();
        let segment = hexad_ethercat::simulation::segment(&file, &machine(), START_NS);
        let mut rig = Rig::new(&frames, &file, segment);
        rig.engage_and_move();
        rig.cycles(8000);
        assert_eq!(rig.state(), State::Active, "{:?}", rig.driver.daemon.output.diagnostic);
    }
}

#[test]
fn clocks_may_drift_by_50_ppm() {
    for drifts in [[50.0; LEGS], [-50.0; LEGS], [-50.0, 50.0, -50.0, 50.0, -50.0, 50.0]] {
        let frames = Frames::new();
        let segment = segment();
        let mut drifts_ppm = drifts.into_iter();
        let models = segment.devices.each_ref().map(|device| {
            let drift_ppm = drifts_ppm.next().unwrap();
            DeviceModel { drift_ppm, ..device.model }
        });
        let segment = Segment::new(models, segment.leg_of_device, segment.mechanics, START_NS);
        let mut rig = Rig::new(&frames, &drives(), segment);
        rig.engage_and_move();
        rig.cycles(4000);
        assert_eq!(rig.state(), State::Active, "{drifts:?} {:?}", rig.driver.daemon.output.diagnostic);
        let error_ns = rig.driver.daemon.stamp_ns as i64 - rig.segment().now_ns() as i64;
        assert!(error_ns.abs() < 1000, "stamps are off by {error_ns} ns");
    }
}
