//! That the streams cover what a controller may meet.

use std::collections::BTreeSet;
use std::fmt::Debug;

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::law::ControlMode;
use hexad::control::parameters::ViolationPolicy;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::DriveStatus;
use hexad::control::signals::inputs::{Input, Measurement, SetpointKind};
use hexad::control::signals::limits::Limit;
use hexad::control::signals::state::{Request, State};
use hexad::model::fidelity::Fidelity;

use super::AVX2;
use super::stream::Run;
use hexad_support::rig::parameters;

/// Codes that no stream shows: of the daemon, and of what would be a fault of hexad.
const UNSEEN: [DiagnosticCode; 3] =
    [DiagnosticCode::DaemonEnding, DiagnosticCode::OtherPoses, DiagnosticCode::ForceNotFinite];
/// Fewest machines, and bounds of slow and fast loops \[Hz\].
const LEAST_MACHINES: usize = 8;
const SLOW_HZ: f64 = 250.0;
const FAST_HZ: f64 = 4000.0;

/// Names of what was seen.
#[derive(Default)]
struct Seen(BTreeSet<String>);

/// With its type: there is a request `Off` and a state.
fn name<T: Debug>(what: T) -> String {
    format!("{} {what:?}", core::any::type_name::<T>())
}

impl Seen {
    fn add(&mut self, what: impl Debug) {
        self.0.insert(name(what));
    }

    fn add_if(&mut self, is_seen: bool, what: &str) {
        if is_seen {
            self.0.insert(what.into());
        }
    }

    fn config(&mut self, config: &Config) {
        let (parameters, rate_hz) = (parameters(config), 1.0 / config.deployment.realtime.period_s());
        self.add(parameters.law.mode);
        self.add(parameters.fidelity);
        self.add(parameters.on_violation);
        self.add_if(parameters.noise.rate_noise_ratio.is_some(), "rates that are used");
        self.add_if(rate_hz <= SLOW_HZ, "a slow loop");
        self.add_if(rate_hz >= FAST_HZ, "a fast loop");
    }

    fn input(&mut self, input: &Input) {
        if let Some(setpoint) = &input.setpoint {
            self.add(setpoint.kind);
        }
        if let Some(Measurement { rate_m_s, pose, drives, .. }) = &input.measurement {
            let DriveStatus { enabled, brake_open, fault, force_n } = drives;
            let is_given = [enabled.is_some(), brake_open.is_some(), fault.is_some(), force_n.is_some()];
            self.add_if(rate_m_s.is_some(), "rates");
            self.add_if(rate_m_s.is_none(), "lengths alone");
            self.add_if(pose.is_some(), "a pose of another sensor");
            self.add_if(is_given == [true; 4], "a whole status of the drives");
            self.add_if(is_given == [false, false, true, false], "a part of the status of the drives");
        }
        self.add_if(input.clock_offset_ns != 0, "another clock");
        self.add_if(input.setpoint_publishers.ignored_pid_or_0 != 0, "two sources of setpoints");
        self.add_if(input.measured_publishers.ignored_pid_or_0 != 0, "two sources of measurements");
        self.add_if(input.had_faulty_overrun, "a missed deadline");
    }

    /// The output of an input that follows another output.
    fn output(&mut self, input: &Input, before: &Output, output: &Output) {
        self.add(output.state);
        self.add(output.diagnostic.code);
        self.add(output.request_diagnostic.code);
        if let Some(request) = input.request.filter(|_| output.answered_message != before.answered_message) {
            self.add(request.request);
        }
        let active = Limit::ALL.into_iter().filter(|limit| output.active_limits.contains(*limit));
        active.for_each(|limit| self.add(limit));
    }

    fn missing<T: Debug>(&self, all: impl IntoIterator<Item = T>) -> Vec<String> {
        all.into_iter().map(name).filter(|each| !self.0.contains(each)).collect()
    }
}

#[test]
fn the_streams_cover_what_a_controller_may_meet() {
    let (mut seen, mut machines) = (Seen::default(), BTreeSet::new());
    for Run { stream, config, outputs } in AVX2.iter() {
        seen.config(config);
        machines.insert(format!("{:?}", config.machine.home));
        let mut before = &Output::default();
        for (input, output) in stream.inputs.iter().zip(outputs) {
            seen.input(input);
            seen.output(input, before, output);
            before = output;
        }
    }
    let fidelities = Fidelity::ALL.into_iter().filter(|fidelity| *fidelity != Fidelity::Gravity);
    let kinds = SetpointKind::ALL.into_iter().chain([SetpointKind::Unknown]);
    let missing = [
        seen.missing(State::ALL),
        seen.missing(Request::ALL),
        seen.missing(ControlMode::ALL),
        seen.missing([ViolationPolicy::Stop, ViolationPolicy::Limit]),
        seen.missing(fidelities),
        seen.missing(kinds),
        seen.missing(Limit::ALL),
    ];
    assert_eq!(missing.concat(), [""; 0]);
    for what in [
        "a slow loop",
        "a fast loop",
        "rates",
        "rates that are used",
        "lengths alone",
        "a pose of another sensor",
        "a whole status of the drives",
        "a part of the status of the drives",
        "another clock",
        "two sources of setpoints",
        "two sources of measurements",
        "a missed deadline",
    ] {
        assert!(seen.0.contains(what), "{what}");
    }
    assert!(machines.len() >= LEAST_MACHINES, "{} machines", machines.len());
    assert_eq!(seen.missing(DiagnosticCode::ALL.iter().copied()), UNSEEN.map(name), "codes without a stream");
}
