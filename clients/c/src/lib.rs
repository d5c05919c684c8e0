//! libhexad: the C ABI of hexad's topics, of its control socket and of its model at many motions.
//!
//! The header `include/hexad.h` follows from this crate by cbindgen, the structs of the messages from
//! `hexad messages --language c`. Nothing is declared twice. No panic leaves a function, and an error is a number with a text
//! ([`hexad_last_error`]).
//!
//! The sandwich of each function: [`outcome::guard`] catches panics and keeps the text, [`client::with`] checks the handle.

pub mod batch;
pub mod client;
pub mod frames;
pub mod outcome;
pub mod request;

use core::ffi::{CStr, c_char};
use std::ptr;

use ::hexad_client::messages::clock::monotonic_ns;
use ::hexad_client::messages::{
    ForceMessage, MeasuredMessage, SetpointMessage, StatisticsMessage, StatusMessage,
};

use self::client::{Ports, hexad_client, with};
use self::outcome::hexad_result::{self, HEXAD_BRAKE, HEXAD_INVALID, HEXAD_NOTHING, HEXAD_OK};
use self::outcome::{Failure, Outcome, guard, last_error};

/// Version of this ABI, which is also the number of libhexad.so.0.
pub const HEXAD_ABI: u32 = 0;

/// Role of a client: publishes measurements and receives forces.
pub const HEXAD_DRIVER: u32 = 1;
/// Role of a client: publishes setpoints; receives status, statistics and measurements.
pub const HEXAD_SOURCE: u32 = 2;
/// Role of a client: receives status, statistics and measurements.
pub const HEXAD_MONITOR: u32 = 4;
/// Added to a role for a daemon with `release = "lockstep"`: all times are those of the measured messages.
pub const HEXAD_SIMULATED: u32 = 8;

/// Version of the ABI of the library that is loaded: HEXAD_ABI of its header.
#[unsafe(no_mangle)]
pub extern "C" fn hexad_abi() -> u32 {
    HEXAD_ABI
}

/// CLOCK_MONOTONIC [ns], the clock of all stamps.
#[unsafe(no_mangle)]
pub extern "C" fn hexad_monotonic_ns() -> u64 {
    monotonic_ns()
}

/// Text of the last failure in this thread; empty before the first. It is valid until the next failure in this thread.
#[unsafe(no_mangle)]
pub extern "C" fn hexad_last_error() -> *const c_char {
    last_error()
}

/// Joins the topics of a machine (`name` of its file) in one or several roles (their sum), as the user of the daemon.
/// Returns NULL on failure. The client belongs to the caller until hexad_close, and to this process: a child of fork opens its own.
///
/// # Safety
///
/// `machine` is NULL or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_open(machine: *const c_char, roles: u32) -> *mut hexad_client {
    let mut opened = ptr::null_mut();
    guard(|| {
        // SAFETY: the caller's promise.
        let machine = unsafe { text(machine, "machine") }?;
        opened = Box::into_raw(Box::new(hexad_client::new(Ports::open(machine, roles)?)));
        Ok(HEXAD_OK)
    });
    opened
}

/// Leaves the topics and frees the client; NULL is allowed. Returns HEXAD_BUSY, and frees nothing, while another thread uses
/// it. In a child of fork it does nothing: the client is that of the parent.
///
/// # Safety
///
/// `client` is NULL or from hexad_open, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_close(client: *mut hexad_client) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        if !unsafe { client.as_ref() }.is_some_and(hexad_client::is_own) {
            return Ok(HEXAD_OK);
        }
        // SAFETY: the caller's promise.
        unsafe { with(client, |_| Ok(HEXAD_OK)) }?;
        // SAFETY: from `Box::into_raw` in hexad_open, and no call is under way.
        drop(unsafe { Box::from_raw(client) });
        Ok(HEXAD_OK)
    })
}

/// Publishes a measurement for the instant at which the sensors were sampled [ns]. The library fills in the header of the
/// message that it sends.
///
/// # Safety
///
/// `client` is NULL or from hexad_open; `measured` is NULL or a message.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_publish_measured(
    client: *mut hexad_client,
    time_ns: u64,
    measured: *const MeasuredMessage,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let message = unsafe { read(measured, "measured") }?;
        // SAFETY: the caller's promise.
        unsafe { with(client, |ports| ports.driver()?.publish(time_ns, message)) }
    })
}

/// Judges the newest force message with a longest age [ns]: HEXAD_OK if its forces may be applied now, else HEXAD_BRAKE.
/// Called in every period it is the driver's watchdog: without new messages the last one becomes too old. `force` receives
/// the message in either case; zeros before the first. Damaged, repeated and older messages never get here. In simulated time
/// now is the time of the last measurement that this client has published.
///
/// # Safety
///
/// `client` is NULL or from hexad_open; `force` is NULL or room for a message.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_latest_force(
    client: *mut hexad_client,
    longest_age_ns: u64,
    force: *mut ForceMessage,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let (message, now_ns) =
            unsafe { with(client, |ports| ports.driver().map(client::Driver::latest_force)) }?;
        // SAFETY: the caller's promise.
        unsafe { write(force, message, "force") }?;
        Ok(verdict(&message, now_ns, longest_age_ns))
    })
}

/// The same judgement of a message from anywhere at any instant [ns], but for its order: age, schema, checksum, valid, finite forces.
///
/// # Safety
///
/// `force` is NULL or a message.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_judge_force(
    force: *const ForceMessage,
    now_ns: u64,
    longest_age_ns: u64,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let message = unsafe { read(force, "force") }?;
        Ok(verdict(&message, now_ns, longest_age_ns))
    })
}

fn verdict(message: &ForceMessage, now_ns: u64, longest_age_ns: u64) -> hexad_result {
    if message.may_be_applied(now_ns, longest_age_ns) { HEXAD_OK } else { HEXAD_BRAKE }
}

/// Publishes a setpoint for an instant [ns]. The library fills in the header of the message that it sends.
///
/// # Safety
///
/// `client` is NULL or from hexad_open; `setpoint` is NULL or a message.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_publish_setpoint(
    client: *mut hexad_client,
    time_ns: u64,
    setpoint: *const SetpointMessage,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let message = unsafe { read(setpoint, "setpoint") }?;
        // SAFETY: the caller's promise.
        unsafe { with(client, |ports| ports.source()?.publish_setpoint(time_ns, message)) }
    })
}

/// Sends a request (HEXAD_REQUEST_...) for a cycle in simulated time, and returns when the daemon has posted it: call it before
/// hexad_publish_setpoint with the same time. The cycle at `cycle_ns` obeys it, none before, but a stop, off or estop does not wait. The
/// status of that cycle shows whether it was refused. It waits for the daemon, up to 3 s; in real time use hexad_request.
///
/// # Safety
///
/// `client` is NULL or from hexad_open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_request_in_cycle(
    client: *mut hexad_client,
    cycle_ns: u64,
    request: u32,
) -> hexad_result {
    // SAFETY: the caller's promise.
    guard(|| unsafe { with(client, |ports| ports.source()?.request_in_cycle(cycle_ns, request)) })
}

/// The newest status: HEXAD_OK if one has arrived since the client was opened, else HEXAD_NOTHING. The same message is
/// returned again until another arrives; its header has the time.
///
/// # Safety
///
/// `client` is NULL or from hexad_open; `status` is NULL or room for a message.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_latest_status(
    client: *mut hexad_client,
    status: *mut StatusMessage,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let found = unsafe { with(client, |ports| ports.monitor().map(client::Monitor::latest_status)) }?;
        // SAFETY: the caller's promise.
        unsafe { write_found(status, found, "status") }
    })
}

/// The newest statistics of the loop, in the same way. The daemon sends them every second.
///
/// # Safety
///
/// `client` is NULL or from hexad_open; `statistics` is NULL or room for a message.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_latest_statistics(
    client: *mut hexad_client,
    statistics: *mut StatisticsMessage,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let found = unsafe { with(client, |ports| ports.monitor().map(client::Monitor::latest_statistics)) }?;
        // SAFETY: the caller's promise.
        unsafe { write_found(statistics, found, "statistics") }
    })
}

/// The newest measurement of the driver, in the same way.
///
/// # Safety
///
/// `client` is NULL or from hexad_open; `measured` is NULL or room for a message.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_latest_measured(
    client: *mut hexad_client,
    measured: *mut MeasuredMessage,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let found = unsafe { with(client, |ports| ports.monitor().map(client::Monitor::latest_measured)) }?;
        // SAFETY: the caller's promise.
        unsafe { write_found(measured, found, "measured") }
    })
}

/// Sends a request (HEXAD_REQUEST_...) over the control socket and waits until its state is reached, at most `within_s`
/// seconds and two more. `until_ready` also waits for measurement and setpoint where they are missing. It needs no client,
/// and any user whom the machine file admits may call it. hexad_last_error has the daemon's reason. It does what the command of the
/// same name does: a stop, off or estop goes to every daemon of the machine at once, and counts if that of the service, else of this
/// user or of root has confirmed it. Where the socket does not answer within half a second, an emergency stop and off go by SIGUSR1,
/// and then last until a clear; a stop goes by SIGUSR2. HEXAD_TIMED_OUT means that it is not known whether the platform is stopped.
///
/// # Safety
///
/// `machine` is NULL or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_request(
    machine: *const c_char,
    request: u32,
    until_ready: bool,
    within_s: f64,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let machine = unsafe { text(machine, "machine") }?;
        request::send(machine, request, until_ready, within_s)
    })
}

/// A string of the caller.
///
/// # Safety
///
/// `pointer` is NULL or a string that lives during the call.
unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, Failure> {
    if pointer.is_null() {
        return Err(Failure::new(HEXAD_INVALID, format!("{name} is NULL")));
    }
    // SAFETY: the caller's promise.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| Failure::new(HEXAD_INVALID, format!("{name} is not UTF-8")))
}

/// A message of the caller, at any alignment.
///
/// # Safety
///
/// `pointer` is NULL or a message.
unsafe fn read<T: Copy>(pointer: *const T, name: &str) -> Result<T, Failure> {
    if pointer.is_null() {
        return Err(Failure::new(HEXAD_INVALID, format!("{name} is NULL")));
    }
    // SAFETY: the caller's promise; each pattern of bits is a message.
    Ok(unsafe { pointer.read_unaligned() })
}

/// Writes a message for the caller.
///
/// # Safety
///
/// `pointer` is NULL or room for a message.
unsafe fn write<T: Copy>(pointer: *mut T, message: T, name: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(Failure::new(HEXAD_INVALID, format!("{name} is NULL")));
    }
    // SAFETY: the caller's promise.
    unsafe { pointer.write_unaligned(message) };
    Ok(())
}

/// Writes a message if there is one.
///
/// # Safety
///
/// `pointer` is NULL or room for a message.
unsafe fn write_found<T: Copy>(pointer: *mut T, found: Option<T>, name: &str) -> Outcome {
    let Some(message) = found else { return Ok(HEXAD_NOTHING) };
    // SAFETY: the caller's promise.
    unsafe { write(pointer, message, name) }?;
    Ok(HEXAD_OK)
}
