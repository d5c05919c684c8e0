//! Denormal numbers (below 2.2e-308) count as zero: a processor may take a hundred cycles longer for them.
//!
//! Rust does not define the meaning of a program whose floating-point environment is not the default: the
//! compiler may compute with denormals where it folds constants, and the processor then without. Here that
//! is the only consequence: every operation is still one of the processor's, and a term differs by less than
//! 2.3e-308 of a unit that nothing here resolves below 1e-12. No index, length or pointer is computed from
//! a floating-point number, so none can be wrong by it.
//!
//! It holds for the calling thread and those it starts; the daemon does it in the real-time thread alone.
//! A replay that repeats its cycles to the last bit must do it too.

/// Makes the calling thread treat denormal inputs and results as zero.
#[cfg(target_arch = "x86_64")]
pub fn flush() {
    /// Bits of MXCSR: denormals are zero, flush to zero.
    const DAZ_AND_FTZ: u32 = 1 << 6 | 1 << 15;
    let mut control = 0_u32;
    // SAFETY: reads and writes the control register of this thread and four bytes that are its own. Every
    // x86-64 processor has both bits. The module's head says why the changed arithmetic is harmless.
    unsafe {
        core::arch::asm!("stmxcsr [{}]", in(reg) &mut control, options(nostack, preserves_flags));
        control |= DAZ_AND_FTZ;
        core::arch::asm!("ldmxcsr [{}]", in(reg) &control, options(nostack, preserves_flags));
    }
}

/// Makes the calling thread treat denormal inputs and results as zero.
#[cfg(target_arch = "aarch64")]
pub fn flush() {
    /// Bit FZ of FPCR.
    const FZ: u64 = 1 << 24;
    // SAFETY: reads and writes the control register of this thread. The module's head says why the changed
    // arithmetic is harmless.
    unsafe {
        let control: u64;
        core::arch::asm!("mrs {}, fpcr", out(reg) control, options(nomem, nostack, preserves_flags));
        core::arch::asm!("msr fpcr, {}", in(reg) control | FZ, options(nomem, nostack, preserves_flags));
    }
}

/// Other processors keep denormals.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub fn flush() {}

#[cfg(all(test, any(target_arch = "x86_64", target_arch = "aarch64")))]
mod tests {
    use super::flush;
    use core::hint::black_box;

    /// A denormal made of normal numbers, and a normal number made of a denormal one.
    fn made() -> (f64, f64) {
        let small = black_box(1e-308) * black_box(0.1);
        (black_box(small), black_box(f64::from_bits(1 << 50)) * black_box(1e10))
    }

    #[test]
    fn denormals_are_zero_in_this_thread_alone() {
        let flushing = std::thread::spawn(|| {
            let before = made();
            flush();
            (before, made())
        });
        let (before, after) = flushing.join().unwrap();
        assert!(before.0 > 0.0 && before.1 > 0.0, "{before:?}");
        assert_eq!(after, (0.0, 0.0));
        assert_eq!(made(), before, "the thread that started it is as it was");
    }
}
