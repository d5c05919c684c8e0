//! An open file that goes with a line over a Unix socket: the receiver writes what the sender may write.

use std::fs::File;
use std::io::{self, IoSlice, IoSliceMut};
use std::os::fd::{AsRawFd, FromRawFd as _, OwnedFd, RawFd};
use std::os::unix::net::UnixStream;

use nix::sys::socket::{ControlMessage, ControlMessageOwned, MsgFlags, recvmsg, sendmsg};

/// Most files that are received with one read; the kernel closes further ones.
const MAX_FILES: usize = 4;

/// Sends bytes with a file; returns how many bytes.
pub fn send(stream: &UnixStream, bytes: &[u8], file: &File) -> io::Result<usize> {
    let (descriptors, content) = ([file.as_raw_fd()], [IoSlice::new(bytes)]);
    let rights = [ControlMessage::ScmRights(&descriptors)];
    Ok(sendmsg::<()>(stream.as_raw_fd(), &content, &rights, MsgFlags::MSG_NOSIGNAL, None)?)
}

/// Reads bytes, and the last of the files that came with them. 0 bytes: the other end is closed.
pub fn receive(stream: &UnixStream, bytes: &mut [u8]) -> io::Result<(usize, Option<File>)> {
    let mut space = nix::cmsg_space!([RawFd; MAX_FILES]);
    let mut content = [IoSliceMut::new(bytes)];
    let flags = MsgFlags::MSG_CMSG_CLOEXEC;
    let received = recvmsg::<()>(stream.as_raw_fd(), &mut content, Some(&mut space), flags)?;
    let mut file = None;
    for message in received.cmsgs()? {
        let ControlMessageOwned::ScmRights(descriptors) = message else { continue };
        for descriptor in descriptors {
            // SAFETY: the kernel has just opened the descriptor for this process, and nothing else has its number.
            let owned = unsafe { OwnedFd::from_raw_fd(descriptor) };
            file = Some(File::from(owned));
        }
    }
    Ok((received.bytes, file))
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
}
