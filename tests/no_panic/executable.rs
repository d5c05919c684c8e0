//! The functions of an executable, and what their code goes to.

use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::Path;

use object::{
    Architecture, Object, ObjectSection, ObjectSymbol, ObjectSymbolTable, RelocationTarget, SectionKind,
    SymbolKind,
};

use super::{aarch64, x86_64};

/// What one instruction does besides computing and going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leap {
    /// Goes on at this address, for good or as a call.
    To(u64),
    /// Goes on where the pointer at this address points.
    ThroughPointerAt(u64),
    /// Goes on where the analysis cannot tell: a call through a pointer.
    Somewhere,
    /// Traps, or enters the kernel.
    Trap,
}

/// Where the instructions of one function leap, each with its own address.
pub type Leaps = Vec<(u64, Leap)>;

/// Data that nobody writes, by address.
#[derive(Default)]
pub struct Constants(pub Vec<(u64, Vec<u8>)>);

impl Constants {
    /// The signed number of 32 bits at an address.
    pub fn word(&self, address: u64) -> Option<i32> {
        let word = |(start, data): &(u64, Vec<u8>)| {
            let offset = usize::try_from(address.checked_sub(*start)?).ok()?;
            Some(i32::from_le_bytes(data.get(offset..)?.first_chunk().copied()?))
        };
        self.0.iter().find_map(word)
    }
}

/// A function with a name in the symbol table.
pub struct Function {
    pub name: String,
    pub address: u64,
    code: Vec<u8>,
}

/// What is at an address that code goes to.
pub enum Place<'a> {
    Function(&'a Function),
    /// A function of a shared library, by name.
    Import(&'a str),
    Unknown,
}

/// An executable in memory.
pub struct Executable {
    leaps: fn(&[u8], u64, &Constants) -> Leaps,
    constants: Constants,
    /// By address.
    functions: BTreeMap<u64, Function>,
    /// The linker's stubs for calls to shared libraries, which have no names.
    stubs: Vec<(Range<u64>, Vec<u8>)>,
    /// What the dynamic linker writes for good, by the address it writes to.
    pointers: BTreeMap<u64, Pointer>,
}

enum Pointer {
    Import(String),
    Address(u64),
}

impl Executable {
    pub fn read(path: &Path) -> Self {
        let bytes = fs::read(path).unwrap();
        let file = object::File::parse(&*bytes).unwrap();
        let leaps = match file.architecture() {
            Architecture::X86_64 => x86_64::leaps,
            Architecture::Aarch64 => aarch64::leaps,
            other => panic!("no decoder for {other:?}: write one beside x86_64.rs"),
        };
        Self {
            leaps,
            constants: constants(&file),
            functions: functions(&file),
            stubs: stubs(&file),
            pointers: pointers(&file),
        }
    }

    /// The functions whose path is `path`, whatever their type parameters.
    pub fn named(&self, path: &str) -> Vec<&Function> {
        let is = |function: &&Function| function.name.split("::<").next() == Some(path);
        self.functions.values().filter(is).collect()
    }

    /// Where `function` leaps, but for places within itself.
    pub fn leaps(&self, function: &Function) -> Leaps {
        let mut leaps = (self.leaps)(&function.code, function.address, &self.constants);
        leaps.retain(|(_, leap)| !matches!(leap, Leap::To(address) if function.contains(*address)));
        leaps
    }

    /// What a leap leads to.
    pub fn place(&self, leap: Leap) -> Place<'_> {
        match leap {
            Leap::To(address) => self.at(address),
            Leap::ThroughPointerAt(address) => match self.pointers.get(&address) {
                Some(Pointer::Import(name)) => Place::Import(name),
                Some(Pointer::Address(address)) => self.at(*address),
                None => Place::Unknown,
            },
            Leap::Somewhere | Leap::Trap => Place::Unknown,
        }
    }

    fn at(&self, address: u64) -> Place<'_> {
        // Into the middle of a function nobody jumps: what is known at its entry would not hold.
        if let Some(function) = self.functions.get(&address) {
            return Place::Function(function);
        }
        let Some((range, code)) = self.stubs.iter().find(|(range, _)| range.contains(&address)) else {
            return Place::Unknown;
        };
        // A stub ends with its first leap.
        let stub = (self.leaps)(&code[(address - range.start) as usize..], address, &self.constants);
        stub.first().map_or(Place::Unknown, |(_, leap)| match leap {
            Leap::ThroughPointerAt(_) => self.place(*leap),
            _ => Place::Unknown,
        })
    }
}

impl Function {
    fn contains(&self, address: u64) -> bool {
        (self.address..self.address + self.code.len() as u64).contains(&address)
    }
}

fn functions(file: &object::File) -> BTreeMap<u64, Function> {
    let sections: Vec<_> = file.sections().filter(|section| section.kind() == SectionKind::Text).collect();
    let code = |address, size| {
        sections.iter().find_map(|section| section.data_range(address, size).ok().flatten().map(Vec::from))
    };
    let symbols = file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text);
    let function = |symbol: object::Symbol| {
        let name = format!("{:#}", rustc_demangle::demangle(symbol.name().ok()?));
        let (address, code) = (symbol.address(), code(symbol.address(), symbol.size())?);
        Some((address, Function { name, address, code }))
    };
    symbols.filter_map(function).collect()
}

fn constants(file: &object::File) -> Constants {
    // Where linkers merge strings, tables are among them.
    let is_constant = |kind| matches!(kind, SectionKind::ReadOnlyData | SectionKind::ReadOnlyString);
    let sections = file.sections().filter(|section| is_constant(section.kind()));
    Constants(sections.map(|section| (section.address(), section.data().unwrap().to_vec())).collect())
}

fn stubs(file: &object::File) -> Vec<(Range<u64>, Vec<u8>)> {
    let sections =
        file.sections().filter(|section| section.name().is_ok_and(|name| name.starts_with(".plt")));
    let stubs = |section: object::Section| {
        let range = section.address()..section.address() + section.size();
        (range, section.data().unwrap().to_vec())
    };
    sections.map(stubs).collect()
}

/// Only where nobody else writes once the program runs: a pointer in a `static` may change.
fn pointers(file: &object::File) -> BTreeMap<u64, Pointer> {
    let is_constant = |name: &str| name.starts_with(".got") || name.starts_with(".data.rel.ro");
    let sections = file.sections().filter(|section| section.name().is_ok_and(is_constant));
    let constant: Vec<_> =
        sections.map(|section| section.address()..section.address() + section.size()).collect();
    let imports = file.dynamic_symbol_table().expect("an executable for glibc is linked dynamically");
    let pointer = |(address, relocation): (u64, object::Relocation)| {
        let pointer = match relocation.target() {
            RelocationTarget::Symbol(index) => {
                Pointer::Import(imports.symbol_by_index(index).unwrap().name().unwrap().into())
            }
            _ => Pointer::Address(relocation.addend() as u64),
        };
        (address, pointer)
    };
    let for_good =
        |(address, _): &(u64, object::Relocation)| constant.iter().any(|range| range.contains(address));
    file.dynamic_relocations().into_iter().flatten().filter(for_good).map(pointer).collect()
}
