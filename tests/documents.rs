//! README and documents: short enough, and what they link to is there.

#![allow(clippy::unwrap_used, reason = "a test helper that fails is a failed test")]

use std::fs;
use std::path::{Path, PathBuf};

/// A README is read in two minutes.
const MAX_README_LINES: usize = 120;

fn documents() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let in_folder = |folder: PathBuf| {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>()
    };
    let is_document = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "md");
    [in_folder(root.into()), in_folder(root.join("docs"))].concat().into_iter().filter(is_document).collect()
}

/// Targets of links, and paths in backquotes that begin with a folder of the repository.
fn mentioned(text: &str) -> Vec<(bool, &str)> {
    let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let links = links.filter(|target| !target.contains("://")).map(|target| (true, target));
    let quoted = text.split('`').skip(1).step_by(2);
    let folders = ["src/", "tests/", "benches/", "config/", "deploy/", "examples/", "docs/"];
    let is_path = |quoted: &&str| {
        folders.iter().any(|folder| quoted.starts_with(folder)) && !quoted.contains([' ', '*', '<', '\n'])
    };
    links.chain(quoted.filter(is_path).map(|path| (false, path))).collect()
}

#[test]
fn what_the_documents_mention_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut seen, mut missing) = (0, vec![]);
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        for (is_link, target) in mentioned(&text) {
            seen += 1;
            let base = if is_link { document.parent().unwrap() } else { root };
            if !base.join(target.split('#').next().unwrap()).exists() {
                missing.push(format!("{}: {target}", document.display()));
            }
        }
    }
    assert!(seen > 60, "only {seen} seen: the check looks in the wrong place");
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

#[test]
fn the_readme_is_short() {
    let lines =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap().lines().count();
    assert!(lines <= MAX_README_LINES, "{lines} lines");
}
