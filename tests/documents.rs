//! README and documents: short enough, and what they link to is there.

#![allow(clippy::unwrap_used, clippy::indexing_slicing, reason = "a test helper that fails is a failed test")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

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

/// Files that the package installs under the folder of its documents, each with its source.
fn packaged() -> BTreeMap<PathBuf, PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest: toml::Table = fs::read_to_string(root.join("Cargo.toml")).unwrap().parse().unwrap();
    let assets = manifest["package"]["metadata"]["deb"]["assets"].as_array().unwrap();
    let mut installed = BTreeMap::new();
    for asset in assets {
        let [source, target] = [0, 1].map(|k| Path::new(asset[k].as_str().unwrap()));
        let Ok(folder) = target.strip_prefix("usr/share/doc/hexad") else { continue };
        let pattern = source.file_name().unwrap().to_str().unwrap();
        let (begin, end) = pattern.split_once('*').unwrap_or((pattern, ""));
        let found =
            fs::read_dir(root.join(source.parent().unwrap())).unwrap().map(|entry| entry.unwrap().path());
        let is_one = |path: &PathBuf| {
            let name = path.file_name().unwrap().to_str().unwrap();
            let fits = if pattern.contains('*') {
                name.starts_with(begin) && name.ends_with(end)
            } else {
                name == pattern
            };
            fits && path.is_file()
        };
        let files: Vec<_> = found.filter(is_one).collect();
        assert!(!files.is_empty(), "{} is no file", source.display());
        installed.extend(files.into_iter().map(|path| (folder.join(path.file_name().unwrap()), path)));
    }
    installed
}

/// A path without `..`.
fn resolved(path: &Path) -> PathBuf {
    path.components().fold(PathBuf::new(), |mut resolved, part| {
        match part {
            Component::ParentDir => assert!(resolved.pop(), "{} leaves the folder", path.display()),
            _ => resolved.push(part),
        }
        resolved
    })
}

#[test]
fn links_of_the_packaged_documents_lead_to_packaged_files() {
    let installed = packaged();
    let (mut seen, mut missing) = (0, vec![]);
    for (place, source) in &installed {
        if place.extension().is_none_or(|extension| extension != "md") {
            continue;
        }
        let text = fs::read_to_string(source).unwrap();
        for (_, target) in mentioned(&text).into_iter().filter(|(is_link, _)| *is_link) {
            seen += 1;
            let file = target.split('#').next().unwrap();
            if !file.is_empty() && !installed.contains_key(&resolved(&place.parent().unwrap().join(file))) {
                missing.push(format!("{}: {target}", place.display()));
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
