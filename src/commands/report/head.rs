//! Head of a page as JSON: everything except the samples.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::Serialize;

use super::history::{Bars, History};
use super::levels::Extent;
use super::list::{Row, rows};
use super::run::Run;
use super::signals::{COLUMNS, SIGNALS};
use super::summary::{Fact, facts};
use super::track::Track;
use hexad_core::control::signals::state::State;
use hexad_core::model::LEGS;
use hexad_machine::config::Config;
use hexad_machine::config::coordinates::Coordinates;
use hexad_machine::text::numbers::MotionDigits;

/// Head of a page.
#[derive(Serialize)]
struct Head<'a> {
    name: &'a str,
    is_live: bool,
    /// Unix time of the first cycle \[s\]; 0 if the page is live.
    begin_s: f64,
    period_s: f64,
    length_s: f64,
    /// First column of each signal.
    columns: BTreeMap<&'static str, usize>,
    column_count: usize,
    levels: Vec<LevelHead>,
    /// Description of the samples.
    kept: &'a str,
    states: [&'static str; 7],
    /// Text of what angles and positions describe; empty for the platform in the base frame.
    coordinates: &'a str,
    machine: MachineHead,
    configuration: &'a str,
    #[serde(flatten)]
    run: Events<'a>,
}

/// Facts, intervals and distributions of a run.
#[derive(Serialize, Default)]
pub struct Events<'a> {
    is_unfinished: bool,
    facts: Vec<Fact>,
    tracks: Vec<&'a Track>,
    rows: Vec<Row>,
    distributions: Vec<Bars>,
}

impl<'a> Events<'a> {
    /// Events of a run.
    pub fn new(run: &Run, history: &'a History) -> Self {
        Self {
            is_unfinished: history.is_unfinished,
            facts: facts(run),
            tracks: history.tracks(),
            rows: rows(history),
            distributions: history.distributions(),
        }
    }
}

/// Head of a level: instants \[s\], and where its samples begin.
#[derive(Serialize)]
pub struct LevelHead {
    /// First instant.
    pub from: f64,
    /// Distance of the samples.
    pub step: f64,
    /// Number of samples.
    pub samples: u64,
}

/// The machine as the page draws it: joints on the base in the work frame, joints on the platform in the tool frame.
#[derive(Serialize)]
struct MachineHead {
    base: [[f64; 3]; LEGS],
    platform: [[f64; 3]; LEGS],
    home: [f64; 6],
    gravity: [f64; 3],
    /// Digits after the point of metres.
    m_digits: usize,
    /// Digits after the point of degrees.
    deg_digits: usize,
}

/// Head of a page about a recording.
pub fn of_recording(run: &Run, extents: &[Extent], kept: &str) -> String {
    let (config, history) = (run.config(), &run.history);
    let period_s = config.deployment.realtime.period_s();
    let level = |extent: &Extent| LevelHead {
        from: extent.first as f64 * period_s,
        step: extent.step as f64 * period_s,
        samples: extent.samples,
    };
    let (events, configuration) = (Events::new(run, history), run.configurations());
    let levels = extents.iter().map(level).collect();
    json(&Head {
        begin_s: run.begin_s(),
        length_s: history.length_s(),
        levels,
        kept,
        configuration: &configuration,
        ..head(config, &Coordinates::default(), events)
    })
}

/// Head of a page with data from a server, in these coordinates.
pub fn of_live(config: &Config, coordinates: &Coordinates) -> String {
    json(&Head { is_live: true, ..head(config, coordinates, Events::default()) })
}

fn head<'a>(config: &'a Config, coordinates: &'a Coordinates, run: Events<'a>) -> Head<'a> {
    let begins = SIGNALS.iter().scan(0, |next, (name, components)| {
        let first = *next;
        *next += components;
        Some((*name, first))
    });
    Head {
        name: &config.name,
        is_live: false,
        begin_s: 0.0,
        period_s: config.deployment.realtime.period_s(),
        length_s: 0.0,
        columns: begins.collect(),
        column_count: COLUMNS,
        levels: vec![],
        kept: "",
        states: State::ALL.map(State::name),
        coordinates: &coordinates.label,
        machine: machine(config, coordinates),
        configuration: &config.text,
        run,
    }
}

fn machine(config: &Config, coordinates: &Coordinates) -> MachineHead {
    let machine = &config.machine;
    let (joints, frames) = (&machine.joints, coordinates.frames());
    let [base, platform] =
        [(&joints.base, &frames.work), (&joints.platform, &frames.tool)].map(|(lanes, frame)| {
            let in_frame = |joint: Vector3<f64>| frame.rotation.tr_mul(&(joint - frame.position)).into();
            joints.triples.unpack_vectors(lanes).map(in_frame)
        });
    let MotionDigits { mm, deg } = MotionDigits::new(config.resolution());
    let gravity = frames.work.rotation.tr_mul(&machine.gravity_m_s2).into();
    let home = coordinates.tool_x(&machine.home);
    MachineHead { base, platform, home, gravity, m_digits: mm + 3, deg_digits: deg }
}

/// Text as JSON. Numbers without a value are null.
pub fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use hexad_core::model::inverse_geometry::leg_lengths;
    use hexad_core::model::task::TaskState;
    use hexad_core::motion::rotation_order::RotationOrder;

    /// A machine with home 1.1 m along x, and coordinates of a tool 0.35 m from it in a work frame that is turned.
    pub fn framed() -> (Config, Coordinates) {
        let machine = include_str!("../../../config/fried2008.toml");
        let frames = "[[frame]]\nname = 'vertex'\nkind = 'tool'\npose = [0, 0, 0, 0.35, 0, 0]\n\
                      [[frame]]\nname = 'optics'\nkind = 'work'\npose = [0, 0, 1.5707963267948966, 1, 0, 0]\n";
        let config = Config::parse(&format!("{machine}\n{frames}"), "a test").unwrap();
        let names = [Some("vertex"), Some("optics")];
        let found = config.frames_named(names[0], names[1]).unwrap();
        let coordinates = Coordinates::new(&config, Some(found), names, RotationOrder::Xyz);
        (config, coordinates)
    }

    #[test]
    fn a_machine_in_other_frames_has_the_same_legs() {
        let (config, coordinates) = framed();
        let lengths = leg_lengths(&config.machine, &config.machine.home_pose());
        for coordinates in [coordinates, Coordinates::default()] {
            let MachineHead { base, platform, home, .. } = machine(&config, &coordinates);
            let home = TaskState::at_rest(home).motion().pose;
            for ((base, platform), length) in base.iter().zip(platform).zip(lengths) {
                let leg = home.position + home.rotation * Vector3::from(platform) - Vector3::from(*base);
                assert!((leg.norm() - length).abs() < 1e-12, "{} {length}", leg.norm());
            }
        }
    }
}
