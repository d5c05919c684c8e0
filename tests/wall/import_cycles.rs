//! Files of `src` that import each other in a circle.
//!
//! A `mod.rs` and its own children may; nothing else of the folders without the standard library, and of the others only
//! the circles of the list below. A name that a module re-exports counts as a use of the file that it comes from.

#![allow(clippy::indexing_slicing, reason = "a test helper that fails is a failed test")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use syn::{Item, ItemMod, MetaList, UseTree, Visibility};

use super::{FOLDERS, NO_STD, Uses, files_of, source};

/// Numbers of files in the circles of each folder, the largest first. They may only become smaller.
const CIRCLES: &[(&str, &[usize])] = &[
    ("messages", &[4, 2]),
    ("realtime", &[2]),
    ("config", &[2, 2]),
    ("daemon", &[4]),
    ("commands", &[2, 2]),
];

type Path = Vec<String>;

/// What stands in a file, without its tests.
struct Module {
    uses: Vec<Path>,
    /// Names that it re-exports, and from where.
    exports: BTreeMap<String, Path>,
}

impl Module {
    fn of(text: &str, place: &Path) -> Self {
        let mut syntax = syn::parse_file(text).unwrap();
        syntax.items.retain(|item| !is_for_tests(item));
        let children: BTreeSet<_> = syntax.items.iter().filter_map(child).collect();
        let mut uses = Uses::default();
        syn::visit::visit_file(&mut uses, &syntax);
        let mut exports = BTreeMap::new();
        for item in &syntax.items {
            if let Item::Use(item) = item
                && !matches!(item.vis, Visibility::Inherited)
            {
                add_exports(&mut exports, vec![], &item.tree);
            }
        }
        let absolute = |path: &Path| absolute(path, place, &children);
        let exports = exports.into_iter().filter_map(|(name, path)| Some((name, absolute(&path)?))).collect();
        Self { uses: uses.paths.iter().filter_map(absolute).collect(), exports }
    }
}

fn is_for_tests(item: &Item) -> bool {
    let attributes = match item {
        Item::Mod(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        _ => return false,
    };
    let of_tests = |list: &MetaList| list.path.is_ident("cfg") && list.tokens.to_string() == "test";
    attributes.iter().any(|attribute| attribute.meta.require_list().is_ok_and(of_tests))
}

fn child(item: &Item) -> Option<String> {
    match item {
        Item::Mod(ItemMod { ident, content: None, .. }) => Some(ident.to_string()),
        _ => None,
    }
}

fn add_exports(exports: &mut BTreeMap<String, Path>, mut path: Path, tree: &UseTree) {
    match tree {
        UseTree::Path(step) => {
            path.push(step.ident.to_string());
            add_exports(exports, path, &step.tree);
        }
        UseTree::Group(group) => group.items.iter().for_each(|it| add_exports(exports, path.clone(), it)),
        UseTree::Name(name) => {
            path.push(name.ident.to_string());
            exports.insert(name.ident.to_string(), path);
        }
        UseTree::Rename(rename) => {
            path.push(rename.ident.to_string());
            exports.insert(rename.rename.to_string(), path);
        }
        UseTree::Glob(_) => {}
    }
}

/// A path from the folder on; none for one of a crate of others. The root of the crate of the daemon is its folder.
fn absolute(path: &Path, place: &Path, children: &BTreeSet<String>) -> Option<Path> {
    let first = path.first()?;
    let ups = path.iter().take_while(|segment| *segment == "super").count();
    let daemon = ["daemon".to_owned()];
    let (from, rest) = match first.as_str() {
        "hexad_daemon" => (&daemon[..], &path[1..]),
        "crate" if place.first() == daemon.first() => (&daemon[..], &path[1..]),
        "crate" | "hexad_core" | "hexad_client" | "hexad_machine" => (&place[..0], &path[1..]),
        "self" => (&place[..], &path[1..]),
        "super" => (&place[..place.len().checked_sub(ups)?], &path[ups..]),
        name if children.contains(name) => (&place[..], &path[..]),
        _ => return None,
    };
    Some(from.iter().chain(rest).filter(|segment| *segment != "self").cloned().collect())
}

/// The modules of the crate, by their paths.
fn modules() -> BTreeMap<Path, Module> {
    let mut found = BTreeMap::new();
    for file in FOLDERS.into_iter().flat_map(files_of) {
        let place = file.strip_prefix(source()).unwrap().with_extension("");
        let mut place: Path = place.iter().map(|segment| segment.to_str().unwrap().to_owned()).collect();
        if ["core", "client", "machine"].contains(&place[0].as_str()) {
            place.remove(0);
        }
        if place.contains(&"tests".to_owned()) || place.last().is_some_and(|name| name == "build") {
            continue;
        }
        if place.last().is_some_and(|name| name == "mod" || name == "lib") {
            place.pop();
        }
        let module = Module::of(&fs::read_to_string(&file).unwrap(), &place);
        found.insert(place, module);
    }
    found
}

/// The module in which the thing that a path names is defined.
fn definition(modules: &BTreeMap<Path, Module>, path: &Path) -> Option<Path> {
    let length = (1..=path.len()).rev().find(|length| modules.contains_key(&path[..*length]))?;
    let module = &path[..length];
    let exported = path.get(length).and_then(|name| modules[module].exports.get(name));
    match exported {
        Some(export) => definition(modules, &export.iter().chain(&path[length + 1..]).cloned().collect()),
        None => Some(module.to_vec()),
    }
}

/// For each module those that it needs, but for the children of a module.
fn arrows(modules: &BTreeMap<Path, Module>) -> BTreeMap<Path, BTreeSet<Path>> {
    let needs = |(place, module): (&Path, &Module)| {
        let needed = module.uses.iter().filter_map(|path| definition(modules, path));
        let is_child = |other: &Path| other.split_last().is_some_and(|(_, parent)| parent == place);
        (place.clone(), needed.filter(|other| other != place && !is_child(other)).collect())
    };
    modules.iter().map(needs).collect()
}

fn reached<'a>(arrows: &'a BTreeMap<Path, BTreeSet<Path>>, from: &'a Path) -> BTreeSet<&'a Path> {
    let (mut found, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(place) = open.pop() {
        open.extend(arrows[place].iter().filter(|other| found.insert(*other)));
    }
    found
}

/// Sets of modules of which each reaches each other.
fn circles(arrows: &BTreeMap<Path, BTreeSet<Path>>) -> BTreeSet<BTreeSet<&Path>> {
    let reached: BTreeMap<_, _> = arrows.keys().map(|place| (place, reached(arrows, place))).collect();
    let circle = |place: &&Path| {
        reached[*place].iter().filter(|other| reached[**other].contains(*place)).copied().collect()
    };
    arrows.keys().map(|place| circle(&place)).filter(|circle: &BTreeSet<_>| !circle.is_empty()).collect()
}

#[test]
fn files_import_each_other_in_no_circle() {
    let modules = modules();
    let arrows = arrows(&modules);
    assert!(arrows.values().map(BTreeSet::len).sum::<usize>() > 800, "the check looks in the wrong place");
    let circles = circles(&arrows);
    let mut wrong = vec![];
    for (folder, _) in FOLDERS {
        let mut here: Vec<_> =
            circles.iter().filter(|circle| circle.iter().any(|it| it[0] == folder)).collect();
        here.sort_by_key(|circle| std::cmp::Reverse(circle.len()));
        let sizes: Vec<_> = here.iter().map(|circle| circle.len()).collect();
        let known = CIRCLES.iter().find(|(name, _)| *name == folder).map_or(&[][..], |(_, sizes)| sizes);
        assert!(known.is_empty() || !NO_STD.contains(&folder), "{folder} may have none");
        if sizes != known {
            let names = |circle: &&BTreeSet<&Path>| {
                circle.iter().map(|place| place.join("::")).collect::<Vec<_>>().join(" ")
            };
            let names: Vec<_> = here.iter().map(names).collect();
            wrong
                .push(format!("{folder}: circles of {sizes:?}, not of {known:?}:\n  {}", names.join("\n  ")));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The check sees what it is for.
#[test]
fn circles_through_other_names_are_seen() {
    let circle_of = |texts: &[(&str, &str)]| {
        let place = |path: &str| path.split("::").map(str::to_owned).collect::<Path>();
        let modules =
            texts.iter().map(|(path, text)| (place(path), Module::of(text, &place(path)))).collect();
        circles(&arrows(&modules)).iter().map(BTreeSet::len).collect::<Vec<_>>()
    };
    let parent = ("a", "mod b; mod c; pub use b::B; pub use self::c::C as D;");
    assert_eq!(circle_of(&[parent, ("a::b", "use super::D;"), ("a::c", "use crate::a::B;")]), [2]);
    assert_eq!(
        circle_of(&[parent, ("a::b", "use super::c::C;"), ("a::c", "fn f(_: crate::a::b::B) {}")]),
        [2]
    );
    assert_eq!(circle_of(&[parent, ("a::b", "use super::c::C;"), ("a::c", "use super::E;")]), [0; 0]);
    let test = ("a::c", "#[cfg(test)] mod tests { use crate::a::B; }");
    assert_eq!(circle_of(&[parent, ("a::b", "use super::D;"), test]), [0; 0]);
}
