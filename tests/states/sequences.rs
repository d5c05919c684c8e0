//! Ways through the whole controller, in closed loop with the platform: whatever is asked and whatever is
//! wrong, in whatever order.

use std::sync::LazyLock;

use hexad::config::Config;
use hexad::control::controller::Output;
use hexad::control::sensing::localization::PlatformState;
use hexad::control::signals::diagnostic::DiagnosticCode;
use hexad::control::signals::inputs::Input;
use hexad::control::signals::limits::Limit;
use hexad::control::signals::state::{Request, State};
use hexad::model::task::{TaskState, task_coordinates};
use hexad::motion::built_in::{BuiltInMotion, FittedMotion, fit};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use hexad_support::rig::Rig;
use hexad_support::{deployed, largest};

static CONFIG: LazyLock<Config> = LazyLock::new(|| {
    let mut config = deployed("motion_base");
    config.deployment.plant.step_s = 1e-3;
    config
});
static SCENE: LazyLock<FittedMotion> = LazyLock::new(|| fit(&CONFIG.machine, BuiltInMotion::Sines, 8.0));

/// What is wrong with the inputs for a while.
#[derive(Clone, Copy, Debug)]
enum Wrong {
    Nothing,
    NoSetpoint,
    NoMeasurement,
    NanSetpoint,
    NanMeasurement,
    OldSetpoint,
    OldMeasurement,
    FarSetpoint,
    FarMeasurement,
    DeadlineMissed,
    /// The source plays the scene instead of standing at its beginning, or the other way round.
    OtherSource,
    /// Time goes on without cycles.
    Held,
}

/// A request, what is wrong from then on, and for how many cycles.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    request: Option<Request>,
    wrong: Wrong,
    cycles: u32,
}

fn stretch() -> impl Strategy<Value = Stretch> {
    // Engage and clear more often: else nothing would be under way.
    let request = prop_oneof![
        3 => Just(None),
        4 => Just(Some(Request::Engage)),
        2 => Just(Some(Request::Clear)),
        1 => Just(Some(Request::Park)),
        1 => Just(Some(Request::Stop)),
        1 => Just(Some(Request::Off)),
        1 => Just(Some(Request::Estop)),
    ];
    use Wrong::*;
    let wrong = prop_oneof![
        12 => Just(Nothing),
        4 => Just(OtherSource),
        8 => prop::sample::select(vec![
            NoSetpoint, NoMeasurement, NanSetpoint, NanMeasurement, OldSetpoint, OldMeasurement,
            FarSetpoint, FarMeasurement, DeadlineMissed, Held,
        ]),
    ];
    (request, wrong, prop_oneof![1..4_u32, 1..150_u32]).prop_map(|(request, wrong, cycles)| Stretch {
        request,
        wrong,
        cycles,
    })
}

/// The rig and what has been seen of it.
struct Watched {
    rig: Rig,
    playing_since_ns: Option<u64>,
    stands_at: TaskState,
    before: Output,
    last: Input,
    /// Since the last fault: cleared, then engaged or parked.
    cleared: bool,
    seen: [bool; 7],
}

impl Watched {
    fn new() -> Self {
        Self {
            rig: Rig::new(&CONFIG, &CONFIG.machine),
            playing_since_ns: None,
            stands_at: TaskState::at_rest(CONFIG.machine.home),
            before: Output::default(),
            last: Input::default(),
            cleared: true,
            seen: [false; 7],
        }
    }

    fn task(&self) -> TaskState {
        match self.playing_since_ns {
            Some(since_ns) => SCENE.at(1.9 + (self.rig.now_ns - since_ns) as f64 * 1e-9),
            None => self.stands_at,
        }
    }

    fn run(&mut self, stretch: &Stretch) {
        match stretch.wrong {
            Wrong::OtherSource => {
                self.playing_since_ns = match self.playing_since_ns {
                    Some(_) => None,
                    None => Some(self.rig.now_ns),
                }
            }
            Wrong::Held => self.rig.now_ns += 7_000_000 * u64::from(stretch.cycles),
            _ => {}
        }
        // Whoever stands, stands where the platform does.
        if !self.before.state.has_control()
            && let Some(PlatformState { pose, .. }) = self.before.platform
        {
            self.stands_at = TaskState::at_rest(task_coordinates(&pose, &CONFIG.machine.home));
        }
        if let Some(request) = stretch.request {
            self.rig.ask(request);
        }
        for cycle in 0..stretch.cycles {
            let input = self.spoilt(stretch.wrong);
            let output = self.rig.cycle(&input);
            self.check(stretch.request.filter(|_| cycle == 0), &output);
            (self.before, self.last) = (output, input);
        }
    }

    fn spoilt(&self, wrong: Wrong) -> Input {
        let mut input = self.rig.input(&self.task());
        let (setpoint, measured) = (input.setpoint.as_mut().unwrap(), input.measurement.as_mut().unwrap());
        match wrong {
            Wrong::Nothing | Wrong::OtherSource | Wrong::Held => {}
            Wrong::NoSetpoint => input.setpoint = self.last.setpoint,
            Wrong::NoMeasurement => input.measurement = self.last.measurement,
            Wrong::NanSetpoint => setpoint.task.xd[3] = f64::NAN,
            Wrong::NanMeasurement => measured.rate_m_s.get_or_insert_default()[3] = f64::NAN,
            Wrong::OldSetpoint => setpoint.time_ns -= 1_000_000_000,
            Wrong::OldMeasurement => measured.time_ns -= 1_000_000_000,
            Wrong::FarSetpoint => setpoint.task.x[4] += 0.03,
            Wrong::FarMeasurement => measured.length_m[4] += 0.03,
            Wrong::DeadlineMissed => input.had_faulty_overrun = true,
        }
        input
    }

    /// What must hold in every cycle.
    #[expect(clippy::cognitive_complexity, reason = "assertions count as branches")]
    fn check(&mut self, request: Option<Request>, now: &Output) {
        let before = self.before;
        let (had, has) = (before.state.has_control(), now.state.has_control());
        self.seen[now.state as usize] = true;
        // Off and estop let go within the cycle, whatever else is wrong.
        match request {
            Some(Request::Estop) => {
                assert_eq!((now.state, now.diagnostic.code), (State::Fault, DiagnosticCode::EmergencyStop))
            }
            Some(Request::Off) => assert!(matches!(now.state, State::Off | State::Fault), "{now:?}"),
            _ => {}
        }
        // A force only under control, finite, within its limits.
        assert!(has || now.command_n == [0.0; 6]);
        assert!(largest(&now.command_n) <= CONFIG.machine.actuator.max_force_n);
        assert!(now.command_n.iter().all(|force| force.is_finite()));
        if had && has {
            let most = CONFIG.deployment.limits.force_rate_n_s * 1e-3;
            let step: [f64; 6] = core::array::from_fn(|leg| now.command_n[leg] - before.command_n[leg]);
            assert!(largest(&step) <= most * (1.0 + 1e-9), "{step:?}");
        }
        // Out of a fault only by clear; under control only by engage or park, after that.
        if now.state == State::Fault {
            assert!(now.diagnostic.code.is_fault(), "{now:?}");
            self.cleared = false;
        } else if before.state == State::Fault {
            assert_eq!(request, Some(Request::Clear));
            assert!(!has);
            self.cleared = true;
        }
        if has && !had {
            assert!(self.cleared);
            assert!(matches!(request, Some(Request::Engage | Request::Park)), "{request:?}: {now:?}");
            // Parking begins with a stop.
            assert!(matches!(now.state, State::Engaging | State::Stopping));
        }
        if now.state == State::Active {
            assert!(matches!(before.state, State::Engaging | State::Active));
        }
        // A request is answered in its cycle, and only then.
        let asked = self.rig.asked.map_or_else(Default::default, |asked| asked.message);
        assert_eq!(now.answered_message, asked);
        if request.is_none() {
            assert_eq!(
                (now.answered_message, now.request_diagnostic.code),
                (before.answered_message, before.request_diagnostic.code)
            );
        }
        // A cause where something is in the way, none where nothing is.
        let free = matches!(now.state, State::Engaging | State::Active);
        let just_cleared = now.state == State::Off && before.state == State::Fault;
        assert_eq!(now.diagnostic.code == DiagnosticCode::None, free || just_cleared, "{now:?}");
        // Counters only count, and only under control.
        for (then, now) in [
            (before.missed_measurements, now.missed_measurements),
            (before.missed_setpoints, now.missed_setpoints),
        ] {
            assert!(now == then || now == then + 1 && had);
        }
        assert!(has || !now.active_limits.contains(Limit::Force));
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 250,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(2008),
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_sequence_of_requests_and_faults_breaks_the_rules(stretches in prop::collection::vec(stretch(), 1..40)) {
        let mut watched = Watched::new();
        for stretch in &stretches {
            watched.run(stretch);
        }
        // And from wherever it is, each way of letting go does.
        for request in [Request::Off, Request::Estop] {
            let mut rig = watched.rig.clone();
            rig.ask(request);
            let output = rig.controller.step(&Input { request: rig.asked, ..watched.last });
            prop_assert!(!output.state.has_control() && output.command_n == [0.0; 6]);
        }
    }
}

/// The property would hold of a controller that does nothing: here it goes everywhere.
#[test]
fn the_sequences_reach_every_state() {
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;
    let mut runner =
        TestRunner::new(ProptestConfig { rng_seed: RngSeed::Fixed(2008), ..ProptestConfig::default() });
    let mut reached = [0; 7];
    for _ in 0..40 {
        let stretches = prop::collection::vec(stretch(), 1..40).new_tree(&mut runner).unwrap().current();
        let mut watched = Watched::new();
        stretches.iter().for_each(|stretch| watched.run(stretch));
        for (count, seen) in reached.iter_mut().zip(watched.seen) {
            *count += u32::from(seen);
        }
    }
    assert!(reached.iter().all(|count| *count > 5), "{reached:?}");
}

/// From every state, with every input missing or wrong, and as the very first thing.
#[test]
fn off_and_estop_let_go_within_the_cycle_from_every_state() {
    let home = TaskState::at_rest(CONFIG.machine.home);
    let mut rigs = vec![(State::Off, Rig::new(&CONFIG, &CONFIG.machine))];
    let mut rig = Rig::new(&CONFIG, &CONFIG.machine);
    rig.cycle(&rig.input(&home));
    rigs.push((State::Standby, rig.clone()));
    rig.ask(Request::Engage);
    rig.cycle(&rig.input(&home));
    rigs.push((State::Engaging, rig.clone()));
    rig.engage(&home);
    rigs.push((State::Active, rig.clone()));
    rig.ask(Request::Park);
    rig.cycle(&rig.input(&home));
    rigs.push((State::Stopping, rig.clone()));
    while rig.cycle(&rig.input(&home)).state != State::Parking {}
    rigs.push((State::Parking, rig.clone()));
    rig.ask(Request::Estop);
    rig.cycle(&rig.input(&home));
    rigs.push((State::Fault, rig.clone()));
    let prepared: Vec<_> = rigs.iter().map(|(state, _)| *state).collect();
    assert_eq!(prepared, State::ALL);
    for (state, rig) in &rigs {
        for request in [Request::Off, Request::Estop] {
            for missing in 0..4 {
                let mut rig = rig.clone();
                rig.ask(request);
                let mut input = rig.input(&home);
                if missing & 1 == 1 {
                    input.setpoint = None;
                }
                if missing & 2 == 2 {
                    input.measurement = None;
                }
                let output = rig.controller.step(&input);
                let stays = *state == State::Fault || request == Request::Estop;
                assert_eq!(
                    output.state,
                    if stays { State::Fault } else { State::Off },
                    "{state:?} {request:?}"
                );
                assert_eq!(output.command_n, [0.0; 6]);
                assert_eq!(output.answered_message, rig.asked.unwrap().message);
            }
        }
    }
}
