//! Signals that post a request: the way to stop that needs no socket and no shared memory.

use core::ffi::c_int;
use core::ptr;
use core::sync::atomic::{AtomicPtr, AtomicU32, Ordering};
use std::io;

use super::process::handle_signal;
use super::request_word::RequestWord;
use crate::messages::clock::monotonic_ns;

/// Word that the handlers post to.
static WORD: AtomicPtr<RequestWord> = AtomicPtr::new(ptr::null_mut());
/// Numbers of the requests of SIGUSR1 and SIGUSR2.
static REQUESTS: [AtomicU32; 2] = [AtomicU32::new(0), AtomicU32::new(0)];

/// Makes SIGUSR1 and SIGUSR2 of this process post the requests with these numbers to `word`.
pub fn post_on_signals(word: &'static RequestWord, requests: [u32; 2]) -> io::Result<()> {
    REQUESTS.iter().zip(requests).for_each(|(stored, request)| stored.store(request, Ordering::Relaxed));
    WORD.store(ptr::from_ref(word).cast_mut(), Ordering::Release);
    for signal in [libc::SIGUSR1, libc::SIGUSR2] {
        // SAFETY: the handler calls only atomic operations and clock_gettime.
        unsafe { handle_signal(signal, handle) }?;
    }
    Ok(())
}

extern "C" fn handle(signal: c_int) {
    let [first, second] = &REQUESTS;
    let request = if signal == libc::SIGUSR1 { first } else { second };
    // SAFETY: null, or a reference that lives as long as the process.
    if let Some(word) = unsafe { WORD.load(Ordering::Acquire).as_ref() } {
        let _ = word.post(request.load(Ordering::Relaxed), monotonic_ns());
    }
}
