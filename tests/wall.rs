//! The arrows between the folders of `src`, and what the real-time folders may use, checked on the source.
//!
//! The syntax tree is searched, not the text: a grouped import, a path in an expression and one in a macro's
//! arguments all count.

#![allow(clippy::unwrap_used, reason = "a test helper that fails is a failed test")]

use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{ExprUnsafe, ItemUse, Macro, UseTree, VisRestricted};

/// The folders, from the one that uses nothing, each with its place in `src`. A folder uses folders above it and no other.
/// Cargo holds the arrows between the crates; here are those between the folders of one, and what a folder may not use besides.
const FOLDERS: [(&str, &str); 15] = [
    ("model", "core/model"),
    ("control", "core/control"),
    ("motion", "core/motion"),
    ("plant", "core/plant"),
    ("messages", "client/messages"),
    ("operator", "client/operator"),
    ("realtime", "client/realtime"),
    ("log", "machine/log"),
    ("text", "machine/text"),
    ("analysis", "machine/analysis"),
    ("config", "machine/config"),
    ("recording", "daemon/recording"),
    ("daemon", "daemon"),
    ("output", "output"),
    ("commands", "commands"),
];

/// Folders without the standard library.
const NO_STD: [&str; 4] = ["model", "control", "motion", "plant"];

/// Folders of the list above that a folder may nevertheless not use, and why.
const FORBIDDEN: &[(&str, &[&str], &str)] = &[
    ("control", &["motion", "plant"], "neither exists on a real machine"),
    ("motion", &["control"], "a motion is the same under any control"),
    ("plant", &["control", "motion"], "it stands in for hardware, which knows neither"),
    ("messages", &["motion", "plant"], "a driver needs none of them"),
    ("operator", &["model", "motion", "plant"], "a request needs none of them"),
    ("realtime", &["model", "control", "motion", "plant", "operator"], "the loop is generic"),
    (
        "text",
        &["model", "control", "motion", "plant", "messages", "operator", "realtime"],
        "it writes what it is given",
    ),
    (
        "output",
        &[
            "model", "control", "motion", "plant", "messages", "operator", "realtime", "analysis", "config",
            "daemon",
        ],
        "it draws what it is given",
    ),
];

/// Folders in which `unsafe` may stand, each block with its argument.
const UNSAFE: [&str; 3] = ["messages", "operator", "realtime"];

mod import_cycles;
mod units;

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Files of a folder of the list.
fn files_of((name, place): (&str, &str)) -> Vec<PathBuf> {
    let inner = source().join("daemon/recording");
    files(&source().join(place))
        .into_iter()
        .filter(|file| name != "daemon" || !file.starts_with(&inner))
        .collect()
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

/// What a file names: each path, as far as its third segment.
#[derive(Default)]
struct Uses {
    paths: Vec<Vec<String>>,
    unsafe_blocks: usize,
}

impl Uses {
    fn of(text: &str) -> Self {
        let mut uses = Self::default();
        uses.visit_file(&syn::parse_file(text).unwrap());
        uses
    }

    /// The folders that a file of the folder `own` names.
    fn folders(&self, own: &str) -> impl Iterator<Item = &str> {
        let is_daemon = ["daemon", "recording"].contains(&own);
        self.paths.iter().filter_map(move |path| match path.as_slice() {
            [root, module, ..] if root == "hexad_daemon" || is_daemon && root == "crate" => {
                Some(if module == "recording" { "recording" } else { "daemon" })
            }
            [root, folder, ..] if root == "crate" || root.starts_with("hexad_") => Some(folder.as_str()),
            _ => None,
        })
    }

    fn add_tree(&mut self, mut path: Vec<String>, tree: &UseTree) {
        match tree {
            UseTree::Path(step) => {
                path.push(step.ident.to_string());
                self.add_tree(path, &step.tree);
            }
            UseTree::Group(group) => group.items.iter().for_each(|item| self.add_tree(path.clone(), item)),
            UseTree::Name(name) => {
                path.push(name.ident.to_string());
                self.paths.push(path);
            }
            UseTree::Rename(rename) => {
                path.push(rename.ident.to_string());
                self.paths.push(path);
            }
            UseTree::Glob(_) => self.paths.push(path),
        }
    }

    /// Paths in the arguments of a macro, which no syntax tree shows.
    fn add_tokens(&mut self, tokens: TokenStream) {
        let mut path = vec![];
        for token in tokens {
            match token {
                TokenTree::Ident(ident) => path.push(ident.to_string()),
                TokenTree::Punct(punct) if punct.as_char() == ':' => {}
                TokenTree::Group(group) => {
                    self.paths.push(core::mem::take(&mut path));
                    self.add_tokens(group.stream());
                }
                _ => self.paths.push(core::mem::take(&mut path)),
            }
        }
        self.paths.push(path);
    }
}

impl<'ast> Visit<'ast> for Uses {
    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        self.add_tree(vec![], &item.tree);
    }

    fn visit_vis_restricted(&mut self, _: &'ast VisRestricted) {
        // Who may see an item is no use of anything.
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.paths.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'ast Macro) {
        self.add_tokens(item.tokens.clone());
    }

    fn visit_expr_unsafe(&mut self, block: &'ast ExprUnsafe) {
        self.unsafe_blocks += 1;
        visit::visit_expr_unsafe(self, block);
    }
}

/// No file of tests is left out: each is a target of Cargo or a module of one.
#[test]
fn every_file_of_tests_is_run() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let is_target = |name: &str| manifest.contains(&format!("[[test]]\nname = \"{name}\"\n"));
    let files: Vec<_> =
        fs::read_dir(root.join("tests")).unwrap().map(|entry| entry.unwrap().path()).collect();
    let files = files.iter().filter(|path| path.extension().is_some_and(|extension| extension == "rs"));
    let names: Vec<_> = files.map(|path| path.file_stem().unwrap().to_str().unwrap()).collect();
    let targets: String = names
        .iter()
        .filter(|name| is_target(name))
        .map(|name| fs::read_to_string(root.join("tests").join(name).with_extension("rs")).unwrap())
        .collect();
    let left_out: Vec<_> = names
        .iter()
        .filter(|name| !is_target(name) && !targets.contains(&format!("\nmod {name};\n")))
        .collect();
    assert!(names.len() > 20 && left_out.is_empty(), "{left_out:?} of {}", names.len());
}

#[test]
fn every_folder_uses_only_folders_above_it() {
    let mut wrong = vec![];
    let mut seen = 0;
    for (place, folder) in FOLDERS.into_iter().enumerate() {
        let forbidden = FORBIDDEN.iter().find(|(name, ..)| *name == folder.0);
        for file in files_of(folder) {
            for used in Uses::of(&fs::read_to_string(&file).unwrap()).folders(folder.0) {
                seen += 1;
                // Tests may read machine files: nothing of them is in the product.
                let stands_above = FOLDERS[..=place].iter().any(|(name, _)| *name == used)
                    || used == "config" && file.ends_with("tests.rs");
                let why = forbidden.filter(|(_, names, _)| names.contains(&used)).map_or("", |(.., why)| why);
                if !stands_above || !why.is_empty() {
                    wrong.push(format!("{} uses {used}: {why}", file.display()));
                }
            }
        }
    }
    assert!(seen > 500, "only {seen} paths seen: the check looks in the wrong place");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_pure_folders_name_no_standard_library_and_unsafe_stands_where_it_may() {
    for folder in FOLDERS {
        for file in files_of(folder) {
            let folder = folder.0;
            let uses = Uses::of(&fs::read_to_string(&file).unwrap());
            let names_std = |path: &Vec<String>| {
                ["std", "alloc"].iter().any(|name| path.first().is_some_and(|first| first == name))
            };
            let is_pure = NO_STD.contains(&folder);
            assert!(!(is_pure && uses.paths.iter().any(names_std)), "{}: std", file.display());
            assert!(UNSAFE.contains(&folder) || uses.unsafe_blocks == 0, "{}: unsafe", file.display());
        }
    }
}

#[test]
fn every_folder_has_its_place() {
    let crates = ["core", "client", "machine", "daemon"];
    for place in ["core", "client", "machine", "."] {
        for entry in fs::read_dir(source().join(place)).unwrap().map(Result::unwrap) {
            let name = entry.file_name().into_string().unwrap();
            let is_known =
                FOLDERS.iter().any(|(_, known)| source().join(known) == source().join(place).join(&name));
            let is_crate = place == "." && crates.contains(&name.as_str());
            assert!(is_known || is_crate || !entry.path().is_dir(), "{name} in {place}");
        }
    }
}

/// The check sees what it is for.
#[test]
fn every_form_of_a_path_is_seen() {
    for text in [
        "use crate::{model::machine::Machine, daemon::run};",
        "use crate::{self as root, daemon as d};",
        "fn f() { crate::daemon::run() }",
        "fn f() { println!(\"{}\", crate::daemon::NAME) }",
        "fn f(_: Vec<crate::daemon::Report>) {}",
        "fn f() { assert!([1].iter().any(|_| matches!(x, crate::daemon::A))) }",
    ] {
        assert!(Uses::of(text).folders("model").any(|folder| folder == "daemon"), "{text}");
    }
}
