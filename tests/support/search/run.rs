//! One run of a genome: the controller against the plant, scored by the true motion.

use hexad::control::controller::{Controller, Output};
use hexad::control::parameters::{Parameters, ViolationPolicy};
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::{Input, Measurement};
use hexad::control::signals::limits::Limit;
use hexad::control::signals::state::{Request, State};
use hexad::model::machine::Machine;
use hexad::model::task::TaskState;
use hexad::motion::minimum_jerk::{Profile, rise};
use hexad::plant::hardware::Hardware;
use nalgebra::Vector6;

use super::genome::Genome;
use super::messages::Channel;
use super::property::{Moment, PROPERTIES, Stop, longest_stop_s, planned_stop_s};
use super::scenario::Scenario;
use crate::rig::{Rig, START_NS, STEP_S};

/// What a run has shown.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Largest value of each property; minus infinity where it said nothing.
    pub worst: [f64; PROPERTIES.len()],
    /// Under control.
    pub cycles: u64,
    /// Measurements under control, without and with rates.
    pub measured: [u64; 2],
    /// Which faults were counted, the last of them.
    pub fault: DiagnosticCode,
    pub end_stops: u32,
}

/// The source as the platform sees it: displaced so that it begins where the platform is.
struct Source {
    /// Since which control lasts \[s\], and the platform's pose then.
    engaged: Option<(f64, Vector6<f64>)>,
    /// Displacement of each stream \[m\], \[rad\].
    shift: [Vector6<f64>; 2],
    is_replaced: bool,
}

/// What a controller is made of that is wrong on purpose; the meter keeps the right one.
pub type Doctor = fn(&mut Machine, &mut Parameters);

/// Runs a genome, until its end or until the drives are too weak.
pub fn run(genome: &Genome, doctor: Option<Doctor>) -> Outcome {
    run_with(genome, doctor, |_, _, _| {})
}

/// The same; each cycle goes to `watch` after the platform has moved.
pub fn run_with(
    genome: &Genome,
    doctor: Option<Doctor>,
    mut watch: impl FnMut(&Rig, &Input, &Output),
) -> Outcome {
    let scenario = Scenario::of(genome);
    let mut config = scenario.config.as_ref().clone();
    let brakes = &mut config.deployment.plant.brake_deceleration_m_s2;
    *brakes = scenario.brakes_m_s2.unwrap_or(*brakes);
    let mut observed = Rig::metered(&config, &config.machine, scenario.parameters);
    if let Some(imperfections) = &scenario.imperfections {
        let plant = &config.deployment.plant;
        observed.put(Hardware::new(
            &config.machine,
            plant.brake_deceleration_m_s2,
            STEP_S,
            plant.tolerance_m,
            imperfections,
        ));
    }
    if let Some(doctor) = doctor {
        let (mut machine, mut parameters) = (scenario.config.machine.clone(), scenario.parameters);
        doctor(&mut machine, &mut parameters);
        observed.controller = Controller::new(&machine, parameters);
    }
    let is_twin = genome.policy == ViolationPolicy::Stop && doctor.is_none();
    let mut twin = is_twin.then(|| Twin::of(&scenario));
    observed.phase_ns = scenario.phase_ns;
    observed.rates = genome.sensors.rates();
    observed.force_delay_ns = scenario.force_delay_ns;
    let mut source = Source { engaged: None, shift: [Vector6::zeros(); 2], is_replaced: false };
    let mut channel = scenario.messages.channel();
    let mut requests = scenario.requests.to_vec();
    requests.sort_by(|a, b| a.0.total_cmp(&b.0));
    requests.reverse();
    let mut frozen: Option<Measurement> = None;
    let mut before = Output::default();
    let (mut without_s, mut faults, mut measured) = (0.0, Faults::default(), [0; 2]);
    let (mut worst, mut stopped) = ([f64::NEG_INFINITY; PROPERTIES.len()], None::<Stop>);
    while observed.time_s() < scenario.duration_s
        && observed.meter().impact_m_s.is_none()
        && !is_carried_out(&observed)
        // Drives that are too weak move the platform elsewhere whatever the reference is.
        && !before.active_limits.contains(Limit::Force)
    {
        source.follow(&scenario, &observed, before.state);
        if let Some(request) = ask(&scenario, &mut observed, before.state, &mut requests, &mut without_s) {
            let is_stop = request == Request::Stop && before.state.has_control();
            stopped = is_stop.then(|| Stop {
                at_s: observed.time_s(),
                longest_s: longest_stop_s(&observed.parameters, &observed.simulator().state().twist),
                planned_s: before
                    .reference
                    .map(|motion| planned_stop_s(&observed.parameters.limits, &motion)),
            });
        }
        let input = input(&scenario, &observed, &source, &mut channel, &mut frozen);
        let output = observed.cycle(&input);
        if let Some(measurement) = input.measurement.filter(|_| output.state.has_control()) {
            measured[usize::from(measurement.rate_m_s.is_some())] += 1;
        }
        let policies_apart = twin.as_mut().and_then(|twin| twin.apart(&observed.controller, &input, &output));
        watch(&observed, &input, &output);
        faults.add(&before, &output);
        stopped = stopped.filter(|_| output.state.has_control());
        let (rig, policy, stop) = (&observed, genome.policy, stopped);
        let moment = Moment { rig, before: &before, output: &output, stop, faults, policy, policies_apart };
        for (worst, property) in worst.iter_mut().zip(&PROPERTIES) {
            let value = property.value(&moment);
            *worst = if value.is_nan() { f64::INFINITY } else { worst.max(value) };
        }
        before = output;
    }
    Outcome {
        worst,
        cycles: observed.meter().cycles,
        measured,
        fault: faults.last,
        end_stops: u32::from(observed.meter().impact_m_s.is_some()),
    }
}

/// A controller under "limit" that gets the inputs of one under "stop".
struct Twin {
    controller: Controller,
    /// Whether the other has refused no setpoint, and both had the same state, since control began.
    is_equal: bool,
    /// Whether control has begun: in its first cycle refusals are not counted.
    has_begun: bool,
}

impl Twin {
    fn of(scenario: &Scenario) -> Self {
        let parameters = Parameters { on_violation: ViolationPolicy::Limit, ..scenario.parameters };
        let controller = Controller::new(&scenario.config.machine, parameters);
        Self { controller, is_equal: true, has_begun: false }
    }

    /// Distance of the references, of translation or rotation, the larger. `stop` has made the output from the input.
    fn apart(&mut self, stop: &Controller, input: &Input, output: &Output) -> Option<f64> {
        if !output.state.has_control() || !self.has_begun {
            self.controller.set_memory(stop.memory().clone());
            (self.is_equal, self.has_begun) = (true, output.state.has_control());
            return None;
        }
        if !self.is_equal {
            return None;
        }
        let limit = self.controller.step(input);
        // Engaging ends later under "stop" where the reference stays far from the setpoint.
        self.is_equal = limit.missed_setpoints == output.missed_setpoints
            && limit.state == output.state
            && output.state != State::Stopping;
        let (stop, limit) = (output.reference.filter(|_| self.is_equal)?, limit.reference?);
        // Under "stop" it rests for good where the straight way to a target meets a bound.
        let is_at_bound =
            [Limit::Stroke, Limit::Envelope].iter().any(|it| output.active_limits.contains(*it));
        self.is_equal = !(is_at_bound && stop.twist.vector().amax() == 0.0);
        let apart = stop.pose.displacement_to(&limit.pose);
        Some(apart.linear.norm().max(apart.angular.norm()))
    }
}

/// Whether closing brakes have carried a leg beyond its stroke: the plant's brakes know no end stop, and there is nothing that
/// control could do about it.
fn is_carried_out(observed: &Rig) -> bool {
    let actuator = &observed.machine.actuator;
    observed.force.is_none()
        && observed.measurement().length_m.iter().any(|length| !actuator.contains(*length))
}

/// Faults that ended control, but for the operator's and those of lost measurements.
#[derive(Clone, Copy, Debug, Default)]
pub struct Faults {
    pub count: u32,
    pub last: DiagnosticCode,
}

impl Faults {
    /// Two outputs, one after the other.
    pub fn add(&mut self, before: &Output, output: &Output) {
        if before.state.has_control() && is_own_fault(output) && !is_own_fault(before) {
            (self.count, self.last) = (self.count + 1, output.diagnostic.code);
        }
    }
}

fn is_own_fault(output: &Output) -> bool {
    use DiagnosticCode::{EmergencyStop, MeasurementLost, MeasurementStampInvalid};
    let code = output.diagnostic.code;
    code.is_fault() && ![EmergencyStop, MeasurementLost, MeasurementStampInvalid].contains(&code)
}

/// Sends the request of this cycle, if any.
fn ask(
    scenario: &Scenario,
    observed: &mut Rig,
    state: State,
    requests: &mut Vec<(f64, Request)>,
    without_s: &mut f64,
) -> Option<Request> {
    if let Some((_, request)) = requests.pop_if(|(at_s, _)| *at_s <= observed.time_s()) {
        observed.ask(request);
        return Some(request);
    }
    *without_s = if state.has_control() { 0.0 } else { *without_s + observed.period_s() };
    if *without_s < scenario.retry_s {
        return None;
    }
    *without_s = 0.0;
    let request = match state {
        State::Fault => Request::Clear,
        _ if scenario.parks => Request::Park,
        State::Off => Request::Clear,
        _ => Request::Engage,
    };
    observed.ask(request);
    Some(request)
}

fn input(
    scenario: &Scenario,
    observed: &Rig,
    source: &Source,
    channel: &mut Channel,
    frozen: &mut Option<Measurement>,
) -> Input {
    let is_ideal = source.engaged.is_none();
    let at = |t: f64| source.at(scenario, t);
    let setpoint = channel.setpoint(&scenario.messages, [START_NS, observed.now_ns], is_ideal, at);
    let mut input = observed.input_with(setpoint);
    if scenario.frozen_s.is_some_and(|frozen_s| observed.time_s() >= frozen_s && !is_ideal) {
        let frozen = frozen.get_or_insert_with(|| observed.measurement());
        input.measurement = Some(Measurement { time_ns: observed.now_ns, ..*frozen });
    } else {
        input.measurement = channel.measurement(&scenario.messages, observed.measurement());
    }
    input
}

impl Source {
    /// Where the source stands to the platform: beside it without control, by itself under control.
    fn follow(&mut self, scenario: &Scenario, observed: &Rig, state: State) {
        let (t, x) = (observed.time_s(), observed.x());
        if !state.has_control() {
            self.engaged = None;
            self.is_replaced = t >= scenario.replaced_s;
            if scenario.start.is_moving {
                self.shift = [0, 1].map(|index: usize| x - scenario.streams[index].at(t).x);
            } else {
                self.shift = [x; 2];
            }
        } else if self.engaged.is_none() {
            self.engaged = Some((t, x));
            if !scenario.start.is_moving {
                self.shift = [Vector6::zeros(); 2];
            }
        }
        if t >= scenario.replaced_s && !self.is_replaced {
            self.is_replaced = true;
            if scenario.is_continued && self.engaged.is_some() {
                let [a, b] = [0, 1].map(|index: usize| scenario.streams[index].at(t).x);
                self.shift[1] = self.shift[0] + a - b;
            }
        }
    }

    /// The setpoint that the source sends for an instant.
    fn at(&self, scenario: &Scenario, t: f64) -> TaskState {
        let index = usize::from(self.is_replaced);
        let mut task = scenario.streams[index].at(t);
        if !scenario.start.is_moving {
            let Some((since_s, from)) = self.engaged else {
                return TaskState::at_rest(self.shift[0].into());
            };
            task.x += self.shift[index];
            return faded(&task, &from, t - since_s, scenario.start.fade_s);
        }
        task.x += self.shift[index];
        task
    }
}

/// From a pose onto a motion.
fn faded(task: &TaskState, from: &Vector6<f64>, t: f64, fade_s: f64) -> TaskState {
    if t >= fade_s {
        return *task;
    }
    let Profile { value_share, rate_per_s, accel_per_s2 } = rise(t, fade_s);
    let d = task.x - from;
    TaskState {
        x: from + d * value_share,
        xd: d * rate_per_s + task.xd * value_share,
        xdd: d * accel_per_s2 + task.xd * (2.0 * rate_per_s) + task.xdd * value_share,
    }
}
