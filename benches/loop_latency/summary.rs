//! What is printed at the end: the tables, and what they say to the goals.

use super::contest::{Contestant, Round};
use super::distribution::{Distribution, us};
use super::results::{LATE_NS, Row, find, ratio};
use super::rig::Release;
use super::{Measured, size};

/// The goals. p99 of the wake-up latency of `sleep` over cyclictest's.
const SLEEP_OVER_CYCLICTEST: f64 = 1.15;
/// p99 of the wake-up latency of `hybrid` \[us\].
const HYBRID_P99_US: f64 = 5.0;
/// From wake-up to force visible with `hybrid`, medians \[us\].
const VISIBLE_US: f64 = 3.0;
/// Median of `Controller::step` \[us\].
const STEP_US: f64 = 1.0;
/// At this rate no more misses than cyclictest \[Hz\].
const FASTEST_HZ: u32 = 20_000;

pub fn print(measured: &Measured) {
    let Measured { rows, sizes, steps, calls } = measured;
    print_wakeups(rows);
    print_seen(rows);
    let (p50, p99) = (us(steps.quantile(0.5)), us(steps.quantile(0.99)));
    if steps.count() > 0 {
        println!("\nController::step, one after the other [us]: p50 {p50:.2}, p99 {p99:.2}");
    }
    if !calls.is_empty() {
        let calls: Vec<_> = calls.iter().map(|(name, count)| format!("{count} {name}")).collect();
        println!("system calls of the real-time thread in a second at 1 kHz: {}", calls.join(", "));
    }
    size::print(sizes);
    print_goals(rows);
    if steps.count() > 0 {
        println!("  {} Controller::step: p50 {p50:.2} us", verdict(p50 <= STEP_US));
    }
}

fn print_wakeups(rows: &[Row]) {
    println!(
        "\nwake-up latency [us]; late: beyond {} us or half a period; lost: beyond a period",
        us(LATE_NS)
    );
    println!(
        "{:>6} {:<10}{:<14}{:>8}{:>8}{:>9}{:>9}{:>10}{:>8}{:>7}{:>6}{:>9}",
        "Hz", "load", "", "p50", "p99", "p99.9", "p99.99", "max", "ratio", "late", "lost", "cycles"
    );
    for row in rows.iter().filter(|row| !row.seen) {
        let wakeup = row.pooled(|round| &round.wakeup);
        let quantile = |q| row.quantile_us(|round| &round.wakeup, q).unwrap_or(f64::NAN);
        println!(
            "{:>6} {:<10}{:<14}{:>8.2}{:>8.2}{:>9.2}{:>9.1}{:>10.1}{:>8}{:>7}{:>6}{:>9}",
            row.rate_hz,
            row.load(),
            row.contestant.name(),
            quantile(0.5),
            quantile(0.99),
            quantile(0.999),
            us(wakeup.quantile(0.9999)),
            us(wakeup.max()),
            ratio(row, rows).map_or(String::new(), |ratio| format!("{ratio:.2}")),
            row.late(),
            row.lost(),
            wakeup.count(),
        );
    }
}

fn print_seen(rows: &[Row]) {
    println!("\nrelease to force visible in a polling subscriber, medians [us]");
    for row in rows.iter().filter(|row| row.seen) {
        println!(
            "{:>6} {:<14}wake-up {:.2}, compute {:.2}, sent {:.2}, visible {:.2}",
            row.rate_hz,
            row.contestant.name(),
            p50_us(row, |round| &round.wakeup),
            p50_us(row, |round| &round.compute),
            p50_us(row, |round| &round.end_to_end),
            p50_us(row, |round| &round.visible),
        );
    }
}

fn p50_us(row: &Row, pick: fn(&Round) -> &Distribution) -> f64 {
    row.quantile_us(pick, 0.5).unwrap_or(f64::NAN)
}

fn print_goals(rows: &[Row]) {
    println!("\ngoals");
    let of =
        |release| rows.iter().filter(move |row| row.contestant == Contestant::Hexad(release) && !row.seen);
    for row in of(Release::Sleep) {
        let Some(theirs) = find(rows, row.rate_hz, row.loaded, Contestant::Cyclictest) else { continue };
        let ratio = row.p99_us() / theirs.p99_us();
        let best_ratio = row.best_p99_us() / theirs.best_p99_us();
        let what = format!("p99 {ratio:.2} x cyclictest's, in the best rounds {best_ratio:.2} x");
        say(ratio <= SLEEP_OVER_CYCLICTEST, row, &what);
    }
    for row in of(Release::Hybrid) {
        let what = format!("p99 {:.2} us, in the best round {:.2}", row.p99_us(), row.best_p99_us());
        say(row.p99_us() <= HYBRID_P99_US, row, &what);
    }
    for row in of(Release::Sleep).chain(of(Release::Hybrid)).filter(|row| row.rate_hz == FASTEST_HZ) {
        let Some(theirs) = find(rows, row.rate_hz, row.loaded, Contestant::Cyclictest) else { continue };
        let holds = row.late() <= theirs.late() && row.lost() <= theirs.lost();
        let counts = [row.late(), row.lost(), theirs.late(), theirs.lost()];
        let [late, lost, their_late, their_lost] = counts;
        say(holds, row, &format!("{late} late, {lost} lost; cyclictest {their_late} and {their_lost}"));
    }
    for row in rows.iter().filter(|row| row.seen && row.contestant == Contestant::Hexad(Release::Hybrid)) {
        let after_us = p50_us(row, |round| &round.visible) - p50_us(row, |round| &round.wakeup);
        say(after_us <= VISIBLE_US, row, &format!("visible {after_us:.2} us after wake-up"));
    }
}

fn say(holds: bool, row: &Row, what: &str) {
    println!("  {} {:>5} Hz, {}, {}: {what}", verdict(holds), row.rate_hz, row.load(), row.contestant.name());
}

fn verdict(holds: bool) -> &'static str {
    if holds { "holds " } else { "missed" }
}
