//! Any bytes as what happens to a controller: good cycles, requests, and inputs with numbers replaced by any
//! bits. Never a panic, and never a force that is not finite, beyond its limits, or without the state for it.

use std::sync::LazyLock;

use hexad::control::controller::{Controller, Output};
use hexad::control::parameters::{Parameters, ViolationPolicy};
use hexad::control::signals::inputs::{Input, Measurement, Setpoint, SetpointKind};

use hexad::config::Config;
use hexad::control::law::ControlMode;
use hexad::control::sensing::localization::PlatformState;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::limits::Limit;
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::daemon;
use hexad::model::fidelity::Fidelity;
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::task::TaskState;

static CONFIG: LazyLock<Config> = LazyLock::new(|| {
    Config::parse(include_str!("../../../config/fried2008.toml"), "fried2008.toml").expect("sound")
});

const START_NS: u64 = 86_400_000_000_000;

/// Rounding of a force at its bound, and of the reference at its limits.
const ROUNDING: f64 = 1e-9;

const KINDS: [SetpointKind; 4] =
    [SetpointKind::Motion, SetpointKind::Pose, SetpointKind::Target, SetpointKind::Unknown];

/// Whether control was reached; panics where an output is wrong, in any mode.
pub fn hold(input: &[u8]) -> bool {
    let others = ControlMode::ALL.map(|mode| run(input, mode, true, ViolationPolicy::Stop).1);
    let limited = run(input, ControlMode::default(), false, ViolationPolicy::Limit).1;
    run(input, ControlMode::default(), false, ViolationPolicy::Stop).1 | limited | others.contains(&true)
}

/// How many cycles it was, and whether control was reached.
pub fn run(input: &[u8], mode: ControlMode, has_rates: bool, policy: ViolationPolicy) -> (u64, bool) {
    let mut play = Play::new(input, mode, has_rates, policy);
    while play.cycle() {}
    (play.cycles, play.controlled)
}

struct Play<'a> {
    bytes: &'a [u8],
    parameters: Parameters,
    has_rates: bool,
    controller: Controller,
    now_ns: u64,
    /// Size of the source's motion.
    size: f64,
    asked: Option<OperatorRequest>,
    last: Output,
    controlled: bool,
    cycles: u64,
}

impl<'a> Play<'a> {
    fn new(bytes: &'a [u8], mode: ControlMode, has_rates: bool, policy: ViolationPolicy) -> Self {
        let mut deployment = CONFIG.deployment.clone();
        deployment.control.mode = mode;
        deployment.noise.rate_m_s = has_rates.then_some(1e-4);
        deployment.setpoint.on_violation = policy;
        // Both ways to return are played, each with one kind of driver.
        deployment.setpoint.holds_on_return = has_rates;
        let parameters = daemon::parameters(&CONFIG.machine, &deployment, Fidelity::Exact);
        Self {
            bytes,
            parameters,
            has_rates,
            controller: Controller::new(&CONFIG.machine, parameters),
            now_ns: START_NS,
            size: 0.0,
            asked: None,
            last: Output::default(),
            controlled: false,
            cycles: 0,
        }
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.bytes.split_first()?;
        self.bytes = rest;
        Some(*first)
    }

    fn bits(&mut self) -> Option<u64> {
        let (first, rest) = self.bytes.split_first_chunk::<8>()?;
        self.bytes = rest;
        Some(u64::from_le_bytes(*first))
    }

    /// What a good source and a good driver send: the platform is where it shall be.
    fn good(&self) -> Input {
        let t = (self.now_ns - START_NS) as f64 * 1e-9;
        let mut task = TaskState::at_rest(CONFIG.machine.home);
        for axis in 0..6 {
            let omega = 2.0 + axis as f64;
            let (sin, cos) = (omega * t).sin_cos();
            task.x[axis] += self.size * (1.0 - cos);
            task.xd[axis] = self.size * omega * sin;
            task.xdd[axis] = self.size * omega * omega * cos;
        }
        let legs = leg_motion(&CONFIG.machine, &task.motion());
        Input {
            release_ns: self.now_ns + self.parameters.period_ns / 2,
            setpoint: Some(Setpoint::motion(self.now_ns, task)),
            measurement: Some(Measurement {
                time_ns: self.now_ns,
                length_m: legs.length_m,
                rate_m_s: self.has_rates.then_some(legs.rate_m_s),
                ..Measurement::default()
            }),
            request: self.asked,
            ..Input::default()
        }
    }

    fn ask(&mut self, number: u8) {
        let request = Request::from_number(u32::from(number % 8));
        let sequence = self.asked.map_or(1, |asked| asked.message.sequence + 1);
        self.asked = request
            .map(|request| OperatorRequest { request, message: MessageId { epoch: 7, sequence } })
            .or(self.asked);
    }

    /// One instruction; false at the end.
    #[expect(clippy::too_many_lines, reason = "one arm for each kind of input")]
    fn cycle(&mut self) -> bool {
        let Some(op) = self.byte() else { return false };
        let high = op >> 4;
        match op & 15 {
            0..=5 => {
                for _ in 0..=u32::from(high) * u32::from(high) {
                    self.step(self.good());
                }
                return true;
            }
            6 => {
                self.ask(high);
                self.step(self.good());
                return true;
            }
            7 => {
                self.size = f64::from(high) * 1e-3;
                return true;
            }
            _ => {}
        }
        let mut input = self.good();
        let (Some(bits), Some(setpoint), Some(measurement)) =
            (self.bits(), &mut input.setpoint, &mut input.measurement)
        else {
            return false;
        };
        let value = f64::from_bits(bits);
        let place = usize::from(high);
        match op & 15 {
            8 => setpoint.task.x[place % 6] = value,
            9 => setpoint.task.xd[place % 6] = value,
            10 => setpoint.task.xdd[place % 6] = value,
            11 => measurement.length_m[place % 6] = value,
            12 => measurement.rate_m_s.get_or_insert_default()[place % 6] = value,
            13 => match place % 4 {
                0 => setpoint.time_ns = bits,
                1 => measurement.time_ns = bits,
                2 => input.release_ns = bits,
                _ => self.now_ns = START_NS + bits % (1 << 40),
            },
            14 if place >= 12 => setpoint.kind = KINDS[place % 4],
            14 => match place % 4 {
                0 => input.setpoint = None,
                1 => input.measurement = None,
                2 => input.had_faulty_overrun = true,
                _ => {
                    input.request = Some(OperatorRequest {
                        request: Request::ALL[place % 6],
                        message: MessageId { epoch: bits, sequence: bits },
                    })
                }
            },
            _ => {
                // Small changes: what passes the checks by a little.
                let small = (bits % 2048) as f64 * 1e-6 - 1e-3;
                match place % 5 {
                    0 => setpoint.task.x.iter_mut().for_each(|x| *x += small),
                    1 => setpoint.task.xd.iter_mut().for_each(|x| *x += 100.0 * small),
                    2 => setpoint.task.xdd.iter_mut().for_each(|x| *x += 10_000.0 * small),
                    3 => measurement.length_m[place % 6] += small,
                    _ => measurement.rate_m_s.get_or_insert_default()[place % 6] += 100.0 * small,
                }
            }
        }
        self.step(input);
        true
    }

    fn step(&mut self, input: Input) {
        let request = input.request.filter(|asked| asked.message != self.last.answered_message);
        let output = self.controller.step(&input);
        self.check(&output, request.map(|asked| asked.request));
        self.controlled |= output.state == State::Active;
        self.last = output;
        self.cycles += 1;
        self.now_ns += self.parameters.period_ns;
    }

    fn check(&self, output: &Output, request: Option<Request>) {
        let limit = CONFIG.machine.actuator.max_force_n;
        let Output { state, diagnostic, command_n, active_limits, .. } = output;
        if state.has_control() {
            assert!(command_n.iter().all(|force| force.abs() <= limit), "{output:?}");
            let most =
                self.parameters.force_rate_n_s * self.parameters.period_ns as f64 * 1e-9 + ROUNDING * limit;
            if self.last.state.has_control() {
                let steady = command_n
                    .iter()
                    .zip(&self.last.command_n)
                    .all(|(now, before)| (now - before).abs() <= most);
                assert!(steady, "{output:?} after {:?}", self.last);
            }
            if command_n.iter().any(|force| force.abs() == limit) {
                assert!(
                    [Limit::Force, Limit::ForceRate].iter().any(|it| active_limits.contains(*it)),
                    "{output:?}"
                );
            }
            assert!(output.platform.is_some() && output.error.is_some(), "{output:?}");
        } else {
            assert_eq!(command_n.map(f64::to_bits), [0; 6], "{output:?}");
        }
        if let Some(PlatformState { pose, twist, .. }) = &output.platform {
            let numbers =
                pose.position.iter().chain(&pose.rotation).chain(&twist.angular).chain(&twist.linear);
            assert!(numbers.into_iter().all(|number| number.is_finite()), "{output:?}");
        }
        self.check_reference(output);
        assert!(*state != State::Fault || diagnostic.code.is_fault(), "{output:?}");
        match request {
            Some(Request::Estop) => assert_eq!(*state, State::Fault),
            Some(Request::Off) => assert!(!state.has_control()),
            _ => {}
        }
        let before = self.last.state;
        let allowed = match state {
            State::Off | State::Fault => true,
            State::Standby => matches!(before, State::Off | State::Standby | State::Stopping),
            State::Engaging => {
                // Without setpoints an active platform holds its pose.
                let holds = diagnostic.code == DiagnosticCode::HoldingPose;
                before == State::Engaging
                    || holds
                        && before == State::Active
                        && self.parameters.on_violation == ViolationPolicy::Limit
                    || matches!(before, State::Off | State::Standby) && request == Some(Request::Engage)
            }
            State::Active => matches!(before, State::Engaging | State::Active),
            // Parking begins with a stop.
            State::Stopping => {
                before.has_control()
                    || matches!(before, State::Off | State::Standby) && request == Some(Request::Park)
            }
            State::Parking => matches!(before, State::Parking | State::Stopping),
        };
        let cleared = before != State::Fault || *state == State::Fault || request == Some(Request::Clear);
        assert!(allowed && cleared, "{before:?} to {state:?} by {request:?}");
    }

    /// There is a reference under control and only there, and it keeps its limits whatever was sent and whenever.
    fn check_reference(&self, output: &Output) {
        assert_eq!(output.reference.is_some(), output.state.has_control(), "{output:?}");
        let Some(reference) = output.reference else { return };
        let limits = &self.parameters.limits;
        for (v, a, limits) in [
            (reference.twist.angular, reference.acceleration.angular, limits.orientation),
            (reference.twist.linear, reference.acceleration.linear, limits.position),
        ] {
            assert!(v.norm() <= limits.velocity * (1.0 + ROUNDING), "{output:?}");
            assert!(a.norm() <= limits.acceleration * (1.0 + ROUNDING), "{output:?}");
        }
        let lengths = leg_motion(&CONFIG.machine, &reference).length_m;
        let margins = lengths.map(|length| CONFIG.machine.actuator.margin(length));
        assert!(margins.into_iter().all(|margin| margin > -ROUNDING), "{margins:?} {output:?}");
    }
}
