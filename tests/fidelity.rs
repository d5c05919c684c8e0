//! How much of the model a scene needs: judged, chosen, advised.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing, reason = "helpers of tests")]

mod advise;
mod dense;
mod envelope;
mod scenes;

use hexad::analysis::reachable_envelope;

use crate::*;
