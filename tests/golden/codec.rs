//! Columns of 64-bit words in few bytes, without loss.
//!
//! | bytes of a column | meaning |
//! | --- | --- |
//! | 1 | scale: 255 if the units are the words; else k, and a word is the `f64` of a unit divided by 2^k |
//! | 1 | order n: what follows are the n-th differences of the units (`i64`, wrapping; before the first unit are zeros) |
//! | varint, and for each varint and 8 | words that are no unit: their number; rows since the one before, and the word |
//! | varints | differences in zigzag; after a zero the number of further zeros |
//!
//! The writer takes the scale and the order with the fewest bytes. A smooth motion in multiples of a power of two takes one or two
//! bytes per number. NaN, infinities, -0 and other numbers that are no multiple are words that are no unit.

/// Scale of words that are integers.
const INTEGERS: u8 = 255;
/// Largest scale of numbers: multiples of 2^-40.
const MAX_SCALE: u8 = 40;
const MAX_ORDER: u8 = 3;
/// Units of numbers are exact below this.
const MAX_UNIT: f64 = (1_u64 << 52) as f64;

/// The unit of a word, if it has one.
fn unit(word: u64, scale: u8) -> Option<i64> {
    if scale == INTEGERS {
        return Some(word.cast_signed());
    }
    let scaled = f64::from_bits(word) * (1_u64 << scale) as f64;
    let unit = (scaled.abs() < MAX_UNIT).then_some(scaled as i64)?;
    (word_of(unit, scale) == word).then_some(unit)
}

fn word_of(unit: i64, scale: u8) -> u64 {
    if scale == INTEGERS { unit.cast_unsigned() } else { (unit as f64 / (1_u64 << scale) as f64).to_bits() }
}

/// Appends a column.
pub fn write(bytes: &mut Vec<u8>, column: &[u64]) {
    let exact = |scale: u8| column.iter().filter(|word| unit(**word, scale).is_some()).count();
    let finest = (0..=MAX_SCALE).find(|scale| exact(*scale) == exact(MAX_SCALE)).unwrap_or(MAX_SCALE);
    let choices =
        [INTEGERS, finest].into_iter().flat_map(|scale| (0..=MAX_ORDER).map(move |order| (scale, order)));
    let shortest = choices.map(|(scale, order)| encoded(column, scale, order)).min_by_key(Vec::len);
    bytes.extend(shortest.unwrap_or_default());
}

fn encoded(column: &[u64], scale: u8, order: u8) -> Vec<u8> {
    let mut units = vec![];
    let (mut others, mut other_bytes, mut since) = (0, vec![], 0);
    for word in column {
        if let Some(unit) = unit(*word, scale) {
            units.push(unit);
        } else {
            units.push(units.last().copied().unwrap_or(0));
            write_varint(&mut other_bytes, since);
            other_bytes.extend(word.to_le_bytes());
            (others, since) = (others + 1, 0);
        }
        since += 1;
    }
    for _ in 0..order {
        let mut before = 0_i64;
        units.iter_mut().for_each(|unit| *unit = unit.wrapping_sub(core::mem::replace(&mut before, *unit)));
    }
    let mut bytes = vec![scale, order];
    write_varint(&mut bytes, others);
    bytes.extend(other_bytes);
    let mut rest = units.as_slice();
    while let [first, more @ ..] = rest {
        write_varint(&mut bytes, ((first << 1) ^ (first >> 63)).cast_unsigned());
        rest = more;
        if *first == 0 {
            let zeros = more.iter().take_while(|unit| **unit == 0).count();
            write_varint(&mut bytes, zeros as u64);
            rest = &more[zeros..];
        }
    }
    bytes
}

/// Takes a column of so many words off the bytes.
pub fn read(bytes: &mut &[u8], rows: usize) -> Vec<u64> {
    let [scale, order] = take(bytes);
    let mut others = vec![];
    let mut row = 0;
    for _ in 0..read_varint(bytes) {
        row += read_varint(bytes) as usize;
        others.push((row, u64::from_le_bytes(take(bytes))));
    }
    let mut units = Vec::with_capacity(rows);
    while units.len() < rows {
        let zigzag = read_varint(bytes);
        units.push((zigzag >> 1).cast_signed() ^ -(zigzag & 1).cast_signed());
        if zigzag == 0 {
            units.resize(units.len() + read_varint(bytes) as usize, 0);
        }
    }
    assert_eq!(units.len(), rows, "rows of a column");
    for _ in 0..order {
        let mut sum = 0_i64;
        units.iter_mut().for_each(|unit| {
            sum = sum.wrapping_add(*unit);
            *unit = sum;
        });
    }
    let mut column: Vec<u64> = units.into_iter().map(|unit| word_of(unit, scale)).collect();
    others.into_iter().for_each(|(row, word)| column[row] = word);
    column
}

fn take<const N: usize>(bytes: &mut &[u8]) -> [u8; N] {
    let (taken, rest) = bytes.split_first_chunk().expect("a stream that is complete");
    *bytes = rest;
    *taken
}

fn write_varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

fn read_varint(bytes: &mut &[u8]) -> u64 {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let [byte] = take(bytes);
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            break;
        }
    }
    value
}

#[test]
fn every_word_is_read_as_it_was_written() {
    let numbers =
        [0.0, -0.0, 1.5, -2.75e-3, 1e300, f64::NAN, f64::NEG_INFINITY, f64::MIN_POSITIVE, 0.1, 1e-320];
    let columns = [
        numbers.map(f64::to_bits).to_vec(),
        (0..500).map(|k| (f64::from(k * k) / 1024.0).to_bits()).collect(),
        vec![u64::MAX, 0, 1, 1 << 63, 86_400_000_000_000, 0, 0, 0],
        [vec![0; 300], vec![f64::NAN.to_bits(), 7], vec![0; 5]].concat(),
        vec![],
    ];
    for column in columns {
        let mut bytes = vec![];
        write(&mut bytes, &column);
        let mut rest = bytes.as_slice();
        assert_eq!(read(&mut rest, column.len()), column);
        assert!(rest.is_empty());
    }
}
