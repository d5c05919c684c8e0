//! Processes started by this one, and the signals that reach this one.

/// Asks a process to stop (SIGTERM).
pub fn terminate(process_id: u32) {
    // SAFETY: plain numbers. The caller holds the child unreaped, so the number is still its own.
    unsafe { libc::kill(process_id as libc::pid_t, libc::SIGTERM) };
}

/// Has the kernel send SIGTERM to this process when the one that started it dies, even by SIGKILL.
/// `parent` is its number; false if it is gone already.
pub fn stop_with_parent(parent: u32) -> bool {
    // SAFETY: plain numbers; cannot fail with a valid signal.
    unsafe {
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM as libc::c_ulong, 0_usize, 0_usize, 0_usize);
        libc::getppid() as u32 == parent
    }
}

/// Has signals to this process handled by its other threads. Linux may choose any thread that does not
/// refuse, and a handler calls the system.
pub fn block_signals() {
    // SAFETY: all-zero is a valid signal set, filled before it is read; a null pointer for the old mask is
    // allowed. Cannot fail with these arguments.
    unsafe {
        let mut all: libc::sigset_t = core::mem::zeroed();
        libc::sigfillset(&mut all);
        libc::pthread_sigmask(libc::SIG_BLOCK, &all, core::ptr::null_mut());
    }
}
