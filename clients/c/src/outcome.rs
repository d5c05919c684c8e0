//! Outcomes of the functions: a number, and of a failure a text that the thread keeps.

use core::cell::RefCell;
use core::ffi::c_char;
use core::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Longest text of a failure, with the zero at its end \[bytes\].
const MAX_TEXT_BYTES: usize = 1024;

/// Outcome of a function. hexad_last_error has the text of all from HEXAD_INVALID on.
#[allow(non_camel_case_types, reason = "names of C")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum hexad_result {
    /// Done. Of hexad_latest_force: the forces may be applied.
    HEXAD_OK = 0,
    /// No force may be applied: close the brakes.
    HEXAD_BRAKE = 1,
    /// No message has arrived yet.
    HEXAD_NOTHING = 2,
    /// An argument is wrong, or the client was not opened in the role of the function.
    HEXAD_INVALID = 3,
    /// Another thread uses the client.
    HEXAD_BUSY = 4,
    /// The shared memory could not be used.
    HEXAD_SHARED_MEMORY = 5,
    /// No daemon of the machine was found.
    HEXAD_NO_DAEMON = 6,
    /// This user may not send requests.
    HEXAD_FORBIDDEN = 7,
    /// The daemon has refused the request.
    HEXAD_REFUSED = 8,
    /// The request was accepted and did not reach its state.
    HEXAD_NOT_COMPLETED = 9,
    /// Neither its state nor an answer came in time: it is not known whether the request was carried out.
    HEXAD_TIMED_OUT = 10,
    /// An error in this library: report it.
    HEXAD_INTERNAL = 11,
}

/// Failure of a function.
#[derive(Debug)]
pub struct Failure {
    result: hexad_result,
    text: String,
}

/// What a function returns inside.
pub type Outcome = Result<hexad_result, Failure>;

impl Failure {
    /// A failure with a sentence that says what to do.
    pub fn new(result: hexad_result, text: impl Display) -> Self {
        Self { result, text: text.to_string() }
    }

    /// A failure of the shared memory.
    pub fn of_port(error: impl Display) -> Self {
        Self::new(hexad_result::HEXAD_SHARED_MEMORY, error)
    }
}

thread_local! {
    static LAST: RefCell<[u8; MAX_TEXT_BYTES]> = const { RefCell::new([0; MAX_TEXT_BYTES]) };
}

/// Runs the content of a function: a failure leaves its text, and no panic leaves the library.
pub fn guard(act: impl FnOnce() -> Outcome) -> hexad_result {
    let failure = match catch_unwind(AssertUnwindSafe(act)) {
        Ok(Ok(result)) => return result,
        Ok(Err(failure)) => failure,
        Err(_) => Failure::new(hexad_result::HEXAD_INTERNAL, "libhexad panicked: report it"),
    };
    // Without effect only while the thread ends.
    let _ = LAST.try_with(|last| {
        let mut last = last.borrow_mut();
        last.fill(0);
        // The last byte remains zero.
        for (to, from) in last.iter_mut().take(MAX_TEXT_BYTES - 1).zip(failure.text.bytes()) {
            *to = from;
        }
    });
    failure.result
}

/// Text of the last failure in this thread.
pub fn last_error() -> *const c_char {
    LAST.try_with(|last| last.as_ptr().cast_const().cast::<c_char>()).unwrap_or(c"".as_ptr())
}

#[cfg(test)]
mod tests {
    use core::ffi::CStr;

    use super::*;

    fn text() -> String {
        // SAFETY: a string of this thread, copied before the next failure.
        unsafe { CStr::from_ptr(last_error()) }.to_string_lossy().into_owned()
    }

    #[test]
    fn a_panic_becomes_an_outcome_and_a_long_text_is_cut() {
        assert_eq!(guard(|| Ok(hexad_result::HEXAD_BRAKE)), hexad_result::HEXAD_BRAKE);
        assert_eq!(guard(|| panic!("a test of the guard")), hexad_result::HEXAD_INTERNAL);
        assert_eq!(text(), "libhexad panicked: report it");
        let long = "x".repeat(2 * MAX_TEXT_BYTES);
        let refused = guard(|| Err(Failure::new(hexad_result::HEXAD_REFUSED, &long)));
        assert_eq!((refused, text().len()), (hexad_result::HEXAD_REFUSED, MAX_TEXT_BYTES - 1));
        guard(|| Err(Failure::new(hexad_result::HEXAD_BUSY, "short")));
        assert_eq!(text(), "short");
    }
}
