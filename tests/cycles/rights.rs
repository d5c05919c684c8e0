//! What the kernel grants a real-time thread is in force.

use std::fs::File;
use std::io::Read;
use std::thread;

use hexad::messages::clock::monotonic_ns;
use hexad::realtime::clock::{Grid, sleep_until};
use hexad::realtime::setup::Shortfall;
use hexad::realtime::setup::deadline::{Reservation, reserve, times_exhausted};
use hexad::realtime::setup::idle::limit_wakeup_latency;

use hexad_support::not_run::lacking;

/// What a step returned; none, and the calling test is not run, where the system refuses it.
fn granted<T>(step: Result<T, Shortfall>) -> Option<T> {
    let refused = |Shortfall { what, reason, remedy }: &_| lacking(&format!("{what}: {reason}; {remedy}"));
    step.inspect_err(refused).ok()
}

const PERIOD_NS: u64 = 1_000_000;

/// Of a thread that never sleeps, the budget's share, with as much again for what the kernel notices late:
/// it looks at its ticks, some ms apart.
const MOST: f64 = 2.0 * 0.1;

#[allow(unsafe_code, reason = "the standard library does not say it")]
fn in_force() -> libc::sched_attr {
    // SAFETY: all-zero is a valid sched_attr, plain numbers.
    let mut attributes: libc::sched_attr = unsafe { std::mem::zeroed() };
    let size = size_of::<libc::sched_attr>();
    // SAFETY: 0 means the calling thread; `attributes` is valid for the call and its size is given.
    let done = unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut attributes, size, 0) };
    assert_eq!(done, 0);
    attributes
}

#[allow(unsafe_code, reason = "the standard library does not say it")]
fn processor_time_ns() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for the duration of the call.
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// In a thread of its own, if the kernel grants it.
fn reserved<T: Send + 'static>(reservation: Reservation, body: fn() -> T) -> Option<T> {
    let thread = thread::spawn(move || reserve(&reservation).map(|()| body()));
    granted(thread.join().expect("no panic"))
}

#[test]
#[ignore = "second tier: needs real-time rights"]
fn a_reservation_is_in_force() {
    let reservation = Reservation::new(1_000_000, 200_000);
    assert_eq!(reservation, Reservation { budget_ns: 600_000, period_ns: 1_000_000 });
    let Some(attributes) = reserved(reservation, in_force) else { return };
    assert_eq!(attributes.sched_policy, libc::SCHED_DEADLINE as u32);
    let libc::sched_attr { sched_runtime, sched_deadline, sched_period, .. } = attributes;
    assert_eq!([sched_runtime, sched_deadline, sched_period], [600_000, 1_000_000, 1_000_000]);
}

#[test]
#[ignore = "second tier: needs real-time rights"]
fn a_thread_that_never_sleeps_is_held_and_counted() {
    let before = times_exhausted();
    let spins = || {
        let (from_ns, used_ns) = (monotonic_ns(), processor_time_ns());
        while monotonic_ns() - from_ns < 500_000_000 {}
        (processor_time_ns() - used_ns) as f64 / (monotonic_ns() - from_ns) as f64
    };
    let Some(share) = reserved(Reservation { budget_ns: 2_000_000, period_ns: 20_000_000 }, spins) else {
        return;
    };
    assert!(share < MOST, "{share} of a processor, with a tenth reserved");
    assert!(times_exhausted() > before);
}

#[test]
#[ignore = "second tier: needs real-time rights"]
fn a_thread_that_sleeps_to_its_grid_is_not_held() {
    let cycles = || {
        let grid = Grid::new(PERIOD_NS, 0);
        let mut late = vec![];
        for cycle in 0..500 {
            let release_ns = grid.next_after(monotonic_ns());
            // The first is late, and must not make the others so.
            sleep_until(if cycle == 0 { release_ns + PERIOD_NS / 2 } else { release_ns });
            late.push(monotonic_ns() - release_ns);
            // A quarter of the period, of 0.4 reserved.
            while monotonic_ns() < release_ns + PERIOD_NS / 4 {}
        }
        late.sort_unstable();
        late[late.len() / 2]
    };
    let Some(median_ns) = reserved(Reservation::new(PERIOD_NS, 0), cycles) else { return };
    // Held until its deadline it would wake most of a period late.
    assert!(median_ns < PERIOD_NS / 2, "{median_ns} ns late");
}

#[test]
#[ignore = "second tier: needs real-time rights"]
fn a_bound_on_idle_states_is_in_force_until_dropped() {
    const ASKED_US: i32 = 123;
    let Some(_held) = granted(limit_wakeup_latency(ASKED_US)) else { return };
    // The least that any process asks for.
    let mut in_force = [0; 4];
    File::open("/dev/cpu_dma_latency")
        .and_then(|mut file| file.read_exact(&mut in_force))
        .expect("the bound");
    assert!(i32::from_ne_bytes(in_force) <= ASKED_US);
}
