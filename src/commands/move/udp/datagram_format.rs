//! Format of datagrams with poses: which number is at which place, with its unit and range, and by what a datagram is known to be one of them.

use std::f64::consts::PI;
use std::fs;

use serde::Deserialize;

use super::rejection::Rejection;
use crate::commands::failure::Failure;
use crate::commands::quantity::{angle, length};
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::{TaskState, task_coordinates};
use hexad_core::motion::rotation_order::RotationOrder;
use hexad_machine::text::excerpt::{excerpt, toml_error};

/// Formats by name.
const KNOWN: [(&str, &str); 3] = [
    ("x-plane", include_str!("formats/xplane.toml")),
    ("flypt-mover", include_str!("formats/flypt-mover.toml")),
    ("simtools", include_str!("formats/simtools.toml")),
];

/// First bytes of a datagram of X-Plane, which its records follow.
const XPLANE_HEADER: usize = 5;

/// Record of X-Plane: its number and eight values.
const XPLANE_RECORD: usize = 36;

/// Longest datagram that is read.
pub const MAX_BYTES: usize = 8192;

/// Names of the numbers.
const NAMES: [&str; 7] = ["stamp", "alpha", "beta", "gamma", "x", "y", "z"];

/// Numbers of a datagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Datagram {
    /// Stamp of the source \[s\].
    pub stamp_s: Option<f64>,
    /// X of the platform.
    pub x: [f64; 6],
}

/// Format of the datagrams of a source.
#[derive(Clone, Debug)]
pub struct DatagramFormat {
    encoding: Encoding,
    byte_order: ByteOrder,
    separator: char,
    /// Number of fields, or of bytes.
    size: usize,
    end: String,
    mark: Vec<Mark>,
    order: RotationOrder,
    /// The stamp, then the coordinates of X.
    fields: [Option<Field>; 7],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Encoding {
    /// Numbers with `separator` between them; `at` counts them from 0.
    Text,
    /// Numbers in memory format; `at` is the number's first byte.
    Binary,
    /// Records of X-Plane; `at` counts the values of a record from 0.
    XPlane,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ByteOrder {
    #[default]
    Little,
    Big,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum NumberType {
    #[default]
    F32,
    F64,
    I8,
    U8,
    I16,
    U16,
    I24,
    U24,
    I32,
    U32,
}

impl NumberType {
    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I24 | Self::U24 => 3,
            Self::F32 | Self::I32 | Self::U32 => 4,
            Self::F64 => 8,
        }
    }

    fn number(self, little: [u8; 8]) -> f64 {
        let word = u64::from_le_bytes(little);
        match self {
            Self::F32 => f64::from(f32::from_bits(word as u32)),
            Self::F64 => f64::from_bits(word),
            Self::I8 => f64::from(word as i8),
            Self::I16 => f64::from(word as i16),
            Self::I24 => f64::from(((word as i32) << 8) >> 8),
            Self::I32 => f64::from(word as i32),
            Self::U8 | Self::U16 | Self::U24 | Self::U32 => word as f64,
        }
    }
}

/// Bytes by which one kind of datagram is known among others.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Mark {
    at: usize,
    bytes: Vec<u8>,
}

/// One number: `(number - zero) * scale` in its unit.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Field {
    at: usize,
    #[serde(default)]
    record: u32,
    #[serde(default, rename = "type")]
    number_type: NumberType,
    #[serde(default)]
    zero: f64,
    #[serde(default = "one")]
    scale: f64,
    unit: String,
    /// In the unit; an angle is otherwise within half a turn.
    range: Option<[f64; 2]>,
    /// The unit in SI.
    #[serde(skip)]
    factor: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FormatFile {
    encoding: Encoding,
    #[serde(default)]
    byte_order: ByteOrder,
    separator: Option<String>,
    fields: Option<usize>,
    length_bytes: Option<usize>,
    #[serde(default)]
    end: String,
    #[serde(default)]
    mark: Vec<Mark>,
    #[serde(default = "xyz")]
    rotation: String,
    stamp: Option<Field>,
    alpha: Option<Field>,
    beta: Option<Field>,
    gamma: Option<Field>,
    x: Option<Field>,
    y: Option<Field>,
    z: Option<Field>,
}

fn one() -> f64 {
    1.0
}

fn xyz() -> String {
    RotationOrder::Xyz.name().into()
}

impl DatagramFormat {
    /// The format with this name, or of this file.
    pub fn load(name: &str) -> Result<Self, Failure> {
        let known = KNOWN.into_iter().find(|(known, _)| *known == name);
        let text = match known {
            Some((_, text)) => text.into(),
            None => fs::read_to_string(name).map_err(|_| {
                Failure::before_start(format_args!(
                    "--format {name}: no such file; the formats with a name are x-plane, flypt-mover and simtools"
                ))
            })?,
        };
        Self::parse(&text).map_err(|reason| Failure::before_start(format_args!("--format {name}: {reason}")))
    }

    fn parse(text: &str) -> Result<Self, String> {
        let file: FormatFile = toml::from_str(text).map_err(|error| toml_error(text, &error))?;
        let order = RotationOrder::by_name(&file.rotation);
        let order = order.ok_or("rotation must be xyz, xzy, yxz, yzx, zxy or zyx")?;
        let separator = match (file.encoding, file.separator.as_deref()) {
            (Encoding::Text, Some("space")) => ' ',
            (Encoding::Text, Some("tab")) => '\t',
            (Encoding::Text, Some(one)) if [",", ";", "|"].contains(&one) => {
                one.chars().next().unwrap_or(',')
            }
            (Encoding::Text, _) => {
                return Err("separator must be \",\", \";\", \"|\", \"space\" or \"tab\": what is between two numbers".into());
            }
            (_, None) => ' ',
            (_, Some(_)) => return Err("separator is of encoding = \"text\" alone".into()),
        };
        let mut fields = [file.stamp, file.alpha, file.beta, file.gamma, file.x, file.y, file.z];
        for (index, field) in fields.iter_mut().enumerate() {
            let Some(field) = field else { continue };
            let one = format!("1{}", field.unit);
            field.factor = match index {
                0 => seconds(&field.unit),
                1..=3 => angle(&one),
                _ => length(&one),
            }
            .map_err(|reason| format!("unit = \"{}\": {reason}", field.unit))?;
            if (1..=3).contains(&index) {
                let half_turn = PI / field.factor;
                field.range.get_or_insert([-half_turn, half_turn]);
            }
            if let Some([low, high]) = field.range.filter(|[low, high]| !(low < high)) {
                return Err(format!("range = [{low}, {high}]: the first must be less than the second"));
            }
        }
        if fields.iter().skip(1).all(Option::is_none) {
            return Err("has none of alpha, beta, gamma, x, y, z".into());
        }
        let mut places: Vec<_> = fields.iter().flatten().map(|field| field.place(file.encoding)).collect();
        places.sort_unstable();
        let mut neighbours = places.iter().zip(places.iter().skip(1));
        let overlap = neighbours.find(|((a, [_, end]), (b, [at, _]))| a == b && at < end);
        if let Some((_, (_, [at, _]))) = overlap {
            return Err(format!("at = {at} is part of two numbers"));
        }
        let needed = places.iter().map(|(_, [_, end])| *end).max().unwrap_or(0);
        let (key, stated, other) = match file.encoding {
            Encoding::Text => ("fields", file.fields, file.length_bytes),
            _ => ("length_bytes", file.length_bytes, file.fields),
        };
        if other.is_some() || (file.encoding == Encoding::XPlane && stated.is_some()) {
            return Err("fields is of encoding = \"text\" alone, length_bytes of \"binary\"".into());
        }
        let size = stated.unwrap_or(needed);
        if size < needed || size > MAX_BYTES {
            return Err(format!("{key} = {size}: must be in [{needed}, {MAX_BYTES}]"));
        }
        let FormatFile { encoding, byte_order, end, mark, .. } = file;
        Ok(Self { encoding, byte_order, separator, size, end, mark, order, fields })
    }

    /// Pose of a datagram: its coordinates are about the pose `home`, its rotation is about the axes of the base.
    pub fn read(&self, bytes: &[u8], home: &Pose, near: &[f64; 6]) -> Result<Datagram, Rejection> {
        let is_marked = |mark: &Mark| bytes.get(mark.at..).is_some_and(|rest| rest.starts_with(&mark.bytes));
        if !self.mark.iter().all(is_marked) {
            return Err(Rejection::Mark);
        }
        let words = match self.encoding {
            Encoding::Text => self.words(bytes)?,
            Encoding::Binary if bytes.len() != self.size => {
                return Err(Rejection::Length { found: bytes.len(), expected: self.size });
            }
            Encoding::XPlane
                if !bytes.starts_with(b"DATA") || bytes.len() % XPLANE_RECORD != XPLANE_HEADER =>
            {
                return Err(Rejection::NoXPlane);
            }
            _ => vec![],
        };
        let mut values = [0.0; 7];
        for ((value, field), name) in values.iter_mut().zip(&self.fields).zip(NAMES) {
            let Some(field) = field else { continue };
            let number = match self.encoding {
                Encoding::Text => self.number_of(words.get(field.at).copied().unwrap_or_default())?,
                Encoding::Binary => self.number_at(bytes, field.at, field.number_type),
                Encoding::XPlane => {
                    let record =
                        xplane_record(bytes, field.record).ok_or(Rejection::NoRecord(field.record))?;
                    self.number_at(record, 4 + 4 * field.at, NumberType::F32)
                }
            };
            let in_unit = (number - field.zero) * field.scale;
            if !in_unit.is_finite() {
                return Err(Rejection::NotFinite(name, in_unit));
            }
            let [low, high] = field.range.unwrap_or([f64::MIN, f64::MAX]);
            if !(low..=high).contains(&in_unit) {
                return Err(Rejection::Range { name, value: in_unit, low, high, unit: field.unit.clone() });
            }
            *value = in_unit * field.factor;
        }
        let [stamp_s, ref coordinates @ ..] = values;
        let moved = self.order.motion(&TaskState::at_rest(*coordinates)).pose;
        let pose =
            Pose { rotation: moved.rotation * home.rotation, position: home.position + moved.position };
        let stamp_s = self.fields[0].as_ref().map(|_| stamp_s);
        Ok(Datagram { stamp_s, x: task_coordinates(&pose, near) })
    }

    /// The fields of a text.
    fn words<'a>(&self, bytes: &'a [u8]) -> Result<Vec<&'a str>, Rejection> {
        let text = std::str::from_utf8(bytes).map_err(|_| Rejection::NoText)?;
        // Programs in C send the end of their strings.
        let text = text.trim_end_matches('\0');
        let text =
            text.strip_suffix(self.end.as_str()).ok_or(Rejection::End)?.trim_matches(['\r', '\n', ' ']);
        let words: Vec<_> = match self.separator {
            ' ' => text.split_ascii_whitespace().collect(),
            separator => text.split(separator).map(str::trim_ascii).collect(),
        };
        match words.len() == self.size {
            true => Ok(words),
            false => Err(Rejection::Fields { found: words.len(), expected: self.size, text: excerpt(text) }),
        }
    }

    /// The number of a field. A comma is its decimal point where semicolons separate.
    fn number_of(&self, word: &str) -> Result<f64, Rejection> {
        let parsed = match self.separator {
            ';' if !word.contains('.') => word.replacen(',', ".", 1).parse(),
            _ => word.parse(),
        };
        parsed.map_err(|_| Rejection::no_number(word))
    }

    /// The number in memory format; NaN if the bytes end before it.
    fn number_at(&self, bytes: &[u8], at: usize, number_type: NumberType) -> f64 {
        let mut little = [0; 8];
        let size = number_type.bytes();
        let (Some(place), Some(found)) = (little.get_mut(..size), bytes.get(at..at + size)) else {
            return f64::NAN;
        };
        place.copy_from_slice(found);
        if let ByteOrder::Big = self.byte_order {
            place.reverse();
        }
        number_type.number(little)
    }
}

impl Field {
    /// Its record, and its first place and the one after it.
    fn place(&self, encoding: Encoding) -> (u32, [usize; 2]) {
        let size = if let Encoding::Binary = encoding { self.number_type.bytes() } else { 1 };
        (self.record, [self.at, self.at.saturating_add(size)])
    }
}

fn seconds(unit: &str) -> Result<f64, String> {
    match unit {
        "s" => Ok(1.0),
        "ms" => Ok(1e-3),
        "us" => Ok(1e-6),
        _ => Err("a stamp is in s, ms or us".into()),
    }
}

/// Record of X-Plane with this number.
fn xplane_record(bytes: &[u8], number: u32) -> Option<&[u8]> {
    let records = bytes.get(XPLANE_HEADER..)?;
    records.chunks_exact(XPLANE_RECORD).find(|record| record.first_chunk() == Some(&number.to_le_bytes()))
}

#[cfg(test)]
mod tests;
