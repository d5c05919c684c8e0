//! Requests whose answer comes when another thread has written a file: `record`, for which the recorder writes the last seconds to a
//! file that the client passes with the line, and `confirm_legs`.

use std::fs::File;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, channel};

use crate::recorder::WindowOrder;
use crate::snapshot::Snapshot;
use hexad_client::operator::protocol::{AnswerLine, RequestResult};
use hexad_core::control::signals::diagnostic::DiagnosticCode;

/// Name of the request.
pub const RECORD: &str = "record";

/// Length if the request gives none \[s\]: all cycles that the recorder keeps.
const ALL_S: f64 = 1e9;

/// File that another thread writes.
#[derive(Debug)]
pub struct PendingFile {
    /// Name of the request.
    pub request: &'static str,
    /// Text of the answer, or why the file was not written.
    pub written: Receiver<Result<String, String>>,
}

impl PendingFile {
    /// Passes a request for the last seconds to the recorder. The error is a sentence for the client.
    pub fn last_seconds(
        windows: &SyncSender<WindowOrder>,
        file: Option<File>,
        last_s: Option<f64>,
    ) -> Result<Self, String> {
        let file =
            file.ok_or("record needs an open file with its line (SCM_RIGHTS); see docs/operator.md")?;
        // Only regular files: any other may block the recorder for ever.
        if !file.metadata().is_ok_and(|it| it.is_file()) {
            return Err("record needs a regular file".into());
        }
        let (answer, answered) = channel();
        let order = WindowOrder { file, last_s: last_s.unwrap_or(ALL_S), answer };
        windows.try_send(order).map_err(|_| "the recorder has other recordings to write; try again")?;
        Ok(Self { request: RECORD, written: answered })
    }

    /// The answer, once the file is written.
    pub fn answer(&self, snapshot: &Snapshot) -> Option<AnswerLine> {
        let (result, text) = match self.written.try_recv() {
            Ok(Ok(text)) => (RequestResult::Done, text),
            Ok(Err(why)) => (RequestResult::Failed, why),
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => {
                (RequestResult::Failed, DiagnosticCode::DaemonEnding.name().into())
            }
        };
        Some(snapshot.answer(result, self.request, DiagnosticCode::None, text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::sync_channel;

    #[test]
    fn only_a_regular_file_is_written_and_the_answer_is_that_of_the_recorder() {
        let (windows, orders) = sync_channel(1);
        let refused = |file: Option<File>| PendingFile::last_seconds(&windows, file, None).unwrap_err();
        assert!(refused(None).starts_with("record needs an open file"));
        assert_eq!(refused(Some(File::open("/dev/null").unwrap())), "record needs a regular file");
        let file = || Some(tempfile::tempfile().unwrap());
        let ordered = PendingFile::last_seconds(&windows, file(), Some(2.0)).unwrap();
        assert!(refused(file()).starts_with("the recorder has other recordings to write"));
        assert_eq!(ordered.answer(&Snapshot::default()), None);
        let order: WindowOrder = orders.recv().unwrap();
        assert_eq!(order.last_s, 2.0);
        order.answer.send(Ok("7 cycles".into())).unwrap();
        let answer = ordered.answer(&Snapshot::default()).unwrap();
        assert_eq!((answer.result, answer.text.as_str()), (RequestResult::Done, "7 cycles"));
        drop(order);
        assert_eq!(ordered.answer(&Snapshot::default()).unwrap().result, RequestResult::Failed);
    }
}
