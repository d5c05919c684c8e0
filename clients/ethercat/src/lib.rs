//! Driver of hexad for CiA 402 drives on EtherCAT, and a simulated segment of them.
//!
//! | module | computes |
//! | --- | --- |
//! | [`cia402`], [`objects`], [`units`] | states and words of a drive, its objects, counts and lengths, torques and forces; they know no bus |
//! | [`segment`] | six simulated drives, and the simulated platform that they move |
//! | [`link`], [`simulated_link`], [`timer`] | Ethernet frames and their clock: real, or simulated |

pub mod bus;
pub mod cia402;
pub mod cycle;
pub mod drives_file;
pub mod file_edit;
pub mod inventory;
pub mod jog;
pub mod leg_drive;
pub mod link;
pub mod machine_check;
pub mod objects;
pub mod permission;
pub mod process_data;
pub mod process_image;
pub mod raw_socket;
pub mod scan;
pub mod sdo;
pub mod segment;
pub mod simulated_link;
pub mod simulation;
pub mod startup;
pub mod sync_clock;
pub mod timer;
pub mod topics;
pub mod units;
