//! What a genome means.

use std::sync::Arc;

use hexad::config::Config;
use hexad::control::parameters::{Envelope, Parameters, ViolationPolicy};
use hexad::control::signals::state::Request;
use hexad::model::machine::Machine;
use hexad::plant::imperfections::{BuildErrors, DriveErrors, Friction, Imperfections, SensorErrors};

use super::genome::{Genome, Reader, World};
use super::machines::{AUTONOMOUS, LIMIT_FACTORS, RATES_HZ, STRONGER, Variant};
use super::messages::Messages;
use super::stream::Stream;
use crate::rig::{self, Rates};

/// Longest run, in seconds and in cycles.
const LONGEST_S: f64 = 2.0;
const MOST_CYCLES: f64 = 4000.0;
/// Longest time from the release to the force: of reading, computing and sending \[s\], and as a ratio of the period.
const LONGEST_FORCE_DELAY_S: f64 = 150e-6;
const LONGEST_FORCE_DELAY_RATIO: f64 = 0.4;
/// cos(beta) of a home below which its envelope has no angles.
const LEAST_COS_BETA: f64 = 0.5;
/// Requests of a run besides those that bring the platform back under control.
const REQUESTS: usize = 5;

/// One run.
#[derive(Clone, Debug)]
pub struct Scenario {
    pub config: Arc<Config>,
    pub parameters: Parameters,
    pub duration_s: f64,
    /// From the measurement to the release.
    pub phase_ns: u64,
    /// From the release to the force.
    pub force_delay_ns: u64,
    /// The source before and after it is replaced.
    pub streams: [Stream; 2],
    /// When the second source replaces the first \[s\].
    pub replaced_s: f64,
    /// Whether the second source begins where the first was.
    pub is_continued: bool,
    pub start: Start,
    pub messages: Messages,
    /// Requests at instants \[s\].
    pub requests: [(f64, Request); REQUESTS],
    /// Time without control after which the next request is sent that brings it back \[s\].
    pub retry_s: f64,
    /// Whether control is taken back with `park`.
    pub parks: bool,
    /// Deceleration by the brakes, if not the default \[m/s^2\].
    pub brakes_m_s2: Option<f64>,
    /// When the sensors freeze \[s\].
    pub frozen_s: Option<f64>,
    /// What the machine file does not state.
    pub imperfections: Option<Imperfections>,
}

/// Where the setpoint is as control begins.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Whether the setpoint moves already; else it leaves the platform's pose in the time below.
    pub is_moving: bool,
    pub fade_s: f64,
}

impl Scenario {
    pub fn of(genome: &Genome) -> Self {
        Self::read(genome, &mut Reader::new(genome))
    }

    /// The same with the genes that a reader gives.
    pub fn read(genome: &Genome, genes: &mut Reader<'_>) -> Self {
        let variant = Variant {
            machine: genome.machine,
            rate: genes.index("rate", RATES_HZ.len()),
            limits: genes.index("limits", LIMIT_FACTORS.len()),
            autonomous: genes.index("autonomous", AUTONOMOUS.len()),
        };
        let config = super::machines::variant(variant);
        let mut parameters = rig::parameters(&config);
        parameters.on_violation = genome.policy;
        parameters.envelope = genes.part("envelope", |genes| envelope(genes, &config));
        let period_s = parameters.period_ns as f64 * 1e-9;
        let duration_s = LONGEST_S.min(MOST_CYCLES * period_s);
        let phase = genes.choice("phase", &[0.0, 0.0, 0.5]);
        let delay_s = genes
            .sometimes("force_delay", 0.6, 0.0, LONGEST_FORCE_DELAY_S)
            .min(LONGEST_FORCE_DELAY_RATIO * period_s);
        let streams = ["stream", "other_stream"]
            .map(|name| genes.part(name, |genes| Stream::read(genes, &config.machine, &parameters)));
        let replaced_s = duration_s * genes.within("replaced_at", 2.2, 0.2);
        let is_continued = genes.choice("is_continued", &[true, true, false]);
        let start = Start {
            is_moving: genes.choice("start_is_moving", &[true, false, false]),
            fade_s: genes.choice("start_fade", &[0.0, 0.4, 1.2, 1.5, 2.0])
                * streams[0].approach_s(&config.machine, &parameters),
        };
        let is_limited = genome.policy == ViolationPolicy::Limit;
        let messages =
            genes.part("messages", |genes| Messages::read(genes, is_limited, [duration_s, period_s]));
        let request = |genes: &mut Reader<'_>| {
            // Most runs have one or none.
            let at_s = duration_s * genes.within("at", 6.0, 0.1);
            (at_s, genes.choice("word", &Request::ALL))
        };
        let requests = core::array::from_fn(|number| genes.part(&format!("request_{}", number + 1), request));
        Self {
            retry_s: genes.logarithmic("retry", 0.001, 0.1),
            imperfections: (genome.world == World::Unmodelled)
                .then(|| genes.part("platform", |genes| imperfections(genes, &config.machine, period_s))),
            parks: genes.choice("parks", &[false, false, false, true]),
            frozen_s: genome.is_frozen().then(|| duration_s * genes.within("frozen_at", 0.2, 0.9)),
            config,
            parameters,
            duration_s,
            phase_ns: (phase * period_s * 1e9) as u64,
            force_delay_ns: (delay_s * 1e9) as u64,
            streams,
            replaced_s,
            is_continued,
            start,
            messages,
            requests,
            // What brakes have left of a motion is what lengths alone do not tell.
            brakes_m_s2: (genome.sensors.rates() != Rates::Always)
                .then(|| genes.logarithmic("brakes", 1.0, 50.0)),
        }
    }
}

/// Friction and stiction of up to 1 % and 0.2 % of the largest force, half a period of dead time, a tenth more or less mass, noise
/// and steps of the sensors of micrometres.
fn imperfections(genes: &mut Reader<'_>, machine: &Machine, period_s: f64) -> Imperfections {
    let (most, mass) = (machine.actuator.max_force_n / STRONGER, machine.platform.mass_kg);
    Imperfections {
        seed: 1,
        drive: DriveErrors {
            dead_time_ns: (genes.sometimes("dead_time", 0.5, 0.0, 0.5) * period_s * 1e9) as u64,
            ..DriveErrors::default()
        },
        friction: Friction {
            coulomb_n: genes.sometimes("friction", 0.3, 0.0, 0.01) * most,
            stiction_n: genes.sometimes("stiction", 0.5, 0.0, 0.002) * most,
            ..Friction::default()
        },
        sensor: SensorErrors {
            length_noise_m: genes.sometimes("noise", 0.5, 0.0, 2e-6),
            length_step_m: genes.sometimes("step", 0.5, 0.0, 1e-6),
            ..SensorErrors::default()
        },
        build: BuildErrors {
            payload_kg: genes.sometimes("payload", 0.5, -0.1, 0.1) * mass,
            payload_at_m: machine.platform.center_of_mass_m,
            ..BuildErrors::default()
        },
        ..Imperfections::default()
    }
}

/// None in most runs; else a box around home.
fn envelope(genes: &mut Reader<'_>, config: &Config) -> Option<Envelope> {
    let is_given = genes.choice("is_given", &[false, false, true]);
    let stroke = config.machine.actuator.stroke().min(1.0);
    let sizes = ["angles", "distances"].map(|name| genes.logarithmic(name, 0.01, 0.8));
    // Bryan angles are no measure near beta = +-90 deg: there an envelope bounds the position alone.
    let angle = if config.machine.home[1].cos() < LEAST_COS_BETA { 4.0 } else { sizes[0] };
    let half = |axis: usize| if axis < 3 { angle } else { sizes[1] * stroke };
    is_given.then(|| Envelope {
        lowest: core::array::from_fn(|axis| config.machine.home[axis] - half(axis)),
        highest: core::array::from_fn(|axis| config.machine.home[axis] + half(axis)),
    })
}
