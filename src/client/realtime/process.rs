//! Child processes, and the signals of this process.

use core::ffi::c_int;
use std::io;

/// Handles a signal of this process. A system call that it interrupts continues.
///
/// # Safety
///
/// The handler must do only what may be done in one: atomic operations, `clock_gettime`.
pub(super) unsafe fn handle_signal(signal: c_int, handler: extern "C" fn(c_int)) -> io::Result<()> {
    // SAFETY: an all-zero `sigaction` is valid and is filled before use. A null pointer for the old action is allowed.
    let result = unsafe {
        let mut action: libc::sigaction = core::mem::zeroed();
        action.sa_sigaction = handler as libc::sighandler_t;
        action.sa_flags = libc::SA_RESTART;
        libc::sigemptyset(&mut action.sa_mask);
        libc::sigaction(signal, &action, core::ptr::null_mut())
    };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Sends SIGTERM to a process.
pub fn terminate(process_id: u32) {
    // SAFETY: plain numbers. The caller holds the child unreaped, so the number is still its own.
    unsafe { libc::kill(process_id as libc::pid_t, libc::SIGTERM) };
}

/// Makes the kernel send SIGTERM to this process when its parent dies, even by SIGKILL. `parent` is the parent's
/// process id; false if it has ended already.
pub fn stop_with_parent(parent: u32) -> bool {
    // SAFETY: plain numbers; cannot fail with a valid signal.
    unsafe {
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM as libc::c_ulong, 0_usize, 0_usize, 0_usize);
        libc::getppid() as u32 == parent
    }
}

/// Blocks all signals in the calling thread: other threads of the process handle them. Linux delivers a signal to any
/// thread that does not block it, and a handler makes system calls.
pub fn block_signals() {
    // SAFETY: all-zero is a valid signal set, filled before it is read; a null pointer for the old mask is
    // allowed. Cannot fail with these arguments.
    unsafe {
        let mut all: libc::sigset_t = core::mem::zeroed();
        libc::sigfillset(&mut all);
        libc::pthread_sigmask(libc::SIG_BLOCK, &all, core::ptr::null_mut());
    }
}
