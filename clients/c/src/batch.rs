//! Inverse dynamics of many motions: `hexad_machine::analysis::batch` on arrays of the caller.

use core::ffi::c_char;
use std::path::Path;
use std::{ptr, slice};

use ::hexad_core::model::active_forces::InverseDynamics;
use ::hexad_core::model::fidelity::Fidelity;
use ::hexad_machine::analysis::batch::{self, Row, forces_of_rows};
use ::hexad_machine::config::Config;

use crate::outcome::hexad_result::{self, HEXAD_INVALID, HEXAD_OK};
use crate::outcome::{Failure, guard};
use crate::text;

/// The model of a machine. Any number of threads may use it at once.
#[allow(non_camel_case_types, reason = "a name of C")]
pub struct hexad_machine(InverseDynamics);

/// Reads a machine file. Returns NULL on failure; hexad_last_error has a line for each error of the file, with its place and
/// bound. The machine belongs to the caller until hexad_close_machine. No daemon is needed.
///
/// # Safety
///
/// `path` is NULL or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_open_machine(path: *const c_char) -> *mut hexad_machine {
    let mut opened = ptr::null_mut();
    guard(|| {
        // SAFETY: the caller's promise.
        let path = Path::new(unsafe { text(path, "path") }?);
        let config = Config::load(path).map_err(|error| Failure::new(HEXAD_INVALID, error))?;
        opened = Box::into_raw(Box::new(hexad_machine(batch::model(&config.machine))));
        Ok(HEXAD_OK)
    });
    opened
}

/// Frees the machine; NULL is allowed.
///
/// # Safety
///
/// `machine` is NULL or from hexad_open_machine, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_close_machine(machine: *mut hexad_machine) -> hexad_result {
    guard(|| {
        if !machine.is_null() {
            // SAFETY: from `Box::into_raw` in hexad_open_machine.
            drop(unsafe { Box::from_raw(machine) });
        }
        Ok(HEXAD_OK)
    })
}

/// Forces of the actuators [N] at `count` motions: arrays of `count` rows of six numbers, one row after the other. X is alpha, beta,
/// gamma, x, y, z [rad, m]; X' and X'' are its derivatives. A row of `forces` is NaN in all six where the pose is singular or a number
/// of the motion is not finite, and the result is still HEXAD_OK. `fidelity` is "exact" or another value of `fidelity` in machine
/// files, but "auto". The work is done in `threads` threads, 0 for one per processor; the forces do not depend on their number.
///
/// # Safety
///
/// `machine` is NULL or from hexad_open_machine; `fidelity` is NULL or a string; `x`, `x_rate` and `x_accel` are NULL or `count` rows
/// that nobody changes, `forces` is NULL or room for as many.
#[allow(clippy::too_many_arguments, reason = "arrays of C are pointers")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hexad_inverse_dynamics_batch(
    machine: *const hexad_machine,
    fidelity: *const c_char,
    count: usize,
    x: *const f64,
    x_rate: *const f64,
    x_accel: *const f64,
    forces: *mut f64,
    threads: u32,
) -> hexad_result {
    guard(|| {
        // SAFETY: the caller's promise.
        let machine = unsafe { machine.as_ref() };
        let machine = machine.ok_or_else(|| Failure::new(HEXAD_INVALID, "the machine is NULL"))?;
        // SAFETY: the caller's promise.
        let fidelity = fidelity_by_name(unsafe { text(fidelity, "fidelity") }?)?;
        if count == 0 {
            return Ok(HEXAD_OK);
        }
        let inputs = [(x, "x"), (x_rate, "x_rate"), (x_accel, "x_accel")];
        check_rows(forces, count, "forces")?;
        for (input, name) in inputs {
            check_rows(input, count, name)?;
            let apart_by = input.addr().abs_diff(forces.addr());
            if apart_by < count * size_of::<Row>() {
                let text = format!("forces must be another array than {name}: they overlap");
                return Err(Failure::new(HEXAD_INVALID, text));
            }
        }
        // SAFETY: rows by the caller's promise, neither NULL nor unaligned nor too many.
        let motions = inputs.map(|(rows, _)| unsafe { slice::from_raw_parts(rows.cast::<Row>(), count) });
        // SAFETY: the same, and apart from the motions.
        let forces = unsafe { slice::from_raw_parts_mut(forces.cast::<Row>(), count) };
        forces_of_rows(&machine.0, fidelity, motions, forces, threads as usize);
        Ok(HEXAD_OK)
    })
}

fn fidelity_by_name(name: &str) -> Result<Fidelity, Failure> {
    Fidelity::by_name(name).ok_or_else(|| {
        let names = Fidelity::ALL.map(Fidelity::name).join(", ");
        Failure::new(HEXAD_INVALID, format!("fidelity = {name:?} must be one of {names}"))
    })
}

/// Whether an array of the caller can be one of rows.
fn check_rows(rows: *const f64, count: usize, name: &str) -> Result<(), Failure> {
    let largest = isize::MAX as usize / size_of::<Row>();
    let text = match rows {
        _ if rows.is_null() => format!("{name} is NULL"),
        _ if !rows.is_aligned() => format!("{name} = {rows:p} must be a multiple of {}", align_of::<f64>()),
        _ if count > largest => format!("count = {count} must be at most {largest}"),
        _ => return Ok(()),
    };
    Err(Failure::new(HEXAD_INVALID, text))
}
