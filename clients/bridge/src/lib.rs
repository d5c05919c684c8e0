//! What the bridges between a machine and networks have in common.
//!
//! | module | computes |
//! | --- | --- |
//! | [`machine`] | the machine that a bridge connects |
//! | [`rejection`] | reasons to reject a message, and their log |
//! | [`setpoint_relay`] | setpoints of remote sources on the topic of the machine |
//! | [`requests`] | operators' requests from a network |

pub mod machine;
pub mod rejection;
pub mod requests;
pub mod setpoint_relay;
