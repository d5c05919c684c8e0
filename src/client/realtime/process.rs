//! Child processes, and the signals of this process.

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
