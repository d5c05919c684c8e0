//! What the bridges between a machine and networks have in common.
//!
//! | module | computes |
//! | --- | --- |
//! | [`rejection`] | reasons to reject a message, and their log |
//! | [`setpoint_relay`] | setpoints of remote sources on the topic of the machine |
//! | [`requests`] | operators' requests from a network |

pub mod rejection;
pub mod requests;
pub mod setpoint_relay;
