//! Stub.
use crate::model::rigid::{Motion, Pose};
/// Stub.
#[derive(Clone, Copy, Debug, Default)]
pub struct PoseSamples;
impl PoseSamples {
    /// Stub.
    pub fn push(&mut self, _: u64, _: &Pose) {}
    /// Stub.
    pub fn target(&self, _: u64) -> Option<Motion> {
        None
    }
    /// Stub.
    pub fn clear(&mut self) {}
}
