//! Many platforms in one loop: the loop itself, with a step that steps the controller of each platform.
//!
//! Each has its own place on a moving path, exact fidelity, and is in control. What counts is the time from
//! wake-up to output; the inputs are there already. The loop ends with them: a platform whose inputs stood still
//! would report a frozen sensor.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{scope, sleep};
use std::time::{Duration, Instant};

use heapless::spsc::Queue;
use hexad::config::Config;
use hexad::control::controller::{Controller, Output};
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::{Input, Measurement, Setpoint};
use hexad::control::signals::state::{MessageId, OperatorRequest, Request, State};
use hexad::daemon::cycle::{self, CycleRecord};
use hexad::daemon::parameters;
use hexad::messages::clock::monotonic_ns;
use hexad::model::fidelity::Fidelity;
use hexad::model::inverse_geometry::leg_motion;
use hexad::model::task::TaskState;
use hexad::motion::built_in::{BuiltInMotion, fit};
use hexad::realtime::clock::Monotonic;
use hexad::realtime::cyclic::{RECORD_QUEUE_LENGTH, ReleaseMode, Timing};
use hexad::realtime::exchange::exchange;
use hexad::realtime::overrun::OverrunPolicy;
use hexad::realtime::setup::{memory, scheduling};

use super::Failure;
use super::distribution::Distribution;
use super::rig::{PRIORITY, Rig};
use super::size::{Trial, is_rare};

/// Where on the path the first platform begins, when the motion has faded in, and its length \[s\].
const BEGIN_S: f64 = 2.0;
const PATH_S: f64 = 60.0;

/// Platforms are this many rows of the path apart, up to so many rows.
const APART: usize = 7;
const SPREAD: usize = 512;

/// Steps before the first release, and the time between them: each platform is found and engaged, its code and
/// data are in memory.
const WARM_UP_STEPS: usize = 100;
const WARM_UP_STEP_S: f64 = 0.005;

/// How often the records are taken in: 20 ms of the fastest rate here fill a tenth of the queue.
const POLL: Duration = Duration::from_millis(5);

/// Steps that are timed one by one.
const STEPS: usize = 20_000;

/// Controllers and their inputs.
struct Fleet {
    controllers: Vec<Controller>,
    path: Vec<(TaskState, [f64; 6], [f64; 6])>,
    /// Of the path and of the clock. The inputs have a time of their own: a cycle that is skipped is no jump.
    cycle: usize,
    /// The last with inputs for every platform.
    last_cycle: usize,
    period_ns: u64,
    inactive: u64,
    /// Platform of the first of them, and the controller's reason.
    first_inactive: Option<(usize, DiagnosticCode)>,
}

impl Fleet {
    /// In control, with inputs for so many cycles at a rate.
    fn new(config: &Config, platforms: usize, period_s: f64, cycles: usize) -> Self {
        let machine = &config.machine;
        let scene = fit(machine, BuiltInMotion::Sines, PATH_S);
        let row = |index: usize| {
            let state = scene.at(BEGIN_S + index as f64 * period_s);
            let legs = leg_motion(machine, &state.motion());
            (state, legs.length_m, legs.rate_m_s)
        };
        let controller = Controller::new(machine, parameters(machine, &config.deployment, Fidelity::Exact));
        let stride = (WARM_UP_STEP_S / period_s) as usize;
        let last_cycle = WARM_UP_STEPS * stride + cycles;
        let mut fleet = Self {
            controllers: vec![controller; platforms],
            path: (0..last_cycle + SPREAD).map(row).collect(),
            cycle: 0,
            last_cycle,
            period_ns: (period_s * 1e9) as u64,
            inactive: 0,
            first_inactive: None,
        };
        for number in 1..=WARM_UP_STEPS as u64 {
            fleet.cycle += stride;
            fleet.step_all(Some(OperatorRequest {
                request: Request::Engage,
                message: MessageId { epoch: 1, sequence: number },
            }));
        }
        (fleet.inactive, fleet.first_inactive) = (0, None);
        fleet
    }

    fn step_all(&mut self, request: Option<OperatorRequest>) -> Output {
        let release_ns = self.cycle as u64 * self.period_ns;
        let mut last = Output::default();
        for (number, controller) in self.controllers.iter_mut().enumerate() {
            let Some((task, length, rate)) = self.path.get(self.cycle + number * APART % SPREAD) else {
                continue;
            };
            last = controller.step(&Input {
                release_ns,
                setpoint: Some(Setpoint::motion(release_ns, *task)),
                measurement: Some(Measurement {
                    time_ns: release_ns,
                    length_m: *length,
                    rate_m_s: Some(*rate),
                    ..Measurement::default()
                }),
                request,
                ..Input::default()
            });
            if last.state != State::Active {
                self.inactive += 1;
                self.first_inactive.get_or_insert((number, last.diagnostic.code));
            }
        }
        last
    }

    fn next_cycle(&mut self) -> Output {
        self.cycle += 1;
        self.step_all(None)
    }

    fn all_were_active(&self) -> Result<(), String> {
        self.first_inactive.map_or(Ok(()), |(platform, code)| {
            let steps = self.inactive;
            Err(format!(
                "{steps} steps were not in control, the first of platform {platform}: {}",
                code.name()
            ))
        })
    }
}

/// Runs the loop with so many platforms for so long, or for as many cycles as that time has.
pub fn trial(rig: &Rig, rate_hz: u32, platforms: usize, seconds: f64) -> Result<Trial, Failure> {
    let period_ns = 1_000_000_000 / u64::from(rate_hz);
    let timing = Timing {
        period_ns,
        phase_ns: period_ns / 2,
        release: ReleaseMode::Sleep,
        max_lead_ns: 0,
        timeout_ns: 0,
        on_overrun: OverrunPolicy::Skip,
        late_wakeup_ns: period_ns / 2,
    };
    let cycles = (seconds * f64::from(rate_hz)) as usize;
    let mut fleet = Fleet::new(&rig.config, platforms, 1.0 / f64::from(rate_hz), cycles);
    let (side, _io_side) = exchange();
    let mut queue = Box::new(Queue::<CycleRecord, RECORD_QUEUE_LENGTH>::new());
    let (records_in, mut records) = queue.split();
    let stop = AtomicBool::new(false);
    let mut busy = Distribution::default();
    let report = scope(|threads| -> Result<_, Failure> {
        let thread = threads.spawn(|| {
            prepare(rig)?;
            let step = |_: &mut Input, _: u64| {
                let output = fleet.next_cycle();
                if fleet.cycle == fleet.last_cycle {
                    stop.store(true, Ordering::Relaxed);
                }
                output
            };
            let report =
                cycle::run(&mut Monotonic, &timing, step, Output::default(), side, records_in, &stop);
            fleet.all_were_active().map(|()| report)
        });
        let begin = Instant::now();
        while begin.elapsed().as_secs_f64() < seconds {
            sleep(POLL);
            std::iter::from_fn(|| records.dequeue()).for_each(|record| busy.add(record.compute_ns, 1));
        }
        stop.store(true, Ordering::Relaxed);
        Ok(thread.join().map_err(|_| "the loop died")??)
    })?;
    let carries = is_rare(report.counters.overruns, report.counters.cycles);
    Ok(Trial { busy, carries })
}

/// Single steps of one controller on a moving path, two looks at the clock included.
pub fn steps(rig: &Rig) -> Result<Distribution, Failure> {
    let mut fleet = Fleet::new(&rig.config, 1, 1e-3, STEPS);
    let timed = scope(|threads| {
        let thread = threads.spawn(|| {
            prepare(rig)?;
            let mut times = Vec::with_capacity(STEPS);
            for _ in 0..STEPS {
                let begin_ns = monotonic_ns();
                std::hint::black_box(fleet.next_cycle());
                times.push((monotonic_ns() - begin_ns, 1));
            }
            fleet.all_were_active().map(|()| Distribution::from_iter(times))
        });
        thread.join()
    });
    Ok(timed.map_err(|_| "the steps died")??)
}

fn prepare(rig: &Rig) -> Result<(), String> {
    scheduling::set_shortest_timer_slack();
    memory::prefault_stack();
    scheduling::bind_to_cpu(rig.processors.contestant).map_err(|shortfall| shortfall.to_string())?;
    scheduling::fifo_priority(PRIORITY).map_err(|shortfall| shortfall.to_string())
}
