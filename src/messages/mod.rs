//! Messages on the topics `hexad/<name>/...`, and the ports that publish and receive them: all that a driver needs.

pub mod clock;
pub mod lockstep;
pub mod ports;
pub mod statistics;
pub mod structs;
