//! The exchange between threads as it is, in every order.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use hexad_loom::models;
use loom::model::Builder;

/// Runs a model in all its orders; in those with at most so many preemptions, if that is bounded.
fn holds(model: fn(), preemptions: Option<usize>) {
    let orders = Arc::new(AtomicUsize::new(0));
    let counted = orders.clone();
    let mut builder = Builder::new();
    builder.preemption_bound = preemptions;
    builder.check(move || {
        counted.fetch_add(1, Ordering::Relaxed);
        model();
    });
    let orders = orders.load(Ordering::Relaxed);
    println!("{orders} orders");
    assert!(orders > 100, "{orders} orders: the threads hardly met");
}

#[test]
fn newest_value_arrives() {
    holds(models::newest_value_arrives, None);
}

#[test]
fn no_signal_is_lost() {
    holds(models::no_signal_is_lost, None);
}

#[test]
fn stop_ends_the_wait() {
    holds(models::stop_ends_the_wait, None);
}

#[test]
fn questions_are_answered() {
    holds(models::questions_are_answered, Some(3));
}
