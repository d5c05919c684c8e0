//! The control thread against a loop and a motion thread of a few lines, in random orders of requests, waits, stops, delays, lost
//! clients and new starts: after a stop nothing takes control that was asked for before it, and each request has one answer.

use core::cell::Cell;
use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::mpsc::{channel, sync_channel};

use super::*;
use crate::motion_requests::job::{End, MotionEvent};
use hexad_client::operator::protocol::RequestResult;
use hexad_client::operator::ride::{RideOrder, RidePhase};
use hexad_client::operator::status_report::StopNumber;
use hexad_client::realtime::request_word::number;
use hexad_client::realtime::triple_buffer::triple_buffer;
use hexad_core::control::signals::diagnostic::DiagnosticCode;
use hexad_core::control::signals::state::{Request, State};
use hexad_core::model::random::Random;
use hexad_machine::config::Config;

thread_local!(static NOW_NS: Cell<u64> = const { Cell::new(1_000_000_000) });
static NOBODY_ENDS: AtomicBool = AtomicBool::new(false);

const KINDS: [&str; 18] = [
    "engage",
    "engage",
    "engage",
    "engage",
    "engage",
    "goto",
    "goto",
    "hold",
    "park",
    "clear",
    "clear",
    "stop",
    "off",
    "estop",
    "reload",
    "ride_start",
    "ride_start",
    "ride_end",
];

/// Requests that wait for another thread or process, whether their line says so or not.
const WAITING: [&str; 3] = ["reload", "ride_start", "ride_end"];

/// Process of the source of a ride.
const RIDER: u32 = 7;

/// What a client waits for.
struct Open {
    kind: &'static str,
    /// Step at which its number of stops was read; of one without a number, by which it was received.
    asked: Option<u64>,
    sent: u64,
    /// Whether its answer comes at its end.
    waits: bool,
}

struct Client {
    stream: UnixStream,
    answers: BufReader<UnixStream>,
    open: BTreeMap<u64, Open>,
    /// A line that its person has asked for, and when it is sent.
    later: Vec<(u64, RequestLine, u64)>,
}

struct World {
    server: Server<'static>,
    snapshots: Writer<Snapshot>,
    snapshot: Snapshot,
    state: State,
    jobs: Receiver<Job>,
    job: Option<Job>,
    wants_control: bool,
    reloads: Receiver<Requester>,
    reloaded: Sender<Reloaded>,
    clients: Vec<Client>,
    /// Requests of clients that have left, and those that go on after their answer.
    lost: Vec<Open>,
    has_driver: bool,
    has_source: bool,
    step: u64,
    /// Step at which the last stop that was confirmed was sent.
    stopped: u64,
    ids: u64,
    /// How often each result came, and how often control began.
    answers: BTreeMap<String, u64>,
    begun: u64,
    phase: RidePhase,
    rides: u64,
    random: Random,
}

impl World {
    fn new(seed: u64) -> Self {
        let config = Config::parse(include_str!("../../../config/fried2008.toml"), "a test").unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.sock");
        let socket = ControlSocket { listener: UnixListener::bind(&path).unwrap(), reading: None, path };
        let (snapshots, reader) = triple_buffer(Snapshot::default());
        let ((request_reload, reloads), (reloaded, results)) = (channel(), channel());
        let ((jobs_in, jobs), (windows, _)) = (channel(), sync_channel(1));
        let links = ControlLinks {
            socket,
            snapshots: reader,
            word: Box::leak(Box::default()),
            gate: Arc::default(),
            request_reload,
            reloaded: results,
            windows,
            interruption: Arc::default(),
            legs: None,
            jobs: jobs_in,
            motion_snapshots: triple_buffer(Snapshot::default()).0,
            is_ending: &NOBODY_ENDS,
        };
        let mut server = Server::new(Arc::new(Loaded::new(config)), links);
        server.clock = || NOW_NS.get();
        let mut world = Self {
            server,
            snapshots,
            snapshot: Snapshot::default(),
            state: State::Off,
            jobs,
            job: None,
            wants_control: false,
            reloads,
            reloaded,
            clients: vec![],
            lost: vec![],
            has_driver: false,
            has_source: false,
            step: 0,
            stopped: 0,
            ids: 0,
            answers: BTreeMap::new(),
            begun: 0,
            phase: RidePhase::Boarding,
            rides: 0,
            random: Random::new(seed),
        };
        (0..3).for_each(|_| world.connect());
        world
    }

    fn connect(&mut self) {
        let (mut stream, other) = UnixStream::pair().unwrap();
        // A first line, or it would be closed.
        stream.write_all(b"{}\n").unwrap();
        self.server.accepted += 1;
        let connection = Connection::new(other, true, self.server.accepted, 0).unwrap();
        self.server.connections.push(connection);
        stream.set_nonblocking(true).unwrap();
        let answers = BufReader::new(stream.try_clone().unwrap());
        self.clients.push(Client { stream, answers, open: BTreeMap::new(), later: vec![] });
    }

    fn below(&mut self, end: usize) -> usize {
        (self.random.uniform() * end as f64) as usize
    }

    /// One random event.
    fn act(&mut self) {
        self.step += 1;
        match self.below(16) {
            0..4 => self.ask(),
            4 => self.has_driver = !self.has_driver,
            5 => self.has_source = !self.has_source,
            6 => self.advance_motion(),
            7 if self.below(4) == 0 => {
                let request = if self.below(2) == 0 { Request::Stop } else { Request::Estop };
                let _ = self.server.links.word.post(request as u32, NOW_NS.get());
            }
            8 if self.below(8) == 0 => self.lose_client(),
            9 if self.below(16) == 0 => self.begin_anew(),
            10 => NOW_NS.set(NOW_NS.get() + 120_000_000),
            11..13 => self.cycle(),
            _ => self.round(),
        }
        self.send_due();
    }

    fn number(&self) -> StopNumber {
        self.server.stops()
    }

    fn ask(&mut self) {
        let (kind, client) = (KINDS[self.below(KINDS.len())], self.below(self.clients.len()));
        let has_number = self.below(4) > 0;
        let is_late = self.below(3) == 0;
        self.ids += 1;
        let line = RequestLine {
            id: Some(self.ids),
            stops: has_number.then(|| self.number()),
            wait: self.below(2) == 0,
            until_ready: self.below(2) == 0,
            progress: self.below(2) == 0,
            within_s: 1.0,
            engage: ["goto", "hold"].contains(&kind) && self.below(2) == 0,
            home: kind == "goto",
            ..RequestLine::new(kind)
        };
        // A ride is long after its engage.
        let latest = if kind == "ride_start" { 200 } else { 20 };
        let due = self.step + if is_late { self.below(latest) as u64 } else { 0 };
        let asked = self.step;
        self.clients[client].later.push((due, line, asked));
    }

    fn send_due(&mut self) {
        for client in &mut self.clients {
            for (_, line, asked) in client.later.extract_if(.., |(due, ..)| *due <= self.step) {
                let text = line.to_line().unwrap();
                client.stream.write_all(text.as_bytes()).unwrap();
                let kind = KINDS.into_iter().find(|kind| *kind == line.request).unwrap();
                let (asked, waits) = (line.stops.map(|_| asked), line.wait);
                let open = Open { kind, asked, sent: self.step, waits };
                client.open.insert(line.id.unwrap(), open);
            }
        }
    }

    fn lose_client(&mut self) {
        let client = self.below(self.clients.len());
        let lost = self.clients.remove(client);
        self.lost.extend(lost.open.into_values());
        self.connect();
    }

    /// The daemon is killed and started again. Its clients connect again; what they have not sent yet is of the last life.
    fn begin_anew(&mut self) {
        self.server.connections.clear();
        (self.server.motions.running, self.server.motions.next, self.job) = (None, None, None);
        self.server.links.word = Box::leak(Box::default());
        self.server.began_us += 1;
        (self.state, self.wants_control) = (State::Off, false);
        self.snapshot = Snapshot::default();
        self.snapshots.write(self.snapshot);
        let clients = core::mem::take(&mut self.clients);
        for old in clients {
            self.connect();
            self.clients.last_mut().unwrap().later = old.later;
        }
        while self.reloads.try_recv().is_ok() {}
    }

    /// The loop: as the controller answers, as far as the order of requests matters.
    fn cycle(&mut self) {
        let word = self.server.links.word.load();
        let request = Request::from_number(number(word)).filter(|_| word != self.snapshot.answered);
        if let Some(request) = request {
            let refusal = self.obey(request);
            (self.snapshot.answered, self.snapshot.refusal) = (word, refusal.into());
            self.server.links.word.set_seen(word);
        } else {
            self.state = match self.state {
                State::Engaging => State::Active,
                State::Stopping => State::Standby,
                State::Parking => State::Off,
                State::Off if self.has_driver => State::Standby,
                state => state,
            };
        }
        self.snapshot.time_ns = NOW_NS.get();
        self.snapshot.status.state = self.state as u32;
        self.snapshots.write(self.snapshot);
    }

    fn obey(&mut self, request: Request) -> DiagnosticCode {
        let is_off = matches!(self.state, State::Off | State::Standby);
        let (refusal, state) = match request {
            Request::Engage | Request::Park if self.state == State::Fault => {
                (DiagnosticCode::InvalidInState, self.state)
            }
            Request::Engage | Request::Park if !self.has_driver => {
                (DiagnosticCode::NoMeasurement, self.state)
            }
            Request::Engage if !self.has_source && !self.wants_control => {
                (DiagnosticCode::NoSetpoint, self.state)
            }
            Request::Engage if is_off => (DiagnosticCode::None, State::Engaging),
            Request::Park => (DiagnosticCode::None, State::Parking),
            Request::Stop if self.state.has_control() => (DiagnosticCode::None, State::Stopping),
            Request::Off if self.state != State::Fault => (DiagnosticCode::None, State::Off),
            Request::Estop => (DiagnosticCode::None, State::Fault),
            Request::Clear if self.state == State::Fault => (DiagnosticCode::None, State::Off),
            Request::Clear if !is_off => (DiagnosticCode::InvalidInState, self.state),
            _ => (DiagnosticCode::None, self.state),
        };
        if !self.state.has_control() && state.has_control() {
            self.begun += 1;
            let moves = ["engage", "park", "goto", "hold"];
            let asked = self.clients.iter().flat_map(|client| client.open.values()).chain(&self.lost);
            let mut asked = asked.filter(|open| moves.contains(&open.kind));
            let (step, stopped) = (self.step, self.stopped);
            assert!(
                asked.any(|open| open.asked.is_none_or(|asked| asked >= stopped)),
                "step {step}: {} is obeyed after the stop of step {stopped}",
                request.name()
            );
        }
        self.state = state;
        refusal
    }

    /// The motion thread.
    fn advance_motion(&mut self) {
        if self.job.is_none() {
            self.job = self.jobs.try_recv().ok();
            self.wants_control = false;
        }
        let Some(job) = &self.job else { return };
        let has_ended = match (job.end(), self.random.uniform() < 0.2) {
            (Some(End::AtOnce | End::TakeOver | End::Rest), _) => true,
            (None, true) => {
                job.send(MotionEvent::Failed(RequestResult::Failed, "a test".into()));
                true
            }
            (None, false) if !self.wants_control => {
                job.send(MotionEvent::Accepted("a test".into()));
                if job.order.may_engage {
                    job.send(MotionEvent::WantsControl);
                }
                self.wants_control = true;
                false
            }
            (None, false) if self.state == State::Active => {
                job.send(MotionEvent::Done("a test".into()));
                true
            }
            _ => false,
        };
        if has_ended {
            (self.job, self.wants_control) = (None, false);
        }
    }

    /// The source of a ride. Who has left begins none.
    fn ride(&mut self) {
        let order = self.server.status.inputs.get(&RIDER).and_then(|source| source.order);
        self.phase = match (self.phase, order) {
            _ if self.state != State::Active => RidePhase::Boarding,
            (RidePhase::Ready, Some(RideOrder::Start)) => {
                let open = self.clients.iter().flat_map(|client| client.open.values());
                let mut asked = open.filter(|open| open.kind == "ride_start");
                let stopped = self.stopped;
                assert!(
                    asked.any(|open| open.asked.is_none_or(|asked| asked >= stopped)),
                    "step {}",
                    self.step
                );
                self.rides += 1;
                RidePhase::Riding
            }
            (RidePhase::Riding, Some(RideOrder::End)) => RidePhase::Boarding,
            (RidePhase::Boarding, _) => RidePhase::Ready,
            (phase, _) => phase,
        };
        let line = RequestLine { ride: Some(self.phase), ..RequestLine::new("status") };
        self.server.status.describe_source(RIDER, &line, NOW_NS.get());
    }

    /// A round of the control thread, and what its clients receive.
    fn round(&mut self) {
        self.server.poll(PollTimeout::ZERO);
        while let Ok(requester) = self.reloads.try_recv() {
            let outcome = Ok("a test".into());
            self.reloaded.send(Reloaded { requester, loaded: None, outcome }).unwrap();
        }
        self.server.read();
        let is_read = |connection: &Connection| connection.line.is_none() && !connection.has_line();
        if self.server.connections.iter().all(is_read) {
            let open = self.clients.iter_mut().flat_map(|client| client.open.values_mut());
            open.for_each(|open| _ = open.asked.get_or_insert(self.step));
        }
        self.server.advance();
        self.server.advance_motion();
        self.server.advance_rides();
        self.ride();
        self.server.answer_reloads();
        for client in &mut self.clients {
            let mut line = String::new();
            while client.answers.read_line(&mut line).is_ok_and(|count| count > 0) {
                let answer: AnswerLine = serde_json::from_str(&line).unwrap();
                line.clear();
                let Some(id) = answer.id else {
                    assert!(answer.text.contains("missing field"), "{answer:?}");
                    continue;
                };
                let open = client.open.get(&id);
                let is_on_the_way = open.is_none_or(|open| open.waits || WAITING.contains(&open.kind));
                if answer.result == RequestResult::Waiting
                    || answer.result == RequestResult::Accepted && is_on_the_way
                {
                    continue;
                }
                let open = client.open.remove(&id).unwrap_or_else(|| panic!("a second answer: {answer:?}"));
                *self.answers.entry(format!("{:?}", answer.result)).or_default() += 1;
                let is_stop = ["stop", "off", "estop", "park"].contains(&open.kind);
                match answer.result {
                    RequestResult::Done if is_stop => self.stopped = self.stopped.max(open.sent),
                    RequestResult::Accepted => self.lost.push(open),
                    _ => {}
                }
            }
        }
    }
}

/// Random events, then everything that is needed until nobody waits any more.
fn search(seed: u64, runs: u64) {
    let mut world = World::new(seed);
    for run in 0..runs {
        (0..40).for_each(|_| world.act());
        (world.has_driver, world.has_source) = (true, true);
        for _ in 0..200 {
            world.step += 1;
            world.send_due();
            NOW_NS.set(NOW_NS.get() + 110_000_000);
            world.advance_motion();
            world.cycle();
            world.round();
        }
        for client in &world.clients {
            let open: Vec<_> = client.open.iter().map(|(id, open)| (id, open.kind)).collect();
            assert!(open.is_empty() && client.later.is_empty(), "run {run}: without an answer: {open:?}");
        }
    }
    let World { answers, begun, rides, .. } = world;
    println!("{runs} orders of requests: control has begun {begun} times, rides {rides}; {answers:?}");
    let often = |result| answers.get(&format!("{result:?}")).is_some_and(|count| *count > runs / 4);
    let results = [RequestResult::Done, RequestResult::Superseded, RequestResult::Refused];
    assert!(begun > runs / 4 && rides > runs / 40 && results.into_iter().all(often));
}

#[test]
fn after_a_stop_nothing_engages_that_was_asked_for_before_and_each_request_has_one_answer() {
    search(1, 1000);
}

#[test]
#[ignore = "second tier: takes long"]
fn nor_in_ten_thousand_orders_of_requests() {
    search(2, 10_000);
}
