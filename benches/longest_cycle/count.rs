//! Instructions of one cycle: a child process executes it, and its parent counts the steps.

#![allow(unsafe_code, reason = "a child is a fork")]

use std::hint::black_box;

use hexad::control::controller::Controller;
use hexad::control::signals::inputs::Input;
use nix::errno::Errno;
use nix::sys::ptrace;
use nix::sys::signal::{Signal, raise};
use nix::sys::wait::{WaitStatus, waitpid};
use nix::unistd::{ForkResult, Pid, fork};

/// Whether this process may trace a child.
pub fn require_tracing() -> nix::Result<()> {
    traced(|| {}).map(drop)
}

/// Instructions of the next cycle of a controller.
pub fn instructions(controller: &Controller, input: &Input) -> u64 {
    let mut controller = controller.clone();
    let signals = traced(|| {}).expect("a child that can be traced");
    let all = traced(|| {
        black_box(controller.step(black_box(input)));
    });
    all.expect("a child that can be traced") - signals
}

/// Instructions of a child process between two signals, between which it does some work.
fn traced(work: impl FnOnce()) -> nix::Result<u64> {
    // SAFETY: the child has the one thread that forks. It calls the system, computes without allocation, and ends.
    match unsafe { fork() }? {
        ForkResult::Child => {
            let stop = || raise(Signal::SIGSTOP);
            let traced = ptrace::traceme().and_then(|()| stop());
            work();
            let end = traced.and_then(|()| stop());
            // SAFETY: ends the process at once, without the destructors of its parent.
            unsafe { libc::_exit(i32::from(end.is_err())) }
        }
        ForkResult::Parent { child } => count_to_next_stop(child),
    }
}

fn count_to_next_stop(child: Pid) -> nix::Result<u64> {
    waitpid(child, None)?;
    let mut count = 0;
    loop {
        ptrace::step(child, None)?;
        match waitpid(child, None)? {
            WaitStatus::Stopped(_, Signal::SIGTRAP) => count += 1,
            WaitStatus::Stopped(_, Signal::SIGSTOP) => break,
            _ => return Err(Errno::ECHILD),
        }
    }
    ptrace::kill(child)?;
    waitpid(child, None)?;
    Ok(count)
}
