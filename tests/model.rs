//! The mathematics of the machine and its simulated platform, against independent references.

mod common;

mod batch;
mod excitation;
mod fidelity;
mod identification;
mod ladder;
mod near_singular;
mod paper;
mod plant;
mod properties;
mod stability;
mod workspace;
