//! Names of processes, and sentences about them.

use std::fs;

use hexad_core::control::signals::diagnostic::{Comparison, Diagnostic};

/// Command and state of a process; `None` if it has ended.
fn command_and_state(process_id: u32) -> Option<(String, char)> {
    let stat = fs::read_to_string(format!("/proc/{process_id}/stat")).ok()?;
    let (before, state) = stat.rsplit_once(") ")?;
    let (_, command) = before.split_once('(')?;
    // A process that has ended is listed until its parent has waited for it.
    Some((command.to_owned(), state.chars().next()?)).filter(|(_, state)| *state != 'Z')
}

/// Command of a process; empty if it has ended.
pub fn command(process_id: u32) -> String {
    command_and_state(process_id).map(|(command, _)| command).unwrap_or_default()
}

/// Whether a process lives and runs no more, by SIGSTOP or a debugger. It obeys neither SIGINT nor SIGTERM.
pub fn is_stopped(process_id: u32) -> bool {
    command_and_state(process_id).is_some_and(|(_, state)| matches!(state, 'T' | 't'))
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
        command if is_stopped(process_id) => format!(
            "process {process_id} ({command}, stopped by SIGSTOP or a debugger: only kill -KILL {process_id} ends it)"
        ),
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
    fn a_stopped_process_is_named_as_one() {
        let mut child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let pid = nix::unistd::Pid::from_raw(child.id().cast_signed());
        assert!(!is_stopped(child.id()));
        nix::sys::signal::kill(pid, nix::sys::signal::Signal::SIGSTOP).unwrap();
        let began = std::time::Instant::now();
        while !named(child.id()).contains("stopped by SIGSTOP") {
            assert!(began.elapsed().as_secs() < 60, "{}", named(child.id()));
            std::thread::yield_now();
        }
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(!is_stopped(child.id()) && named(child.id()).ends_with("(ended)"));
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
