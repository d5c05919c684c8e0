//! HTTP server for a page and its data. It listens on the loopback only, replies only to requests with its
//! token, and has no requests that change anything.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::thread::sleep;
use std::time::{Duration, Instant};

use hexad_client::realtime::stop_request::Stop;

/// Threads that accept connections. A page has one or two open at a time.
pub const THREADS: usize = 4;

/// Longest head of a request \[bytes\].
const MAX_HEAD: usize = 8192;

/// Longest time for a request, and for a reply.
const TIMEOUT: Duration = Duration::from_secs(2);

/// Largest number of incomplete requests of a thread. One more replaces the oldest.
const MAX_UNREAD: usize = 64;

/// Interval at which a thread checks for connections and input.
const INTERVAL: Duration = Duration::from_millis(10);

/// Length of the token \[bytes\]: 128 bits cannot be guessed.
const TOKEN_BYTES: usize = 16;

/// Content of a reply, with its media type.
pub struct Reply {
    pub kind: &'static str,
    pub content: String,
}

/// The server.
pub struct Server {
    listener: TcpListener,
    port: u16,
    token: String,
}

impl Server {
    /// Listens on the loopback. Port 0 is any free port.
    pub fn start(port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        let port = listener.local_addr()?.port();
        let mut bytes = [0; TOKEN_BYTES];
        File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        let token = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { listener, port, token })
    }

    /// Address for a browser, with the token.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/?token={}", self.port, self.token)
    }

    /// Replies to requests until the stop. `reply` is called with path and query of requests with the token.
    /// A slow sender delays no other.
    pub fn serve(&self, stop: &Stop, reply: impl Fn(&str, &[(&str, &str)]) -> Option<Reply>) {
        let mut unread = VecDeque::new();
        while !stop.is_requested() {
            for _ in 0..MAX_UNREAD {
                let Ok((stream, _)) = self.listener.accept() else { break };
                unread.extend(Request::new(stream));
                if unread.len() > MAX_UNREAD {
                    unread.pop_front();
                }
            }
            unread.retain_mut(|request: &mut Request| match request.read() {
                Ok(true) => {
                    // A browser that has left needs no reply.
                    let _ = self.answer(request, &reply);
                    false
                }
                Ok(false) => request.began.elapsed() < TIMEOUT,
                Err(_) => false,
            });
            sleep(INTERVAL);
        }
    }

    fn answer(
        &self,
        request: &mut Request,
        reply: &impl Fn(&str, &[(&str, &str)]) -> Option<Reply>,
    ) -> io::Result<()> {
        let stream = &mut request.stream;
        stream.set_nonblocking(false)?;
        stream.set_write_timeout(Some(TIMEOUT))?;
        let (status, reply) = self.response(&String::from_utf8_lossy(&request.head), reply);
        let Reply { kind, content } = reply;
        let length = content.len();
        write!(
            stream,
            "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\
             Cache-Control: no-store\r\nReferrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\n\
             Content-Security-Policy: frame-ancestors 'none'\r\nCross-Origin-Resource-Policy: same-origin\r\n\r\n"
        )?;
        stream.write_all(content.as_bytes())
    }

    /// Status line and reply to a request.
    fn response(
        &self,
        head: &str,
        reply: impl Fn(&str, &[(&str, &str)]) -> Option<Reply>,
    ) -> (&'static str, Reply) {
        let refused =
            |status: &'static str| (status, Reply { kind: "text/plain", content: format!("{status}\n") });
        let mut words = head.lines().next().unwrap_or_default().split(' ');
        let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let query: Vec<_> = query.split('&').filter_map(|pair| pair.split_once('=')).collect();
        let has_token = query.iter().any(|(key, value)| *key == "token" && is_same(value, &self.token));
        if !has_token || !self.is_own_name(head) {
            return refused("403 Forbidden");
        }
        if method != "GET" {
            return refused("405 Method Not Allowed");
        }
        reply(path, &query).map_or_else(|| refused("404 Not Found"), |reply| ("200 OK", reply))
    }

    /// Whether the browser uses this server's own name. Other names that resolve to the loopback are refused.
    fn is_own_name(&self, head: &str) -> bool {
        let host = head.lines().skip(1).find_map(|line| {
            let (name, value) = line.split_once(':')?;
            name.eq_ignore_ascii_case("host").then(|| value.trim())
        });
        let names = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{}", self.port));
        host.is_some_and(|host| names.iter().any(|name| name == host))
    }
}

/// A connection whose request is incomplete.
struct Request {
    stream: TcpStream,
    head: Vec<u8>,
    began: Instant,
}

impl Request {
    /// Request of a newly accepted connection; `None` if its settings cannot be changed.
    fn new(stream: TcpStream) -> Option<Self> {
        stream.set_nonblocking(true).ok()?;
        Some(Self { stream, head: vec![], began: Instant::now() })
    }

    /// Reads the available bytes. Returns whether the head with its empty line is complete.
    fn read(&mut self) -> io::Result<bool> {
        let mut buffer = [0; MAX_HEAD];
        match self.stream.read(&mut buffer) {
            Ok(count) if count > 0 && self.head.len() + count <= MAX_HEAD => {
                self.head.extend(buffer.iter().take(count));
            }
            Ok(_) => return Err(io::ErrorKind::InvalidData.into()),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
        Ok(self.head.windows(4).any(|end| end == b"\r\n\r\n"))
    }
}

/// Compares two texts in a time that does not depend on their first difference.
fn is_same(left: &str, right: &str) -> bool {
    let differences = left.bytes().zip(right.bytes()).fold(0, |sum, (left, right)| sum | (left ^ right));
    left.len() == right.len() && differences == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(server: &Server, head: &str) -> &'static str {
        let known = |path: &str, _: &[(&str, &str)]| {
            (path == "/data").then(|| Reply { kind: "text/plain", content: String::new() })
        };
        server.response(head, known).0
    }

    #[test]
    fn only_requests_with_token_and_own_name_are_answered() {
        let server = Server::start(0).unwrap();
        let (token, port) = (&server.token, server.port);
        assert_eq!((token.len(), server.address()), (32, format!("http://127.0.0.1:{port}/?token={token}")));
        let host = format!("HOST: localhost:{port}");
        let request =
            |line: &str| status(&server, &format!("{line} HTTP/1.1\r\nAccept: */*\r\n{host}\r\n\r\n"));
        assert_eq!(request(&format!("GET /data?after=3&token={token}")), "200 OK");
        assert_eq!(request(&format!("GET /other?token={token}")), "404 Not Found");
        assert_eq!(request(&format!("POST /data?token={token}")), "405 Method Not Allowed");
        let wrong = token.replace(['1', '2', '3', '4', '5', '6', '7', '8'], "0");
        for line in ["GET /", "GET /data", "GET /data?token=", "GET", ""] {
            assert_eq!(request(line), "403 Forbidden", "{line}");
        }
        for token in [&token[1..], &format!("{token}0"), &wrong] {
            assert_eq!(request(&format!("GET /data?token={token}")), "403 Forbidden");
        }
        let line = format!("GET /data?token={token} HTTP/1.1\r\n");
        assert_eq!(status(&server, &format!("{line}\r\n")), "403 Forbidden");
        assert_eq!(status(&server, &format!("{line}Host: evil.example:{port}\r\n\r\n")), "403 Forbidden");
        assert_ne!(Server::start(0).unwrap().token, *token);
    }

    #[test]
    fn who_sends_slowly_holds_up_nobody() {
        let server = Server::start(0).unwrap();
        let (port, stop) = (server.port, Stop::default());
        let connect = || {
            let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, port)).unwrap();
            stream.write_all(b"G").unwrap();
            stream
        };
        std::thread::scope(|threads| {
            let serving = threads.spawn(|| server.serve(&stop, |_, _| None));
            // They stay connected during the request for the page, and after it.
            let _slow: Vec<_> = (0..3 * MAX_UNREAD).map(|_| connect()).collect();
            let mut stream = connect();
            stream.write_all(b"ET / HTTP/1.1\r\n\r\n").unwrap();
            let mut text = String::new();
            let _ = stream.read_to_string(&mut text);
            stop.request();
            serving.join().unwrap();
            assert!(text.starts_with("HTTP/1.1 403 Forbidden"), "{text}");
        });
    }
}
