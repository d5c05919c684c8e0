//! Driver of hexad for CiA 402 drives on EtherCAT, and a simulated segment of them.
//!
//! | module | computes |
//! | --- | --- |
//! | [`cia402`], [`objects`], [`units`] | states and words of a drive, its objects, counts and lengths, torques and forces; they know no bus |
//! | [`drives_file`], [`file_edit`], [`machine_check`] | the file of the drives, changes of it, contradictions to the machine file |
//! | [`segment`], [`simulation`] | six simulated drives with the simulated platform that they move, as a file describes them |
//! | [`link`], [`raw_socket`], [`simulated_link`], [`timer`] | Ethernet frames and their clock: real, or simulated |
//! | [`bus`], [`al_state`], [`sdo`], [`inventory`], [`scan`], [`startup`] | main device, objects of drives, what is on the bus, the way to OP |
//! | [`sync_clock`], [`process_image`], [`process_data`], [`leg_drive`] | grid of SYNC0, bytes of the process data, their exchange, one drive in it |
//! | [`permission`], [`cycle`], [`topics`] | whether forces may be applied, the cycle with the daemon |
//! | [`jog`], [`brake_test`] | motion of one leg, load on one closed brake |

pub mod al_state;
pub mod brake_test;
pub mod bus;
pub mod cia402;
pub mod cycle;
pub mod drives_file;
pub mod file_edit;
pub mod identity;
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
