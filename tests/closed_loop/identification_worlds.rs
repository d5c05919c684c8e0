//! Identification in worlds that the model lacks: either the stated deviations cover the errors, or the test of the residuals fails and
//! names the cause among its first two.

use hexad::analysis::drive_delay::RecordedStretch;
use hexad::commands::r#move::trajectory::Trajectory;
use hexad::config::Config;
use hexad::control::signals::state::State;
use hexad::model::active_forces::inverse_dynamics;
use hexad::model::fidelity::Exact;
use hexad::model::inverse_geometry::leg_directions;
use hexad::model::machine::Machine;
use hexad::model::random::Random;
use hexad::model::rigid::Motion;
use hexad::model::task::TaskState;
use hexad::model::transmission::Transmission;
use hexad::plant::imperfections::{BuildErrors, DriveErrors, Friction, Imperfections, SensorErrors};
use nalgebra::{Rotation3, Vector3};

use hexad_support::identified::loaded;
use hexad_support::rig::{Rig, SENDING, record};

/// What the model lacks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum World {
    Exact,
    /// Gravity is so many degrees off.
    Gravity(f64),
    /// Joints, standard deviation \[m\].
    Joints(f64),
    /// Play between sensor and leg \[m\].
    Backlash(f64),
    /// Share of the largest force.
    Stiction(f64),
    /// Tilt of the base by the largest moment \[rad\].
    ElasticBase(f64),
    /// Share of the platform's mass that slides by 5 cm as the platform tilts or accelerates.
    LoosePayload(f64),
    /// Largest delay of a force, over the period.
    Jitter(f64),
    /// Relative error of the lengths of one leg.
    SensorScale(f64),
}

/// Plays a motion on a platform in a world.
pub(super) fn played_in(
    world: World,
    config: &Config,
    truth: &Machine,
    motion: &Trajectory,
    seed: u64,
) -> RecordedStretch {
    let mut random = Random::new(seed);
    let (most, mut platform) = (config.machine.actuator.max_force, truth.clone());
    let mut imperfections = Imperfections {
        seed,
        sensor: SensorErrors { length_noise: 2e-6, ..SensorErrors::default() },
        drive: DriveErrors { force_step: 1.0, ..DriveErrors::default() },
        ..Imperfections::default()
    };
    let turn = core::f64::consts::TAU * random.signed();
    match world {
        World::Gravity(degrees) => {
            let axis = Vector3::new(turn.cos(), turn.sin(), 0.0) * degrees.to_radians();
            platform.gravity = Rotation3::new(axis) * platform.gravity;
        }
        World::Joints(joints) => imperfections.build = BuildErrors { joints, ..BuildErrors::default() },
        World::Stiction(share) => {
            imperfections.friction = Friction { stiction: share * most, ..Friction::default() };
        }
        _ => {}
    }
    let (mut rig, mut stretch) = (Rig::imperfect(config, &platform, &imperfections), RecordedStretch::default());
    let (leg, mut played_length) = ((seed % 6) as usize, None::<[f64; 6]>);
    while rig.time_s() < 1.0 + motion.duration() {
        let t = rig.time_s() - 1.0;
        let state = if t < 0.0 { TaskState::at_rest(config.machine.home) } else { motion.at(t) };
        let mut input = rig.waiting_input(&state);
        let length = &mut input.measurement.as_mut().unwrap().length;
        match world {
            World::SensorScale(error) => length[leg] *= 1.0 + error,
            World::Backlash(play) => {
                let half = 0.5 * play;
                let last = played_length.get_or_insert(*length);
                last.iter_mut().zip(&*length).for_each(|(last, now)| *last = last.clamp(now - half, now + half));
                *length = *last;
            }
            World::Jitter(most) => {
                rig.force_delay_ns = (most * random.uniform() * rig.parameters.period_ns as f64) as u64;
            }
            _ => {}
        }
        let output = rig.cycle(&input);
        if t > 0.0 {
            assert_eq!(output.state, State::Active, "{world:?} {t} {:?}", output.diagnostic);
        }
        if output.state == State::Active {
            record(&mut stretch, &input, &output);
        }
    }
    alter(world, truth, &mut stretch);
    stretch
}

/// Adds to the recorded commands what a world needs that the plant does not have.
fn alter(world: World, truth: &Machine, stretch: &mut RecordedStretch) {
    let forces = |machine: &Machine, motion: &Motion| inverse_dynamics::<Exact>(machine, motion).unwrap();
    let commands = |machine: &Machine, motion: &Motion| {
        Transmission::of_motion(machine, motion).commands(&forces(machine, motion))
    };
    let (mut slid, mut machine) = (Vector3::zeros(), truth.clone());
    let bases = truth.joints.triples.unpack_vectors(&truth.joints.base);
    for (sent, measured) in stretch.sent.iter_mut().zip(&stretch.measured) {
        let motion = &measured.reference;
        match world {
            World::ElasticBase(tilt) => {
                let legs = forces(truth, motion).into_iter().zip(leg_directions(truth, &motion.pose));
                let moment: Vector3<f64> = legs.zip(&bases).map(|((f, n), a)| a.cross(&(n * f))).sum();
                let most = truth.actuator.max_force * truth.joints.radius;
                let axis = Vector3::new(moment.x, moment.y, 0.0) * (tilt / most);
                machine.gravity = Rotation3::new(axis) * truth.gravity;
            }
            World::LoosePayload(share) => {
                let mass = share * truth.platform.mass;
                let proper = motion.pose.rotation.transpose()
                    * (motion.acceleration.linear - truth.gravity);
                // It sticks up to a slope of 5 %, and slides slowly to its stop beyond.
                for axis in 0..2 {
                    if proper[axis].abs() > 0.05 * proper.z {
                        slid[axis] -= 2e-4 * proper[axis].signum();
                    }
                }
                slid = slid.map(|x: f64| x.clamp(-0.05, 0.05));
                machine = loaded(&loaded(truth, -mass, Vector3::zeros()), mass, slid);
            }
            _ => return,
        }
        let pairs = commands(&machine, motion).into_iter().zip(commands(truth, motion));
        sent.force.iter_mut().zip(pairs).for_each(|(force, (with, without))| *force += with - without);
    }
}

#[test]
#[ignore = "dump"]
fn dump() {
    use hexad::analysis::drive_delay::drive_delay;
    use hexad::analysis::identification::{Load, Run, identify, samples};
    use hexad_support::edited::configured;
    use hexad_support::identified::drawn;
    use rayon::prelude::*;
    use std::io::Write;
    let mut config = configured("motion_base", "[limits]\npayload_change_kg = inf\n");
    println!("{:?}", config.deployment.plant);
    config.deployment.plant.step_s = 5e-4;
    let file = &config.machine;
    let list = std::env::var("WORLDS").unwrap();
    let folder = std::env::var("DUMP").unwrap();
    let periods: u32 = std::env::var("PERIODS").map_or(6, |x| x.parse().unwrap());
    let cases: Vec<(String, World, f64, u64)> = list
        .split_whitespace()
        .flat_map(|word| {
            let parts: Vec<_> = word.split(':').map(str::to_owned).collect();
            let size: f64 = parts[1].parse().unwrap();
            let world = match parts[0].as_str() {
                "exact" => World::Exact,
                "gravity" => World::Gravity(size),
                "joints" => World::Joints(size),
                "backlash" => World::Backlash(size),
                "stiction" => World::Stiction(size),
                "base" => World::ElasticBase(size),
                "payload" => World::LoosePayload(size),
                "jitter" => World::Jitter(size),
                "scale" => World::SensorScale(size),
                other => panic!("{other}"),
            };
            let amplitude: f64 = parts[2].parse().unwrap();
            let n: u64 = parts[3].parse().unwrap();
            let name = word.replace(':', "_");
            (0..n).map(move |k| (name.clone(), world, amplitude, 1000 + k))
        })
        .collect();
    cases.into_par_iter().for_each(|(name, world, amplitude, seed)| {
        let path = format!("{folder}/{name}_{seed}");
        if std::path::Path::new(&path).exists() {
            return;
        }
        let began = std::time::Instant::now();
        let excitation =
            Trajectory::Excitation(Box::new(Trajectory::excitation(&config, periods, amplitude, 1).unwrap()));
        let truth = drawn(file, &mut Random::new(seed));
        let (mass, at) = (0.15 * file.platform.mass, [0.3, -0.2, 0.8]);
        let with_weight = loaded(&truth, mass, Vector3::from(at));
        let [empty, heavy] =
            [&truth, &with_weight].map(|platform| played_in(world, &config, platform, &excitation, seed));
        let played = began.elapsed();
        let runs = |delay: f64| {
            [
                Run { samples: samples(&empty, delay), load: Load::Empty },
                Run { samples: samples(&heavy, delay), load: Load::Known { mass, at } },
            ]
        };
        let first = identify(file, &runs(SENDING / 1000.0), false).unwrap();
        let mut forces = empty.clone();
        for sent in &mut forces.sent {
            sent.force.iter_mut().zip(first.machine.actuator.force_scale).for_each(|(f, s)| *f *= s);
        }
        let mut delay = drive_delay(&first.machine, &[forces]).unwrap().mean;
        println!("{path} {delay:?}");
        if 2.0 * delay.deviation_s > 5e-4_f64.max(0.1 * delay.delay_s) {
            delay = hexad::analysis::drive_delay::Estimate { delay_s: SENDING / 1000.0, deviation_s: 0.5 * SENDING / 1000.0 };
        }
        let runs = runs(delay.delay_s);
        let a = &truth.actuator;
        let p = &truth.platform;
        let mut numbers = vec![delay.delay_s, delay.deviation_s, p.mass, truth.rod.mass, a.reflected_mass];
        numbers.extend(p.center_of_mass.iter().chain(p.inertia.iter()));
        for values in [a.viscous_friction, a.coulomb_friction, a.load_friction, a.force_scale] {
            numbers.extend(values);
        }
        for run in &runs {
            numbers.push(run.samples.len() as f64);
            for s in &run.samples {
                numbers.push(s.time_s);
                numbers.extend(s.motion.pose.rotation.iter().chain(s.motion.pose.position.iter()));
                numbers.extend(s.motion.twist.vector().iter());
                numbers.extend(s.motion.acceleration.vector().iter());
                numbers.extend(s.command);
            }
        }
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        std::fs::File::create(&path).unwrap().write_all(&bytes).unwrap();
        println!("{path} {played:?} {:?} {delay:?} residual {:?}", began.elapsed(), first.residual);
    });
}
