//! An open file that goes with a line over a Unix socket: the receiver writes what the sender may write.

use std::fs::File;
use std::io::{self, IoSlice};
use std::os::fd::{AsRawFd, FromRawFd as _, OwnedFd, RawFd};
use std::os::unix::net::UnixStream;

use nix::sys::socket::{ControlMessage, MsgFlags, sendmsg};

/// Most files that are received with one read; the kernel closes further ones.
const MAX_FILES: usize = 4;
/// Room for their message.
// SAFETY: arithmetic of a plain number.
const CONTROL_BYTES: usize = unsafe { libc::CMSG_SPACE((MAX_FILES * size_of::<RawFd>()) as u32) } as usize;

/// Sends bytes with a file; returns how many bytes.
pub fn send(stream: &UnixStream, bytes: &[u8], file: &File) -> io::Result<usize> {
    let (descriptors, content) = ([file.as_raw_fd()], [IoSlice::new(bytes)]);
    let rights = [ControlMessage::ScmRights(&descriptors)];
    Ok(sendmsg::<()>(stream.as_raw_fd(), &content, &rights, MsgFlags::MSG_NOSIGNAL, None)?)
}

/// Reads bytes, and the last of the files that came with them; all others are closed, also where there were more than there is room
/// for or than this process may open. 0 bytes: the other end is closed.
pub fn receive(stream: &UnixStream, bytes: &mut [u8]) -> io::Result<(usize, Option<File>)> {
    let mut content = libc::iovec { iov_base: bytes.as_mut_ptr().cast(), iov_len: bytes.len() };
    let mut control = [0_u64; CONTROL_BYTES.div_ceil(size_of::<u64>())];
    // SAFETY: zeros are a header without address, content and control data.
    let mut header: libc::msghdr = unsafe { core::mem::zeroed() };
    (header.msg_iov, header.msg_iovlen) = (&raw mut content, 1);
    (header.msg_control, header.msg_controllen) = (control.as_mut_ptr().cast(), size_of_val(&control) as _);
    // SAFETY: the header names the two buffers above with their sizes.
    let count = unsafe { libc::recvmsg(stream.as_raw_fd(), &raw mut header, libc::MSG_CMSG_CLOEXEC) };
    let count = usize::try_from(count).map_err(|_| io::Error::last_os_error())?;
    let mut file = None;
    // Not `cmsgs` of nix: it refuses what is truncated, and the files that have arrived would stay open.
    // SAFETY: the kernel has filled the control data, which is aligned, up to `msg_controllen`. A message of SCM_RIGHTS has the
    // descriptors that the kernel has just opened for this process, and nothing else has their numbers.
    unsafe {
        let mut message = libc::CMSG_FIRSTHDR(&raw const header);
        while let Some(found) = message.as_ref() {
            if (found.cmsg_level, found.cmsg_type) == (libc::SOL_SOCKET, libc::SCM_RIGHTS) {
                let length = found.cmsg_len.saturating_sub(libc::CMSG_LEN(0) as usize);
                let first = libc::CMSG_DATA(message).cast::<RawFd>();
                for place in 0..length / size_of::<RawFd>() {
                    file = Some(File::from(OwnedFd::from_raw_fd(first.add(place).read_unaligned())));
                }
            }
            message = libc::CMSG_NXTHDR(&raw const header, message);
        }
    }
    Ok((count, file))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read as _, Seek as _, Write as _};

    #[test]
    fn a_file_goes_with_its_line_and_others_are_closed() {
        let (sender, receiver) = UnixStream::pair().unwrap();
        let mut file = tempfile::tempfile().unwrap();
        assert_eq!(send(&sender, b"a line\n", &file).unwrap(), 7);
        let mut bytes = [0; 100];
        let (count, passed) = receive(&receiver, &mut bytes).unwrap();
        assert_eq!(&bytes[..count], b"a line\n");
        passed.unwrap().write_all(b"written").unwrap();
        let mut text = String::new();
        file.rewind().unwrap();
        file.read_to_string(&mut text).unwrap();
        assert_eq!(text, "written");
        let open = || std::fs::read_dir("/proc/self/fd").unwrap().count();
        let before = open();
        for _ in 0..50 {
            send(&sender, b"x", &file).unwrap();
            assert!(receive(&receiver, &mut bytes).unwrap().1.is_some());
        }
        assert!(open() < before + 40, "the files stay open");
        drop(sender);
        assert_eq!(receive(&receiver, &mut bytes).unwrap().0, 0);
    }

    #[test]
    fn more_files_than_are_received_are_all_closed() {
        let file = tempfile::tempfile().unwrap();
        let open = || std::fs::read_dir("/proc/self/fd").unwrap().count();
        let before = open();
        for count in [1, MAX_FILES, MAX_FILES + 1, 3 * MAX_FILES, 200] {
            for _ in 0..50 {
                let (sender, receiver) = UnixStream::pair().unwrap();
                let descriptors = vec![file.as_raw_fd(); count];
                let rights = [ControlMessage::ScmRights(&descriptors)];
                let content = [IoSlice::new(b"a line\n")];
                sendmsg::<()>(sender.as_raw_fd(), &content, &rights, MsgFlags::empty(), None).unwrap();
                let mut bytes = [0; 100];
                let (length, passed) = receive(&receiver, &mut bytes).unwrap();
                assert!(length == 7 && passed.is_some(), "{count} files");
            }
        }
        assert!(open() < before + 40, "files stay open: {before} before, {} after", open());
    }
}
