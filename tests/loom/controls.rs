//! Flawed exchanges between threads: loom must find each flaw.

use hexad_loom::flaw::{self, Flaw};
use hexad_loom::models;

fn check(flaw: Flaw, model: fn()) {
    flaw::set(flaw);
    loom::model(model);
}

#[test]
#[should_panic(expected = "Causality violation")]
fn swap_without_release() {
    check(Flaw::SwapWithoutRelease, models::newest_value_arrives);
}

#[test]
#[should_panic(expected = "Causality violation")]
fn swap_without_acquire() {
    check(Flaw::SwapWithoutAcquire, models::newest_value_arrives);
}

#[test]
#[should_panic(expected = "deadlock")]
fn signal_without_release() {
    check(Flaw::SignalWithoutRelease, models::no_signal_is_lost);
}

#[test]
#[should_panic(expected = "deadlock")]
fn wait_without_acquire() {
    check(Flaw::WaitWithoutAcquire, models::no_signal_is_lost);
}

#[test]
#[should_panic(expected = "deadlock")]
fn sleep_without_comparison() {
    check(Flaw::SleepWithoutComparison, models::no_signal_is_lost);
}

#[test]
#[should_panic(expected = "deadlock")]
fn no_wake_up() {
    check(Flaw::NoWakeUp, models::no_signal_is_lost);
}
