//! The wall between the real-time part and the rest, checked on the source.
//!
//! The compiler does most of it: the crate's root is `no_std`, so a file that does not say
//! `extern crate std` cannot name `Vec`, `println!` or a file. What it cannot see is who uses whom.

#![allow(clippy::unwrap_used, reason = "a test helper that fails is a failed test")]

use std::fs;
use std::path::{Path, PathBuf};

/// Folder, what else of the crate it may use, whether it may use the standard library.
const ARROWS: &[(&str, &[&str], bool)] = &[
    ("model", &[], false),
    ("control", &["model"], false),
    ("plant", &["model"], false),
    ("scene", &["model"], false),
    (
        "ipc",
        &[
            "model",
            "control",
            "realtime::clock",
            "realtime::cyclic::Counters",
            "realtime::event",
            "realtime::triple_buffer",
        ],
        true,
    ),
    ("realtime", &["model", "control", "ipc::exchange"], true),
    ("host", &["model", "control", "plant", "scene", "ipc", "realtime"], true),
];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

/// Paths `crate::...` outside comments, braces not expanded.
fn crate_paths(line: &str) -> impl Iterator<Item = &str> {
    let code = line.split("//").next().unwrap_or_default();
    code.split("crate::").skip(1).filter(move |_| !code.contains("pub(crate::"))
}

#[test]
fn every_folder_uses_only_what_it_may() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = vec![];
    let mut seen = 0;
    for (folder, allowed, _) in ARROWS {
        for file in sources(&source.join(folder)) {
            for (number, line) in fs::read_to_string(&file).unwrap().lines().enumerate() {
                for path in crate_paths(line) {
                    seen += 1;
                    let ok = path.starts_with(folder) || allowed.iter().any(|arrow| path.starts_with(arrow));
                    if !ok {
                        wrong.push(format!("{}:{}: crate::{path}", file.display(), number + 1));
                    }
                }
            }
        }
    }
    assert!(seen > 50, "only {seen} paths seen: the check looks in the wrong place");
    assert!(wrong.is_empty(), "these reach through the wall:\n{}", wrong.join("\n"));
}

#[test]
fn the_pure_folders_have_no_standard_library_and_no_unsafe() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    assert!(fs::read_to_string(source.join("lib.rs")).unwrap().lines().any(|line| line == "#![no_std]"));
    for (folder, _, std_allowed) in ARROWS {
        let files = sources(&source.join(folder));
        assert!(!files.is_empty(), "{folder} is gone");
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            for word in ["extern crate std", "extern crate alloc"] {
                assert!(*std_allowed || !text.contains(word), "{}: {word}", file.display());
            }
            // In ipc only the derive of iceoryx2 is unsafe, and that is its own.
            let may = *folder == "realtime";
            assert!(may || !text.contains("unsafe {"), "{}: unsafe", file.display());
        }
    }
}

#[test]
fn every_folder_is_judged() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for entry in fs::read_dir(source).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_string();
        let judged = ARROWS.iter().any(|(folder, ..)| *folder == name);
        assert!(judged || ["lib.rs", "main.rs"].contains(&name.as_str()), "{name} is not in the table");
    }
}
