//! Functions that do what the loop must not, one thing each, and two that do not.
#![allow(unsafe_code, reason = "a system call and a bare trap, to see them found")]

use std::hint::black_box;
use std::sync::Mutex;

/// A function, by its name in the symbol table, and what the walk from it must find.
pub type Control = (&'static str, &'static str);

/// Names the functions in a table that keeps them in the executable.
macro_rules! controls {
    ($($name:ident: $finding:expr,)*) => {
        pub fn all() -> Vec<Control> {
            vec![$({
                black_box($name as *const ());
                (concat!("shipped::no_panic::controls::", stringify!($name)), $finding)
            }),*]
        }
    };
}

controls! {
    bounds: "core::panicking::panic_bounds_check",
    slice: "core::slice::",
    division: "core::panicking::",
    remainder_of_minimum: "core::panicking::",
    unwrap: "core::option::",
    clamp: "core::panicking::",
    deep: "controls::bounds > core::panicking::panic_bounds_check",
    boundary_that_must_not_unwind: "core::panicking::",
    abort: "std::process::abort",
    bare_trap: "trap or system call",
    allocation: "alloc",
    lock: "std::sys::",
    print: "std::io::",
    other_import: "getppid",
    arithmetic_of_the_system: "atan2",
    system_call: "trap or system call",
    pointer: "call through a pointer",
    // x86-64 code names the place of the pointer, and the analysis reads it.
    pointer_that_may_change: if cfg!(target_arch = "x86_64") { "code without a name" } else { "call through a pointer" },
    tail_call_of_pointer: "call through a pointer",
    method_of_object: "call through a pointer",
    one_of_two_pointers: "call through a pointer",
}

pub mod clean {
    //! What must not be found.

    use super::black_box;

    #[inline(never)]
    pub fn computes(x: f64, index: usize) -> f64 {
        let (sin, cos) = libm::sincos(x);
        [sin, cos, libm::atan2(x, 2.0), libm::atan2(cos, sin)][index % 4]
    }

    /// Arms that differ too much for anything but a jump table.
    #[inline(never)]
    pub fn matches(which: u8, x: f64) -> f64 {
        match which {
            0 => libm::atan2(x, 2.0),
            1 => black_box(x) + 1.0,
            2 => (x * 3.0).sqrt(),
            3 => black_box(7.0) / x,
            4 => computes(x, 3),
            5 => black_box(x) - black_box(x),
            6 => x.abs(),
            _ => 0.0,
        }
    }

    pub fn all() -> [&'static str; 2] {
        black_box((computes as *const (), matches as *const ()));
        ["shipped::no_panic::controls::clean::computes", "shipped::no_panic::controls::clean::matches"]
    }
}

#[inline(never)]
fn bounds(values: &[f64], index: usize) -> f64 {
    values[index]
}

#[inline(never)]
fn slice(to: &mut [f64], from: &[f64]) {
    to[..from.len()].copy_from_slice(from);
}

#[inline(never)]
fn division(a: u64, b: u64) -> u64 {
    a / b
}

#[inline(never)]
fn remainder_of_minimum(a: i64, b: i64) -> i64 {
    if b == 0 { 0 } else { a % b }
}

#[inline(never)]
fn unwrap(value: Option<&f64>) -> f64 {
    *value.unwrap()
}

#[inline(never)]
fn clamp(value: f64, limit: f64) -> f64 {
    value.clamp(-limit, limit)
}

#[inline(never)]
fn deep(values: &[f64]) -> f64 {
    bounds(values, 3) + bounds(values, 4)
}

#[inline(never)]
extern "C" fn boundary_that_must_not_unwind(values: &Vec<f64>) -> f64 {
    values[5]
}

#[inline(never)]
fn abort(value: f64) {
    if value.is_nan() {
        std::process::abort();
    }
}

#[inline(never)]
fn bare_trap(value: f64) -> f64 {
    if value.is_nan() {
        // SAFETY: ends the process, if anybody ever ran it.
        #[cfg(target_arch = "x86_64")]
        unsafe {
            core::arch::asm!("ud2")
        };
        #[cfg(target_arch = "aarch64")]
        unsafe {
            core::arch::asm!("brk #1")
        };
    }
    value
}

#[inline(never)]
fn allocation(length: usize) -> Vec<u8> {
    Vec::with_capacity(length)
}

#[inline(never)]
fn lock(value: &Mutex<f64>) -> bool {
    value.lock().is_ok()
}

#[inline(never)]
fn print(value: u64) {
    println!("{value}");
}

#[inline(never)]
fn other_import() -> i32 {
    // SAFETY: has no conditions.
    unsafe { libc::getppid() }
}

#[inline(never)]
fn arithmetic_of_the_system() -> f64 {
    black_box(1.0_f64).atan2(black_box(2.0))
}

#[inline(never)]
fn system_call() -> usize {
    let mut result;
    // SAFETY: sched_yield, which has no conditions.
    #[cfg(target_arch = "x86_64")]
    unsafe {
        core::arch::asm!("syscall", inout("rax") 24_usize => result, out("rcx") _, out("r11") _)
    };
    // SAFETY: as above.
    #[cfg(target_arch = "aarch64")]
    unsafe {
        core::arch::asm!("svc #0", in("x8") 124_usize, out("x0") result)
    };
    result
}

#[inline(never)]
fn pointer(function: fn(f64) -> f64) -> f64 {
    function(1.0) + 1.0
}

#[inline(never)]
fn pointer_that_may_change(set: bool) -> f64 {
    // SAFETY: as of now one thread, if anybody ever ran it.
    unsafe {
        static mut HOOK: fn(f64) -> f64 = f64::sqrt;
        if set {
            HOOK = black_box(f64::ceil);
        }
        HOOK(1.0)
    }
}

#[inline(never)]
fn tail_call_of_pointer(functions: &[fn(f64) -> f64; 2]) -> f64 {
    functions[1](1.0)
}

#[inline(never)]
fn method_of_object(object: &dyn std::fmt::Debug, to: &mut std::fmt::Formatter<'_>) -> bool {
    object.fmt(to).is_ok()
}

type Import = extern "C" fn(f64, f64) -> f64;

/// One of the two is allowed.
#[inline(never)]
fn one_of_two_pointers(which: bool, function: Import) -> f64 {
    unsafe extern "C" {
        safe fn atan2(y: f64, x: f64) -> f64;
    }
    let function = if which {
        black_box(2.0);
        atan2 as Import
    } else {
        function
    };
    function(1.0, 2.0) + function(2.0, 1.0)
}
