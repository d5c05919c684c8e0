//! Commit and build profile for `hexad --version`. Works without git: from a tarball the commit is unknown. So it is in the profile of
//! the tests, where each commit would build everything anew.

use std::env::var;
use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output =
        Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned()).filter(|text| !text.is_empty())
}

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let (here, profile) = (var("CARGO_MANIFEST_DIR").ok(), var("PROFILE").unwrap_or_default());
    // A tarball unpacked inside of another repository has no commit of its own.
    let is_own = profile == "release"
        && git(&["rev-parse", "--show-toplevel"])
            .is_some_and(|top| Some(format!("{top}/src/daemon")) == here);
    let commit =
        is_own.then(|| git(&["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"])).flatten();
    // It changes with every commit.
    if let Some(log) = commit.as_ref().and_then(|_| git(&["rev-parse", "--git-path", "logs/HEAD"])) {
        println!("cargo::rerun-if-changed={log}");
    }
    println!("cargo::rustc-env=HEXAD_COMMIT={}", commit.as_deref().unwrap_or("unknown"));
    println!("cargo::rustc-env=HEXAD_PROFILE={profile}");
}
