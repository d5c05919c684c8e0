//! Network interface of this computer: a raw Ethernet socket (AF_PACKET).
#![allow(unsafe_code, reason = "calls of the system; each block carries its argument")]

use std::ffi::CString;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::{io, mem};

use hexad_client::messages::clock::monotonic_ns;
use hexad_client::realtime::clock;

use crate::link::Link;

const ETHERCAT: u16 = 0x88a4;

/// Raw socket of one interface.
#[derive(Debug)]
pub struct RawSocket {
    socket: OwnedFd,
    /// Keeps other processes of this kind away; the kernel removes it with the process.
    _reservation: UnixListener,
}

impl RawSocket {
    /// Opens an interface for EtherCAT alone; the error in words.
    pub fn open(name: &str) -> Result<Self, String> {
        let system = |error: io::Error| match error.kind() {
            io::ErrorKind::AddrInUse => format!("another hexad-ethercat uses {name}: end it first"),
            io::ErrorKind::PermissionDenied => {
                format!(
                    "no right to raw frames on {name}: run as root, or with CAP_NET_RAW (the unit has it)"
                )
            }
            _ => format!("interface {name}: {error}"),
        };
        let index = interface_index(name).ok_or_else(|| {
            format!("interface {name} does not exist: `ip link` lists the interfaces; correct `interface`")
        })?;
        let address = SocketAddr::from_abstract_name(format!("hexad-ethercat/{name}")).map_err(system)?;
        let reservation = UnixListener::bind_addr(&address).map_err(system)?;
        let socket = bound_socket(index).map_err(system)?;
        if !has_carrier(&socket, name).map_err(system)? {
            return Err(format!(
                "interface {name} has no carrier: look at cable and power of the drives, and at `ip link set {name} up`"
            ));
        }
        Ok(Self { socket, _reservation: reservation })
    }
}

fn checked(result: i32) -> io::Result<i32> {
    if result < 0 { Err(io::Error::last_os_error()) } else { Ok(result) }
}

/// Number of an interface.
fn interface_index(name: &str) -> Option<i32> {
    let name = CString::new(name).ok()?;
    // SAFETY: the name is a string that ends with 0 and lives during the call.
    let index = unsafe { libc::if_nametoindex(name.as_ptr()) };
    i32::try_from(index).ok().filter(|index| *index > 0)
}

/// Whether an interface is up and something is connected.
fn has_carrier(socket: &OwnedFd, name: &str) -> io::Result<bool> {
    // SAFETY: all zeros are a valid value of this struct of numbers.
    let mut request: libc::ifreq = unsafe { mem::zeroed() };
    for (to, from) in request.ifr_name.iter_mut().zip(name.bytes().take(libc::IFNAMSIZ - 1)) {
        *to = from as libc::c_char;
    }
    // SAFETY: the request is valid and writable during the call, and its name ends with 0.
    checked(unsafe { libc::ioctl(socket.as_raw_fd(), libc::SIOCGIFFLAGS, &raw mut request) })?;
    // SAFETY: this call fills in the flags of the union.
    let flags = unsafe { request.ifr_ifru.ifru_flags };
    Ok(i32::from(flags) & libc::IFF_RUNNING != 0)
}

fn bound_socket(index: i32) -> io::Result<OwnedFd> {
    let kind = libc::SOCK_RAW | libc::SOCK_NONBLOCK | libc::SOCK_CLOEXEC;
    let protocol = ETHERCAT.to_be();
    // SAFETY: the call takes numbers only.
    let number = checked(unsafe { libc::socket(libc::AF_PACKET, kind, protocol.into()) })?;
    // SAFETY: the descriptor is new and belongs to nobody else.
    let socket = unsafe { OwnedFd::from_raw_fd(number) };
    // SAFETY: all zeros are a valid value of this struct of numbers.
    let mut address: libc::sockaddr_ll = unsafe { mem::zeroed() };
    address.sll_family = libc::AF_PACKET as u16;
    address.sll_protocol = protocol;
    address.sll_ifindex = index;
    let length = size_of::<libc::sockaddr_ll>() as u32;
    // SAFETY: `address` is valid during the call and `length` is its size.
    checked(unsafe { libc::bind(number, (&raw const address).cast(), length) })?;
    // The socket does not receive what it sends.
    let one = 1i32;
    // SAFETY: `one` is valid during the call and 4 is its size.
    checked(unsafe {
        libc::setsockopt(number, libc::SOL_PACKET, libc::PACKET_IGNORE_OUTGOING, (&raw const one).cast(), 4)
    })?;
    Ok(socket)
}

impl Link for RawSocket {
    fn now_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn send(&mut self, frame: &[u8]) {
        // SAFETY: the buffer is valid for its length during the call.
        unsafe { libc::send(self.socket.as_raw_fd(), frame.as_ptr().cast(), frame.len(), 0) };
    }

    fn receive(&mut self, buffer: &mut [u8]) -> Option<usize> {
        // SAFETY: the buffer is valid and writable for its length during the call.
        let length =
            unsafe { libc::recv(self.socket.as_raw_fd(), buffer.as_mut_ptr().cast(), buffer.len(), 0) };
        usize::try_from(length).ok().filter(|length| *length > 0)
    }

    fn wait_for_frame(&mut self, until_ns: u64) {
        let wait_ns = until_ns.saturating_sub(monotonic_ns()).min(1_000_000_000);
        let time = libc::timespec {
            tv_sec: (wait_ns / 1_000_000_000) as i64,
            tv_nsec: (wait_ns % 1_000_000_000) as i64,
        };
        let mut poll = libc::pollfd { fd: self.socket.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        // SAFETY: both structs are valid during the call; a null mask leaves the signals as they are.
        unsafe { libc::ppoll(&mut poll, 1, &time, std::ptr::null()) };
    }

    fn sleep_until(&mut self, until_ns: u64) {
        clock::sleep_until(until_ns);
    }
}
