//! Observations of the platform from the snapshots that the control thread passes on.

use crate::snapshot::Snapshot;
use crate::target_source::Observation;
use hexad_client::realtime::triple_buffer::Reader;

/// Least time between two observations from which a velocity is computed \[ns\]: a cycle of the control thread on a busy host.
const INTERVAL_NS: u64 = 20_000_000;

/// The newest observation and earlier ones.
pub struct SnapshotFeed {
    snapshots: Reader<Snapshot>,
    newest: Observation,
    /// Observations at least an interval apart, the later one first. The earlier one is older than the newest by more than an
    /// interval.
    before: [Option<Observation>; 2],
}

impl SnapshotFeed {
    /// Feed without an observation.
    pub fn new(snapshots: Reader<Snapshot>) -> Self {
        Self { snapshots, newest: Observation::default(), before: [None, None] }
    }

    /// The newest observation, and one that is older by an interval or more.
    pub fn update(&mut self, home: &[f64; 6]) -> (&Observation, Option<&Observation>) {
        let snapshot = self.snapshots.read();
        if snapshot.time_ns > self.newest.time_ns {
            self.newest = Observation::of_snapshot(snapshot, home);
            let [later, earlier] = &mut self.before;
            if later.as_ref().is_none_or(|it| snapshot.time_ns - it.time_ns > INTERVAL_NS) {
                *earlier = later.replace(self.newest.clone());
            }
        }
        let [_, earlier] = &self.before;
        (&self.newest, earlier.as_ref())
    }
}
