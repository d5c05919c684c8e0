//! Room for shared memory, reserved when a segment is made.
//!
//! iceoryx2 gives a segment its size with `ftruncate`, which reserves nothing: where `/dev/shm` is full, the process would end
//! by SIGBUS at whatever page it touches first, at the start or in motion. It has no setting for this. So the function is replaced
//! for the segments of this crate, and for nothing else: the size comes with its memory, or the call fails.
#![allow(unsafe_code, reason = "the system calls have no safe interface; each block carries its argument")]

use core::ffi::c_int;
use core::sync::atomic::{AtomicU64, Ordering};
use std::fs::{read_link, remove_file};
use std::path::PathBuf;

/// Beginning of the path of every segment, see [`super::location`].
const SEGMENT: &str = "/dev/shm/hexad_";

/// Bytes for which there was no room since [`refusal`] was called.
static REFUSED_BYTES: AtomicU64 = AtomicU64::new(0);

/// Why the last segment could not be made, if for lack of room.
pub(super) fn take_refusal() -> Option<String> {
    let bytes = REFUSED_BYTES.swap(0, Ordering::Relaxed);
    (bytes > 0).then(|| format!("no room in /dev/shm for {bytes} bytes; ls -l /dev/shm shows who has it"))
}

/// Replaces `ftruncate` of the C library in programs with this crate.
#[unsafe(no_mangle)]
extern "C" fn ftruncate(file: c_int, length: libc::off64_t) -> c_int {
    // SAFETY: plain numbers; a wrong descriptor makes the call fail.
    let result = unsafe { libc::ftruncate64(file, length) };
    let Some(path) = segment(file).filter(|_| result == 0 && length > 0) else { return result };
    let error = loop {
        // SAFETY: plain numbers. It returns the error and leaves errno alone.
        let error = unsafe { libc::posix_fallocate64(file, 0, length) };
        if error != libc::EINTR {
            break error;
        }
    };
    if error == 0 {
        return 0;
    }
    REFUSED_BYTES.store(length.unsigned_abs(), Ordering::Relaxed);
    // iceoryx2 would leave it behind, and then take it for one that is being made.
    let _ = remove_file(path);
    // SAFETY: the address of errno of this thread is valid.
    unsafe { *libc::__errno_location() = error };
    -1
}

/// Path of a descriptor that is a segment of this crate.
fn segment(file: c_int) -> Option<PathBuf> {
    let path = read_link(format!("/proc/self/fd/{file}")).ok()?;
    path.as_os_str().as_encoded_bytes().starts_with(SEGMENT.as_bytes()).then_some(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::MetadataExt;

    /// Bytes of a file that have memory, by its name.
    fn reserved(name: &str, length: libc::off64_t) -> (c_int, u64) {
        let path = format!("{name}-{}", std::process::id());
        let file = File::create(&path).unwrap();
        let result = ftruncate(file.as_raw_fd(), length);
        let bytes = file.metadata().unwrap().blocks() * 512;
        let _ = remove_file(path);
        (result, bytes)
    }

    #[test]
    fn a_segment_has_its_memory_and_another_file_has_none() {
        assert_eq!(reserved("/dev/shm/hexad_test", 1 << 20), (0, 1 << 20));
        assert_eq!(reserved("/dev/shm/other", 1 << 20), (0, 0));
    }

    #[test]
    fn without_room_the_call_fails_and_says_so() {
        assert_eq!(reserved("/dev/shm/hexad_full", 1 << 60), (-1, 0));
        let refusal = take_refusal().unwrap();
        assert!(refusal.starts_with("no room in /dev/shm for 1152921504606846976 bytes"), "{refusal}");
    }
}
