//! `hexad move`: a setpoint source, in real time or in lock-step.
//!
//! It starts where the platform stands (the daemon's status says where), moves it gently to the start of
//! the scene, plays the scene and ends at rest. If the daemon gives up control on the way, it starts over
//! from wherever the platform stands then.

use std::path::Path;

use nalgebra::Vector6;
use tracing::{info, warn};

use super::offline::task_state;
use super::operate::Operator;
use super::plant::prepare_thread;
use crate::config::Config;
use crate::control::diagnostic::DiagnosticCode;
use crate::control::input_validation::seconds_between;
use crate::control::limits::{AxisLimits, Limits};
use crate::control::state::{Request, State};
use crate::daemon::nanoseconds;
use crate::messages::lockstep::poll_until;
use crate::output::numbers::percent;
mod precheck;
use self::precheck::{Refusal, Rehearsal};
use crate::analysis::sampled_loop::boundary;
use crate::messages::clock::monotonic_ns;
use crate::messages::{MeasuredMessage, SetpointMessage, StatusMessage};
use crate::messages::{PortError, Publisher, Subscriber};
use crate::model::machine::Machine;
use crate::model::task::TaskState;
use crate::motion::built_in::{BuiltInMotion, FittedMotion, fit};
use crate::motion::minimum_jerk::shortest_duration;
use crate::motion::timeline::Timeline;
use crate::motion::trajectory::{Knot, interpolate};
use crate::output::csv_table::{Complaints, Table, TableError, trajectory_columns};
use crate::realtime::clock::{Grid, sleep_until};
use crate::realtime::stop_request::Stop;

/// Largest X' and X'' at the ends of a trajectory: what counts as at rest, per second.
const REST_RATE: f64 = 1e-3;

/// Least time from one row of a trajectory to the next \[s\], far below the period of any loop. Between
/// rows that are nearer, X'' has no digits.
const LEAST_STEP_S: f64 = 1e-6;

/// Least amplitude of a built-in motion, as a share of its usual one: what is less is not seen to move.
const LEAST_SHARE: f64 = 1e-3;

/// A built-in motion is rehearsed in spans of this length \[s\], in which nothing is missed at 1 kHz.
const SPAN_S: f64 = 0.1;

/// And in so many at most: of a day every 43 ms is looked at, in which the fastest sine changes by a hundredth.
const MOST_SPANS: f64 = 20_000.0;

/// What the approach uses of each limit: what angles that turn at once add to each other is within the rest.
const APPROACH_SHARE: f64 = 0.5;

/// A daemon that has not said for this long that it is in control is not: the approach starts over \[ns\].
const GIVEN_UP_NS: u64 = 200_000_000;

/// Why no setpoints could be produced.
#[derive(Debug, thiserror::Error)]
pub enum SetpointError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error(transparent)]
    Table(#[from] TableError),
    #[error("{name} of {seconds} s would be refused even with {share} of its usual amplitude: {refusal}", name = .motion.name(), share = percent(LEAST_SHARE))]
    TooSmall { motion: BuiltInMotion, seconds: f64, refusal: Refusal },
}

/// What to play.
#[derive(Clone, Debug)]
pub enum Score {
    FittedMotion(FittedMotion),
    Trajectory(Vec<Knot>),
}

impl Score {
    /// A built-in motion, as large as the machine can carry and the daemon accepts.
    pub fn motion(config: &Config, motion: BuiltInMotion, seconds: f64) -> Result<Self, SetpointError> {
        let rehearsal = Rehearsal::new(config).with_reserve();
        let largest = fit(&config.machine, motion, seconds);
        let spans = (seconds / SPAN_S).ceil().clamp(1.0, MOST_SPANS) as u32;
        let refusal = |scene: &FittedMotion| rehearsal.first_refusal(|t| scene.at(t), seconds, spans);
        let Some(too_large) = refusal(&largest) else { return Ok(Self::FittedMotion(largest)) };
        let least = largest.smaller(LEAST_SHARE / largest.angle_share);
        if let Some(refusal) = refusal(&least) {
            return Err(SetpointError::TooSmall { motion, seconds, refusal });
        }
        let share = boundary(1.0, |share| refusal(&largest.smaller(share)).is_none());
        info!(
            "{} with {} of the amplitude that the drives carry: with more, at {too_large}",
            motion.name(),
            percent(share)
        );
        Ok(Self::FittedMotion(largest.smaller(share)))
    }

    /// A trajectory from a CSV file. It must begin and end at rest, with times that increase, and be what the
    /// daemon accepts.
    pub fn trajectory(config: &Config, path: &Path) -> Result<Self, SetpointError> {
        let table = Table::read(path, &trajectory_columns(), &[])?;
        let score = Self::from_rows(&table, path)?;
        score.rehearsed(config, &table, path)?;
        Ok(score)
    }

    /// Complains of each row on the way to which the daemon would refuse a setpoint.
    fn rehearsed(&self, config: &Config, table: &Table, path: &Path) -> Result<(), TableError> {
        let rehearsal = Rehearsal::new(config);
        let times = table.rows().iter().filter_map(|row| row.first());
        let first = times.clone().next().copied().unwrap_or_default();
        let mut complaints = Complaints::about(path);
        // What comes before the first row is the first row.
        let befores = times.clone().take(1).chain(times.clone());
        for ((before, now), line) in befores.zip(times).zip(table.lines()) {
            if let Some(refusal) = rehearsal.refusal(|t| self.at(t - first), [*before, *now]) {
                complaints.add(format!("line {line}: on the way to it, at {refusal}"));
            }
        }
        complaints.verdict()
    }

    /// A trajectory from a table with its columns; messages call it `path`.
    pub fn from_rows(table: &Table, path: &Path) -> Result<Self, SetpointError> {
        let mut complaints = Complaints::about(path);
        let knot =
            |row: &Vec<f64>| Knot { t: row.first().copied().unwrap_or_default(), state: task_state(row) };
        let knots: Vec<_> = table.rows().iter().map(knot).collect();
        let places = || knots.iter().zip(table.lines());
        for ((before, _), (after, line)) in places().zip(places().skip(1)) {
            if !(after.t - before.t >= LEAST_STEP_S) {
                complaints.add(format!(
                    "line {line}: t = {:?} after t = {:?}: must increase, by at least {LEAST_STEP_S:?}",
                    after.t, before.t
                ));
            }
        }
        for (end, place) in [("first", places().next()), ("last", places().next_back())] {
            let Some((Knot { state, .. }, line)) = place else { continue };
            for (what, largest) in [("rate", state.xd.amax()), ("acceleration", state.xdd.amax())] {
                if largest > REST_RATE {
                    complaints.add(format!(
                        "line {line}: {end} row: {what} {largest:?}: must be at rest, at most {REST_RATE:?}"
                    ));
                }
            }
        }
        complaints.verdict()?;
        Ok(Self::Trajectory(knots))
    }

    /// Seconds it takes.
    pub fn duration(&self) -> f64 {
        match self {
            Self::FittedMotion(scene) => scene.duration,
            Self::Trajectory(knots) => knots.last().map_or(0.0, |b| b.t) - knots.first().map_or(0.0, |a| a.t),
        }
    }

    /// X, X', X'' at `t`, within the duration.
    pub fn at(&self, t: f64) -> TaskState {
        match self {
            Self::FittedMotion(scene) => scene.at(t),
            Self::Trajectory(knots) => {
                interpolate(knots, knots.first().map_or(0.0, |first| first.t) + t).unwrap_or_default()
            }
        }
    }
}

/// Plays the score once, or until `stop`. With `engage` it also asks for control, once.
pub fn run(config: &Config, score: &Score, engage: bool, stop: &Stop) -> Result<(), SetpointError> {
    let bus = config.join()?;
    let setpoints = bus.publisher()?;
    let player = Player::new(config, score, Operator::new(&bus)?, engage);
    info!(name = %config.name, seconds = score.duration(), "waiting for the daemon to know where the platform is");
    match bus.is_simulated() {
        false => run_in_real_time(config, player, setpoints, stop)?,
        true => run_in_lockstep(bus.subscriber(8)?, player, setpoints, stop)?,
    }
    Ok(())
}

fn run_in_real_time(
    config: &Config,
    mut player: Player,
    mut setpoints: Publisher<SetpointMessage>,
    stop: &Stop,
) -> Result<(), PortError> {
    prepare_thread(config);
    let grid = Grid::new(nanoseconds(config.deployment.realtime.period_s()), 0);
    let mut tick_ns = grid.next_after(monotonic_ns());
    while !stop.is_requested() {
        sleep_until(tick_ns);
        match player.cue(tick_ns)? {
            Cue::Silent => {}
            Cue::Play(state) => setpoints.publish(tick_ns, (&state).into())?,
            Cue::Finished => break,
        }
        tick_ns = grid.next_after(tick_ns.max(monotonic_ns()));
    }
    Ok(())
}

/// Each measurement is answered, as everybody waits for it; what has no answer yet, with home.
fn run_in_lockstep(
    mut measured: Subscriber<MeasuredMessage>,
    mut player: Player,
    mut setpoints: Publisher<SetpointMessage>,
    stop: &Stop,
) -> Result<(), PortError> {
    let mut answered = None;
    while let Some(asked) = poll_until(|| stop.is_requested(), || measured.receive()) {
        let time_ns = asked.header.time_ns;
        let answer = match answered {
            Some((same_ns, answer)) if same_ns == time_ns => answer,
            _ => match player.cue(time_ns)? {
                Cue::Silent => (&TaskState::at_rest(player.machine.home)).into(),
                Cue::Play(state) => (&state).into(),
                Cue::Finished => break,
            },
        };
        setpoints.publish(time_ns, answer)?;
        answered = Some((time_ns, answer));
    }
    Ok(())
}

/// What to do at a tick.
enum Cue {
    Silent,
    Play(TaskState),
    Finished,
}

/// Where in the score we are.
struct Player<'a> {
    machine: &'a Machine,
    limits: &'a Limits,
    score: &'a Score,
    operator: Operator,
    /// Asks for control, until it was given.
    engage: bool,
    /// The way to the score from where the platform stands, or stood when the daemon took control.
    timeline: Option<Timeline>,
    /// Since when the daemon is in control \[ns\].
    engaged_ns: Option<u64>,
    /// When the daemon last said that it is in control \[ns\].
    last_active_ns: u64,
}

impl<'a> Player<'a> {
    fn new(config: &'a Config, score: &'a Score, operator: Operator, engage: bool) -> Self {
        let Config { machine, deployment, .. } = config;
        let limits = &deployment.limits.reference;
        Self { machine, limits, score, operator, engage, timeline: None, engaged_ns: None, last_active_ns: 0 }
    }

    fn cue(&mut self, now_ns: u64) -> Result<Cue, PortError> {
        if let Some(status) = self.operator.status() {
            self.listen(now_ns, &status);
            if self.engage && status.diagnostic.code == DiagnosticCode::ReadyToEngage as u32 {
                self.operator.send(Request::Engage)?;
            }
        }
        if self.engaged_ns.is_some() && now_ns.saturating_sub(self.last_active_ns) > GIVEN_UP_NS {
            warn!("the daemon gave up control or is gone: starting over from where the platform stands");
            (self.engaged_ns, self.timeline) = (None, None);
        }
        let Some(timeline) = &self.timeline else { return Ok(Cue::Silent) };
        // Until the daemon takes it, offer the pose at which the platform stands.
        let t = self.engaged_ns.map_or(0.0, |engaged_ns| seconds_between(engaged_ns, now_ns));
        Ok(if t > timeline.end() { Cue::Finished } else { Cue::Play(timeline.at(t, |t| self.score.at(t))) })
    }

    fn listen(&mut self, now_ns: u64, status: &StatusMessage) {
        let state = State::from_number(status.state).unwrap_or_default();
        // An operator who takes control away keeps it.
        self.engage &= !state.has_control();
        if state == State::Active && self.timeline.is_some() {
            self.last_active_ns = now_ns;
            if self.engaged_ns.is_none() {
                info!("the daemon is in control: moving");
                self.engaged_ns = Some(now_ns);
            }
        } else if !state.has_control() {
            // It says so itself: no need to wait.
            self.last_active_ns = 0;
            if self.engaged_ns.is_none() && status.pose_valid == 1 {
                let (from, to) = (Vector6::from(status.x), self.score.at(0.0).x);
                let timeline = Timeline::new(self.machine, &from, &to, self.score.duration());
                self.timeline = Some(timeline.with_shortest_approach(gentle_s(self.limits, &from, &to)));
            }
        }
        // While it engages, what was offered must stand. A platform that moves on somebody else's setpoints
        // is offered nothing.
    }
}

/// Time \[s\] of an approach that keeps the limits, in any direction.
fn gentle_s(limits: &Limits, from: &Vector6<f64>, to: &Vector6<f64>) -> f64 {
    let way = to - from;
    // No angle turns the platform further than by itself.
    let angle = way.fixed_rows::<3>(0).abs().sum();
    let shortest = |way: f64, limits: &AxisLimits| {
        let AxisLimits { velocity, acceleration, jerk } = limits.scaled(APPROACH_SHARE);
        shortest_duration(way, [velocity, acceleration, jerk])
    };
    shortest(angle, &limits.orientation).max(shortest(way.fixed_rows::<3>(3).norm(), &limits.position))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row at rest with these t and x.
    fn row(t: &str, x: &str) -> String {
        format!("{t},0,0,0,{x},0,0{}\n", ",0".repeat(12))
    }

    /// From far and turned, under limits of which each binds once; a quarter of the time would not do.
    #[test]
    fn the_approach_keeps_the_limits() {
        let text = include_str!("../../../config/fried2008.toml");
        for tight in
            ["velocity_m_s = 0.02", "acceleration_m_s2 = 0.02", "jerk_m_s3 = 0.05", "jerk_rad_s3 = 0.1"]
        {
            let config = Config::parse(&format!("{text}\n[limits]\n{tight}\n"), "a test").unwrap();
            let home = Vector6::from(config.machine.home);
            let from = home + Vector6::new(0.08, -0.1, 0.09, 0.06, 0.05, -0.04);
            let rehearsal = Rehearsal::new(&config);
            let refused = |share: f64| {
                let gentle_s = share * gentle_s(&config.deployment.limits.reference, &from, &home);
                let timeline =
                    Timeline::new(&config.machine, &from, &home, 1.0).with_shortest_approach(gentle_s);
                let at = |t| timeline.at(t, |_| TaskState::at_rest(config.machine.home));
                rehearsal.first_refusal(at, timeline.motion_start(), 500)
            };
            assert!(refused(1.0).is_none(), "{tight}: {:?}", refused(1.0));
            assert!(refused(0.25).is_some(), "{tight}");
        }
    }

    fn read(rows: &[String]) -> Result<Score, SetpointError> {
        let text = trajectory_columns().join(",") + "\n" + &rows.concat();
        let path = Path::new("x.csv");
        let table = Table::from_reader(text.as_bytes(), path, &trajectory_columns(), &[]).unwrap();
        Score::from_rows(&table, path)
    }

    #[test]
    fn rows_that_are_too_near_are_refused_each_with_its_line() {
        let rows = [row("0", "1"), row("1e-300", "2"), row("0.5", "2"), row("0.5", "1")];
        assert_eq!(
            read(&rows).unwrap_err().to_string(),
            "x.csv: line 3: t = 1e-300 after t = 0.0: must increase, by at least 1e-6\n\
             x.csv: line 5: t = 0.5 after t = 0.5: must increase, by at least 1e-6"
        );
    }

    #[test]
    fn a_refusal_of_many_rows_is_short() {
        let message = read(&vec![row("0", "1"); 1000]).unwrap_err().to_string();
        assert_eq!(message.lines().count(), 21);
        assert!(message.ends_with("\nx.csv: and 979 more"), "{message}");
    }

    #[test]
    fn the_largest_numbers_still_make_setpoints() {
        let score = read(&[row("-1e12", "1e12"), row("0", "-1e12"), row("1e-6", "1e12")]).unwrap();
        for t in [0.0, 0.5e12, 1e12, score.duration()] {
            assert!(score.at(t).is_finite(), "{t}");
        }
    }
}
