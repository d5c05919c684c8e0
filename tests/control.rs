//! The controller: alone, in closed loop with the simulated platform, against searches for its worst. Time is simulated.

mod adversary;
mod closed_loop;
mod cycles;
mod faults;
mod motions;
mod reference;
mod states;
