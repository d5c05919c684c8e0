//! Between processes and between threads: message structs, iceoryx2 ports, triple buffers.

pub mod exchange;
pub mod messages;
pub mod ports;
pub mod statistics;
