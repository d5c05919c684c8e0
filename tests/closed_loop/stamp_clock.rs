//! With external release: stamps that do not advance as the daemon's clock does end control within a bounded time.

use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::Input;
use hexad::control::signals::state::Request;
use hexad::model::task::TaskState;

use hexad_support::deployed;
use hexad_support::rig::Rig;

/// Cycles under control until it ends, with stamps that advance by `rate` of the daemon's clock, and the cause. Every message
/// arrives up to `jitter_ns` late.
fn end(rate: f64, jitter_ns: u64, cycles: u64) -> Option<(u64, DiagnosticCode)> {
    let config = deployed("motion_base");
    let mut rig = Rig::new(&config, &config.machine);
    let home = TaskState::at_rest(config.machine.home);
    // The drive's clock began at another time.
    let began_ns = rig.now_ns / 2;
    let mut stamp_ns = began_ns as f64;
    for cycle in 0.. {
        let arrived_ns = rig.now_ns + cycle * 7919 % (jitter_ns + 1);
        let good = rig.input(&home);
        let time_ns = stamp_ns as u64;
        let mut input =
            Input { release_ns: time_ns, clock_offset_ns: time_ns.wrapping_sub(arrived_ns) as i64, ..good };
        input.setpoint.as_mut().unwrap().time_ns = time_ns;
        input.measurement.as_mut().unwrap().time_ns = time_ns;
        if cycle == 200 {
            rig.ask(Request::Engage);
        }
        let output = rig.cycle(&input);
        let has_begun = cycle > 300;
        if cycle == 300 {
            assert!(output.state.has_control(), "{:?}", output.request_diagnostic);
        }
        if has_begun && !output.state.has_control() {
            return Some((cycle - 300, output.diagnostic.code));
        }
        if cycle > 300 + cycles {
            return None;
        }
        stamp_ns += rig.parameters.period_ns as f64 * if has_begun { rate } else { 1.0 };
    }
    None
}

#[test]
fn stamps_that_stand_still_or_run_slow_or_fast_end_control() {
    // The bound is timeouts.measured_ms, 20 ms.
    for (rate, cycles) in [(0.0, 22), (0.5, 42), (0.9, 223), (0.95, 502), (1.5, 42), (2.0, 22), (10.0, 4)] {
        let found = end(rate, 0, 2 * cycles);
        println!("rate {rate}: {found:?}");
        let (after, code) = found.expect("control ends");
        assert!(after <= cycles + 3, "rate {rate}: {after} cycles");
        assert_eq!(code, DiagnosticCode::StampClockInvalid, "rate {rate}");
    }
}

#[test]
#[ignore = "second tier: takes long"]
fn clocks_that_drift_and_messages_that_arrive_late_do_not() {
    for rate in [0.995, 0.9999, 1.0, 1.0001, 1.005] {
        for jitter_ns in [0, 15_000_000] {
            assert_eq!(end(rate, jitter_ns, 20_000), None, "rate {rate}, {jitter_ns} ns late");
        }
    }
}
