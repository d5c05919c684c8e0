//! The table of hashes: a line for each stream and arithmetic, a hash for each block of cycles.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

use hexad::control::controller::Output;

use super::output_hash::OutputHash;
use super::stream::{CYCLES, folder};

/// Cycles of each hash.
pub const BLOCK: usize = 100;

pub const HEAD: &str = "\
# Stream, arithmetic, then a hash of all outputs of each 100 cycles. See mod.rs. A changed hash needs a commit of its own that says
# why the outputs are others; HEXAD_WRITE_HASHES=1 writes them anew.
";

/// Hashes by stream and arithmetic.
pub type Table = BTreeMap<(String, String), Vec<u64>>;

/// Hash of each block of outputs.
pub fn of(outputs: &[Output]) -> Vec<u64> {
    let hash = |block: &[Output]| {
        let mut hash = OutputHash::default();
        block.iter().for_each(|output| hash.add(output));
        hash.0
    };
    outputs.chunks(BLOCK).map(hash).collect()
}

pub fn read() -> Table {
    let text = fs::read_to_string(folder().with_file_name("hashes.txt")).unwrap_or_default();
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    let entry = |line: &str| {
        let mut words = line.split_whitespace().map(String::from);
        let key = (words.next().unwrap(), words.next().unwrap());
        let hashes: Vec<_> = words.map(|word| u64::from_str_radix(&word, 16).unwrap()).collect();
        assert_eq!(hashes.len(), CYCLES / BLOCK, "hashes of {key:?}");
        (key, hashes)
    };
    lines.map(entry).collect()
}

pub fn write(table: &Table) {
    let mut text = HEAD.to_owned();
    for ((stream, arithmetic), hashes) in table {
        write!(text, "{stream} {arithmetic}").unwrap();
        hashes.iter().for_each(|hash| write!(text, " {hash:016x}").unwrap());
        text.push('\n');
    }
    fs::write(folder().with_file_name("hashes.txt"), text).unwrap();
}
