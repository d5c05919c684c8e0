//! Names of processes, and sentences about them.

use std::fs;

use hexad_core::control::signals::diagnostic::{Comparison, Diagnostic};

/// Command of a process; empty if it has ended.
pub fn command(process_id: u32) -> String {
    let stat = fs::read_to_string(format!("/proc/{process_id}/stat")).unwrap_or_default();
    let command = || {
        let (before, state) = stat.rsplit_once(") ")?;
        let (_, command) = before.split_once('(')?;
        // A process that has ended is listed until its parent has waited for it.
        (!state.starts_with('Z')).then(|| command.into())
    };
    command().unwrap_or_default()
}

/// Sentence of a diagnostic, with processes named by command and number.
pub fn sentence(diagnostic: &Diagnostic) -> String {
    let Diagnostic { code, value, bound, .. } = diagnostic;
    if code.comparison() != Comparison::Processes || *bound == 0.0 {
        return diagnostic.to_string();
    }
    let [used, ignored] = [value, bound].map(|number| named(*number as u32));
    format!("{}: {used} is used, {ignored} is ignored; {}", code.name(), code.remedy())
}

/// Number and command of a process.
pub fn named(process_id: u32) -> String {
    match command(process_id).as_str() {
        "" => format!("process {process_id} (ended)"),
        command => format!("process {process_id} ({command})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_core::control::signals::diagnostic::DiagnosticCode;

    #[test]
    fn a_process_that_was_not_waited_for_has_ended() {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let began = std::time::Instant::now();
        while !command(child.id()).is_empty() {
            assert!(began.elapsed().as_secs() < 60, "{}", named(child.id()));
            std::thread::yield_now();
        }
        assert!(fs::exists(format!("/proc/{}/stat", child.id())).unwrap(), "it is listed");
        child.wait().unwrap();
    }

    #[test]
    fn a_sentence_about_two_processes_names_both() {
        let this = std::process::id();
        let name = command(this);
        assert!(!name.is_empty());
        let two = Diagnostic::new(DiagnosticCode::TwoMeasuredSources, this.into(), f64::from(u32::MAX));
        let expected = format!(
            "two sources of measurements: process {this} ({name}) is used, process {} (ended) is ignored; end one of them",
            u32::MAX
        );
        assert_eq!(sentence(&two), expected);
        assert!(
            two.to_string().contains(&format!(": process {this} is used, process {} is ignored", u32::MAX))
        );
        let other = Diagnostic::new(DiagnosticCode::SetpointTooFar, 2.0, 1.0);
        assert_eq!(sentence(&other), other.to_string());
    }
}
