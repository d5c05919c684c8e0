//! The guide for machine builders: its doctor takes the processors from all others.

use crate::guides::{BUILDER, type_commands};
use crate::support::machine::Machine;

#[test]
#[apply(alone)]
fn a_machine_builder_examines_machine_and_host() {
    type_commands(&Machine::with("builder", ""), BUILDER);
}
