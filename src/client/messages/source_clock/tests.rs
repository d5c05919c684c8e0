//! Steady clocks of any rate are followed; messages that grow old never are. Not searched: a queue that grows from before the source
//! is followed, or by less than 0.2 % (0.02 % in real time): by stamps and arrivals alone it is a clock.

use super::*;

const MS: i64 = 1_000_000;
const MAX_AGE_MS: i64 = 100;

fn clock(rule: ClockRule) -> SourceClock {
    SourceClock::new(rule, MAX_AGE_MS * MS, true)
}

#[test]
fn jitter_does_not_reach_the_instants() {
    let mut clock = clock(ClockRule::RealTime);
    for k in 0..600 {
        // A stamp every 16 ms, 100 ppm fast, with up to 9 ms of delay.
        let stamp = k * 16 * MS;
        let sent = 7_000 * MS + stamp - stamp / 10_000;
        let instant = clock.instant(stamp, sent + 3 * MS + (k * 7 % 10) * MS).unwrap().time_ns;
        assert!((instant - sent - 3 * MS).abs() < MS || k < 10, "{k}: {} us", (instant - sent) / 1000);
    }
}

/// Five seconds of messages that arrive within `burst` \[ns\], then the stream goes on.
#[test]
fn messages_held_up_are_late_and_reset_no_clock() {
    for burst in [500, 4_000 * MS] {
        let mut clock = SourceClock::new(ClockRule::RealTime, MAX_AGE_MS * MS, false);
        let (mut accepted, mut last_arrival) = (0, 0);
        for k in 0..2_000 {
            let stamp = k * 10 * MS;
            let is_held_up = (500..1_000).contains(&k);
            let arrival = if is_held_up { 10_000 * MS + (k - 500) * burst / 500 } else { stamp + MS };
            if arrival < last_arrival {
                continue;
            }
            last_arrival = arrival;
            if let Ok(SourceInstant { time_ns, .. }) = clock.instant(stamp, arrival) {
                accepted += 1;
                assert!((time_ns - stamp - MS).abs() <= 1, "{k}");
            }
        }
        assert!((1_100..1_520).contains(&accepted), "{accepted}");
    }
}

#[test]
fn a_simulator_that_begins_again_is_followed_again() {
    let mut clock = clock(ClockRule::RealTime);
    let (mut last, step) = (None, 10 * MS);
    for k in 0..1_000 {
        let stamp = if k < 500 { k } else { k - 500 } * step;
        if clock.instant(stamp, k * step).is_err() {
            last = Some(k);
        }
    }
    assert_eq!(last, Some(500 + 199), "for two seconds");
}

#[test]
fn what_contradicts_the_rule_is_named() {
    let reasons = |rule: ClockRule, rate: f64, step_ms: i64| {
        let mut clock = clock(rule);
        let stamp = |k: i64| ((k * 10) as f64 * rate) as i64 / step_ms * step_ms * MS;
        let found = (0..2_000).filter_map(|k| clock.instant(stamp(k), k * 10 * MS).err());
        found.map(|reason| reason.to_string()).collect::<Vec<_>>().join("\n")
    };
    let slow = reasons(ClockRule::RealTime, 0.95, 1);
    assert!(slow.contains("its clock runs at 0.95") && slow.contains("\"any_rate\""), "{slow}");
    assert!(reasons(ClockRule::RealTime, 0.0, 1).contains("setpoint.clock = \"arrival\""));
    assert!(reasons(ClockRule::RealTime, 1.0, 100).lines().all(|line| line.contains("repeats the last one")));
    assert!(reasons(ClockRule::AnyRate, 0.95, 1).lines().all(|line| line.contains("is measured for 2 s")));
    assert_eq!(reasons(ClockRule::Arrival, 0.0, 1), "");
}

/// A source: rate of its clock, jitter, step of its stamps, loss, and a queue before this host.
#[derive(Clone, Copy, Debug)]
struct World {
    rate: f64,
    jitter_ms: f64,
    step_ms: f64,
    loss: f64,
    queue: Queue,
}

/// Messages that wait, from 10 s on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Queue {
    None,
    /// Longer by this share of the time, for ever.
    Grows(f64),
    /// The same for 5 s, then less again.
    Passes(f64),
    /// Nothing arrives for 3 s, then all at once.
    Holds,
}

impl Queue {
    fn delay_s(self, t: f64) -> f64 {
        let since = (t - 10.0).max(0.0);
        match self {
            Self::None => 0.0,
            Self::Grows(share) => share * since,
            Self::Passes(share) => share * since.min(10.0 - since).max(0.0),
            Self::Holds if since > 0.0 => (3.0 - since).max(0.0),
            Self::Holds => 0.0,
        }
    }
}

/// Runs 40 s at 60 Hz. Share of new stamps that are followed in the last 10 s, largest age when followed, largest deviation of an instant
/// after the first 5 s of following \[s\].
fn run(world: World, rule: ClockRule, seed: u64) -> [f64; 3] {
    let World { rate, jitter_ms, step_ms, loss, queue } = world;
    let mut random = hexad_core::model::random::Random::new(seed);
    let mut clock = clock(rule);
    let (mut newest, mut last_stamp, mut followed_since) = (0.0_f64, None, None);
    let (mut counts, mut age, mut deviation) = ([0.0; 2], 0.0_f64, 0.0_f64);
    for k in 0..2400 {
        let t = f64::from(k) / 60.0;
        let arrival = (t + 2e-3 + 1e-3 * jitter_ms * random.uniform() + queue.delay_s(t)).max(newest);
        if random.uniform() < loss {
            continue;
        }
        newest = arrival;
        let time_s = rate * t;
        let stamp_s = if step_ms > 0.0 { (1e3 * time_s / step_ms).floor() * step_ms / 1e3 } else { time_s };
        let stamp = 500_000 * MS + (1e9 * stamp_s) as i64;
        let is_new = last_stamp.replace(stamp) != Some(stamp);
        let found = clock.instant(stamp, (1e9 * arrival) as i64);
        if t > 30.0 && is_new {
            counts[0] += f64::from(u8::from(found.is_ok()));
            counts[1] += 1.0;
        }
        let Ok(SourceInstant { time_ns, rate_ratio: found }) = found else { continue };
        age = age.max(arrival - stamp_s / rate);
        if t - *followed_since.get_or_insert(t) > 5.0 {
            deviation = deviation.max((1e-9 * time_ns as f64 - stamp_s / rate).abs());
        }
        assert!((found / rate - 1.0).abs() < 0.02, "{world:?}: {found}");
    }
    [counts[0] / counts[1], age, deviation]
}

#[test]
fn every_steady_clock_is_followed_and_nothing_that_grows_old() {
    let mut worst = [1.0_f64, 0.0, 0.0];
    for rate in [0.1, 0.3, 0.95, 1.0, 1.05, 3.0, 10.0] {
        for (jitter_ms, step_ms, loss) in [
            (0.0, 0.0, 0.0),
            (9.0, 0.0, 0.1),
            (30.0, 0.0, 0.3),
            (0.0, 100.0, 0.0),
            (9.0, 100.0, 0.1),
            (9.0, 10.0, 0.3),
        ] {
            for queue in [
                Queue::None,
                Queue::Grows(0.05),
                Queue::Grows(0.02),
                Queue::Grows(0.5),
                Queue::Passes(0.05),
                Queue::Passes(0.5),
                Queue::Holds,
            ] {
                let rules = [ClockRule::RealTime, ClockRule::AnyRate];
                // With fewer than ten stamps in a second the daemon misses its source.
                let is_usable = |rule: &ClockRule| {
                    (*rule == ClockRule::AnyRate || rate == 1.0) && step_ms / rate <= 100.0
                };
                for rule in rules.into_iter().filter(is_usable) {
                    let world = World { rate, jitter_ms, step_ms, loss, queue };
                    let [share, age, deviation] = run(world, rule, 1);
                    // A stamp in steps is older than the message by up to one, in the time of the source.
                    let own_age = 2e-3 + 1e-3 * (jitter_ms + step_ms / rate) + 0.03;
                    let what = format!("{world:?} {rule:?}: {share:.3}, {age:.4} s, {deviation:.4} s");
                    if !matches!(queue, Queue::Grows(_)) {
                        assert!(share > 0.97, "{what}");
                        worst[0] = worst[0].min(share);
                    }
                    assert!(age < own_age + 1e-3 * MAX_AGE_MS as f64 + 0.08, "{what}");
                    worst[1] = worst[1].max(age - own_age);
                    if queue == Queue::None {
                        assert!(deviation < own_age, "{what}");
                        worst[2] = worst[2].max(deviation);
                    }
                }
            }
        }
    }
    println!(
        "least share {:.3}, largest age beyond its own {:.3} s, deviation {:.4} s",
        worst[0], worst[1], worst[2]
    );
}
