//! More tests at once than processors: most of these wait most of the time.

use std::env;
use std::thread::available_parallelism;

const TESTS_PER_PROCESSOR: usize = 2;

/// Called before `main`: the harness reads the number from the command line or from this variable, and nowhere else.
#[used]
#[allow(unsafe_code, reason = "a test program has no other way to choose for itself")]
#[unsafe(link_section = ".init_array")]
static BEFORE_MAIN: extern "C" fn() = set_test_threads;

#[allow(unsafe_code, reason = "see above")]
extern "C" fn set_test_threads() {
    if env::var_os("RUST_TEST_THREADS").is_none() {
        let count = TESTS_PER_PROCESSOR * available_parallelism().map_or(1, usize::from);
        // SAFETY: before `main` there is one thread.
        unsafe { env::set_var("RUST_TEST_THREADS", count.to_string()) };
    }
}
