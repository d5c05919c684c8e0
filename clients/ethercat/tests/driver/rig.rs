//! Controller, driver, segment and platform in lock-step on one simulated clock.

use hexad_client::messages::{ForceMessage, MeasuredMessage, Message};
use hexad_core::control::controller::{Controller, Output};
use hexad_core::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad_core::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad_core::model::fidelity::Fidelity;
use hexad_core::model::task::TaskState;
use hexad_core::motion::built_in::{BuiltInMotion, FittedMotion, fit};
use hexad_core::motion::timeline::Timeline;
use hexad_core::plant::simulator::Simulator;
use hexad_ethercat::bus::Bus;
use hexad_ethercat::cia402::DriveState;
use hexad_ethercat::cycle::{Daemon, DevicesLost, Driver};
use hexad_ethercat::drives_file::DrivesFile;
use hexad_ethercat::process_data::ProcessData;
use hexad_ethercat::segment::Segment;
use hexad_ethercat::segment::mechanics::Mechanics;
use hexad_ethercat::startup::OpDevices;
use hexad_machine::config::Config;

use super::common::*;

/// From the measurement to the force that responds to it.
const ANSWER_NS: u64 = 150_000;

/// Controller with a setpoint source, without threads or topics.
pub struct TestDaemon {
    controller: Controller,
    /// Pose before the motion.
    rest: [f64; 6],
    scene: FittedMotion,
    timeline: Timeline,
    /// Instant at which the motion starts \[ns\].
    pub motion_ns: Option<u64>,
    request: Option<OperatorRequest>,
    sequence: u64,
    /// The force under way, and its arrival.
    answer: Option<(u64, ForceMessage)>,
    /// A daemon that hangs does not respond.
    pub is_hung: bool,
    pub output: Output,
    pub stamp_ns: u64,
    pub measured: MeasuredMessage,
}

impl TestDaemon {
    pub fn new(machine: &Config, motion: BuiltInMotion, seconds: f64) -> Self {
        let parameters = hexad_daemon::parameters(&machine.machine, &machine.deployment, Fidelity::Exact);
        let scene = fit(&machine.machine, motion, seconds);
        let home = machine.machine.home.into();
        Self {
            controller: Controller::new(&machine.machine, parameters),
            rest: machine.machine.home,
            scene,
            timeline: Timeline::new(&machine.machine, &home, &scene.at(0.0).x, scene.duration_s),
            motion_ns: None,
            request: None,
            sequence: 0,
            answer: None,
            is_hung: false,
            output: Output::default(),
            stamp_ns: 0,
            measured: MeasuredMessage::default(),
        }
    }

    pub fn ask(&mut self, request: Request) {
        let sequence = self.request.map_or(1, |request| request.message.sequence + 1);
        self.request = Some(OperatorRequest { request, message: MessageId { epoch: 1, sequence } });
    }

    /// Holds a pose until the motion starts.
    pub fn hold(&mut self, pose: [f64; 6]) {
        self.rest = pose;
    }

    /// Setpoint of an instant \[ns\].
    pub fn task(&self, time_ns: u64) -> TaskState {
        let Some(motion_ns) = self.motion_ns else {
            return TaskState::at_rest(self.rest);
        };
        let t = time_ns.saturating_sub(motion_ns) as f64 * 1e-9;
        self.timeline.at(t % self.timeline.end(), |t| self.scene.at(t))
    }

    pub fn seconds(&self) -> f64 {
        self.timeline.end()
    }

    /// The force that responds to a measurement at once.
    pub fn respond(&mut self, stamp_ns: u64, measurement: Measurement) -> Output {
        let input = Input {
            release_ns: stamp_ns,
            clock_offset_ns: -100_000,
            setpoint: Some(Setpoint::motion(stamp_ns, self.task(stamp_ns))),
            measurement: Some(measurement),
            request: self.request,
            ..Input::default()
        };
        self.output = self.controller.step(&input);
        self.output
    }
}

impl Daemon for TestDaemon {
    fn publish(&mut self, stamp_ns: u64, measured: MeasuredMessage) {
        (self.stamp_ns, self.measured) = (stamp_ns, measured);
        if self.is_hung {
            return;
        }
        let mut measured = measured;
        measured.header.time_ns = stamp_ns;
        let output = self.respond(stamp_ns, Measurement::from(&measured));
        let mut message = ForceMessage::new(&output, stamp_ns);
        self.sequence += 1;
        let header = message.header_mut();
        (header.schema, header.sequence) = (ForceMessage::SCHEMA, self.sequence);
        header.time_ns = stamp_ns + ANSWER_NS;
        message.seal();
        self.answer = Some((stamp_ns + ANSWER_NS, message));
    }

    fn receive(&mut self, now_ns: u64) -> Option<ForceMessage> {
        self.answer.take_if(|(arrival_ns, _)| *arrival_ns <= now_ns).map(|(_, message)| message)
    }
}

/// All of it.
pub struct Rig<'f> {
    pub bus: TestBus<'f>,
    pub devices: OpDevices,
    pub driver: Driver<TestDaemon>,
}

impl<'f> Rig<'f> {
    pub fn new(frames: &'f hexad_ethercat::bus::Frames, file: &DrivesFile, segment: Segment) -> Self {
        Self::with_motion(frames, file, segment, BuiltInMotion::Sines, 8.0)
    }

    pub fn with_motion(
        frames: &'f hexad_ethercat::bus::Frames,
        file: &DrivesFile,
        segment: Segment,
        motion: BuiltInMotion,
        seconds: f64,
    ) -> Self {
        Self::start(bus(frames, segment), file, TestDaemon::new(&machine(), motion, seconds))
    }

    fn start(mut bus: TestBus<'f>, file: &DrivesFile, daemon: TestDaemon) -> Self {
        let (devices, clock) = up(&mut bus, file).unwrap();
        let actuator = &machine().machine.actuator;
        let middle_m = actuator.min_length_m.midpoint(actuator.max_length_m);
        let driver = Driver::new(ProcessData::new(file, middle_m, clock), &file.bus, daemon);
        Self { bus, devices, driver }
    }

    /// A new driver on the same bus, with the same daemon.
    pub fn with_new_driver(self) -> Self {
        Self::start(self.bus, &drives(), self.driver.daemon)
    }

    pub fn cycle(&mut self) -> Result<(), DevicesLost> {
        self.driver.cycle(&mut self.bus, &self.devices)
    }

    pub fn cycles(&mut self, count: u32) {
        for _ in 0..count {
            self.cycle().unwrap();
        }
    }

    /// Takes control at home; the motion starts then.
    pub fn engage(&mut self) {
        self.cycles(300);
        assert_eq!(self.state(), State::Standby, "{:?}", self.driver.daemon.output.diagnostic);
        self.driver.daemon.ask(Request::Engage);
        for _ in 0..2000 {
            self.cycles(1);
            if self.state() == State::Active {
                self.driver.daemon.motion_ns = Some(self.driver.daemon.stamp_ns);
                return;
            }
        }
        panic!("not active: {:?}", self.driver.daemon.output.diagnostic);
    }

    /// Goes on into the motion.
    pub fn engage_and_move(&mut self) {
        self.engage();
        self.cycles(4000);
        assert_eq!(self.state(), State::Active, "{:?}", self.driver.daemon.output.diagnostic);
    }

    pub fn state(&self) -> State {
        self.driver.daemon.output.state
    }

    pub fn segment(&mut self) -> &mut Segment {
        &mut self.bus.wire.link.segment
    }

    pub fn drive_states(&mut self) -> [DriveState; 6] {
        self.segment().devices.each_ref().map(|device| device.drive.state)
    }

    pub fn simulator(&self) -> &Simulator {
        simulator(&self.bus)
    }
}

pub fn simulator<'b, L>(bus: &'b Bus<'_, L>) -> &'b Simulator
where
    L: AsRef<Segment>,
{
    let segment: &Segment = bus.wire.link.as_ref();
    let Mechanics::Platform(hardware) = &segment.mechanics else { panic!("no platform") };
    hardware.simulator()
}
