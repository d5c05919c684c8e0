//! Time of one evaluation, on a machine that others use too.
//!
//! The clock is CPU time of this thread, so that preemption does not count; a sample is many passes over a
//! scene, so that the clock does not count either; results are medians of samples that are spread over the
//! whole run and interleaved with those of the other methods.

#![allow(unsafe_code, reason = "a system clock and a fence have no safe interface")]

use std::hint::black_box;

/// Evaluations in the first, calibrating passes.
const CALIBRATION: usize = 2000;

/// CPU time of this thread \[s\].
pub fn thread_time() -> f64 {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `now` is a valid timespec for the duration of the call, and the clock exists on every Linux.
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut now) };
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
}

/// Waits until everything before has been computed: between two evaluations it keeps the second from
/// starting while the first still runs. On architectures without such an instruction it does nothing, and
/// latency is throughput.
#[inline(always)]
fn fence() {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: needs SSE2, which every x86-64 has.
    unsafe {
        core::arch::x86_64::_mm_lfence();
    }
}

/// CPU time per evaluation \[ns\] of `passes` over the inputs.
#[inline(always)]
pub fn sample<I, O>(inputs: &[I], passes: usize, fenced: bool, evaluate: impl Fn(&I) -> O) -> f64 {
    let start = thread_time();
    for _ in 0..passes {
        if fenced {
            for input in inputs {
                black_box(&evaluate(black_box(input)));
                fence();
            }
        } else {
            for input in inputs {
                black_box(&evaluate(black_box(input)));
            }
        }
    }
    (thread_time() - start) * 1e9 / (passes * inputs.len().max(1)) as f64
}

/// The samples of one method on one scene.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Passes that make a sample last long enough; 0 before the first.
    passes: usize,
    throughput: Vec<f64>,
    latency: Vec<f64>,
}

impl Samples {
    /// Takes a sample of either kind with `measure(passes, fenced)`, each `seconds` long.
    pub fn take(&mut self, inputs: usize, seconds: f64, measure: impl Fn(usize, bool) -> f64) {
        if self.passes == 0 {
            let ns = measure(CALIBRATION.div_ceil(inputs), false);
            self.passes = ((seconds * 1e9 / (ns * inputs as f64)) as usize).max(1);
        }
        self.throughput.push(measure(self.passes, false));
        self.latency.push(measure(self.passes, true));
    }

    /// Adds what somebody else measured.
    pub fn add(&mut self, throughput: f64, latency: f64) {
        self.throughput.push(throughput);
        self.latency.push(latency);
    }

    /// Median time per evaluation, one after the other as fast as they come \[ns\].
    pub fn throughput(&self) -> f64 {
        median(&self.throughput)
    }

    /// Median time per evaluation with a fence in between \[ns\].
    pub fn latency(&self) -> f64 {
        median(&self.latency)
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
