//! Format of datagrams with poses: which number is at which place, with its unit.

use std::fs;

use serde::Deserialize;

use crate::commands::quantity::{angle, length};
use hexad_core::model::rigid::Pose;
use hexad_core::model::task::{TaskState, task_coordinates};
use hexad_core::motion::rotation_order::RotationOrder;

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

/// Reasons of a format that is not usable.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    #[error("--format {0}: no such file; the formats with a name are x-plane, flypt-mover and simtools")]
    Unknown(String),
    #[error("--format {0}: {1}")]
    Wrong(String, String),
}

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
    order: RotationOrder,
    /// The stamp, then the coordinates of X.
    fields: [Option<Field>; 7],
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Encoding {
    /// Numbers with commas, semicolons, bars or white space between them; `at` counts them from 0.
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
    I16,
    U16,
    I32,
    U32,
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
    pub fn load(name: &str) -> Result<Self, FormatError> {
        let known = KNOWN.into_iter().find(|(known, _)| *known == name);
        let text = match known {
            Some((_, text)) => text.into(),
            None => fs::read_to_string(name).map_err(|_| FormatError::Unknown(name.into()))?,
        };
        Self::parse(&text).map_err(|reason| FormatError::Wrong(name.into(), reason))
    }

    fn parse(text: &str) -> Result<Self, String> {
        let file: FormatFile = toml::from_str(text).map_err(|error| error.to_string())?;
        let order = RotationOrder::ALL.into_iter().find(|order| order.name() == file.rotation);
        let order = order.ok_or("rotation must be xyz, xzy, yxz, yzx, zxy or zyx")?;
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
        }
        if fields.iter().skip(1).all(Option::is_none) {
            return Err("has none of alpha, beta, gamma, x, y, z".into());
        }
        Ok(Self { encoding: file.encoding, byte_order: file.byte_order, order, fields })
    }

    /// Pose of a datagram: its coordinates are about the pose `home`, its rotation is about the axes of the base. `None` if a number is
    /// missing or not finite.
    pub fn read(&self, bytes: &[u8], home: &Pose, near: &[f64; 6]) -> Option<Datagram> {
        let text = std::str::from_utf8(bytes).unwrap_or_default();
        let is_between = |c: char| c.is_whitespace() || [',', ';', '|'].contains(&c);
        let words: Vec<_> = text.split(is_between).filter(|word| !word.is_empty()).collect();
        let number = |field: &Field| match self.encoding {
            Encoding::Text => words.get(field.at)?.parse().ok(),
            Encoding::Binary => self.number(bytes.get(field.at..)?, field.number_type),
            Encoding::XPlane => f32_of(xplane_record(bytes, field.record)?.get(4 + 4 * field.at..)?),
        };
        let mut values = [0.0; 7];
        for (value, field) in values.iter_mut().zip(&self.fields) {
            let Some(field) = field else { continue };
            *value = (number(field)? - field.zero) * field.scale * field.factor;
            if !value.is_finite() {
                return None;
            }
        }
        let [stamp_s, ref coordinates @ ..] = values;
        let moved = self.order.motion(&TaskState::at_rest(*coordinates)).pose;
        let pose =
            Pose { rotation: moved.rotation * home.rotation, position: home.position + moved.position };
        let stamp_s = self.fields[0].as_ref().map(|_| stamp_s);
        Some(Datagram { stamp_s, x: task_coordinates(&pose, near) })
    }

    fn number(&self, bytes: &[u8], number_type: NumberType) -> Option<f64> {
        let size = match number_type {
            NumberType::I16 | NumberType::U16 => 2,
            NumberType::F32 | NumberType::I32 | NumberType::U32 => 4,
            NumberType::F64 => 8,
        };
        let mut little = [0; 8];
        little.get_mut(..size)?.copy_from_slice(bytes.get(..size)?);
        if let ByteOrder::Big = self.byte_order {
            little.get_mut(..size)?.reverse();
        }
        let word = u64::from_le_bytes(little);
        Some(match number_type {
            NumberType::F32 => f64::from(f32::from_bits(word as u32)),
            NumberType::F64 => f64::from_bits(word),
            NumberType::I16 => f64::from(word as i16),
            NumberType::U16 => f64::from(word as u16),
            NumberType::I32 => f64::from(word as i32),
            NumberType::U32 => f64::from(word as u32),
        })
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

fn f32_of(bytes: &[u8]) -> Option<f64> {
    Some(f64::from(f32::from_le_bytes(*bytes.first_chunk()?)))
}

/// Record of X-Plane with this number.
fn xplane_record(bytes: &[u8], number: u32) -> Option<&[u8]> {
    let records = bytes.strip_prefix(b"DATA").and(bytes.get(XPLANE_HEADER..))?;
    records.chunks_exact(XPLANE_RECORD).find(|record| record.first_chunk() == Some(&number.to_le_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use hexad_machine::config::Config;

    fn read(name: &str, bytes: &[u8]) -> Option<[f64; 6]> {
        let machine = Config::parse(DEFAULT_CONFIG, "a test").unwrap().machine;
        let format = DatagramFormat::load(name).unwrap();
        let datagram = format.read(bytes, &machine.home_pose(), &machine.home)?;
        Some(core::array::from_fn(|k| datagram.x[k] - machine.home[k]))
    }

    fn assert_near(found: Option<[f64; 6]>, degrees: [f64; 3], millimetres: [f64; 3]) {
        let found = found.unwrap();
        let order = RotationOrder::Zyx;
        let angles = degrees.map(f64::to_radians);
        let pose = order.motion(&TaskState::at_rest([angles[0], angles[1], angles[2], 0.0, 0.0, 0.0])).pose;
        let expected = task_coordinates(&pose, &[0.0; 6]);
        for k in 0..3 {
            assert!((found[k] - expected[k]).abs() < 1e-6, "{found:?} {expected:?}");
            assert!((found[3 + k] - 1e-3 * millimetres[k]).abs() < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn the_formats_with_a_name_read_what_their_first_lines_say() {
        let text = b"12.5, -3;4 | 1.0 -2.0\t30\r\n";
        assert_near(read("flypt-mover", text), [1.0, -2.0, 30.0], [12.5, -3.0, 4.0]);
        assert_eq!(read("flypt-mover", b"1,2,3,4,5"), None, "a number is missing");
        assert_eq!(read("flypt-mover", b"1,2,3,4,5,nan"), None);

        let mut xplane = b"DATA*".to_vec();
        for (number, values) in [(3_u32, [9.0_f32; 8]), (17, [5.0, -10.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0])] {
            xplane.extend(number.to_le_bytes());
            xplane.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        assert_near(read("x-plane", &xplane), [-10.0, -5.0, 0.0], [0.0; 3]);
        assert_eq!(read("x-plane", &xplane[..41]), None, "without record 17");
        assert_eq!(read("x-plane", b"DATA"), None);

        let simtools: Vec<_> =
            [65535_u16, 0, 32768, 65535, 32767, 0].iter().flat_map(|v| v.to_be_bytes()).collect();
        let found = read("simtools", &simtools).unwrap();
        assert!([found[3] - 0.1, found[4] + 0.1, found[5]].iter().all(|x| x.abs() < 2e-6), "{found:?}");
    }

    #[test]
    fn a_wrong_format_is_refused_by_name() {
        for (text, word) in [
            ("encoding = \"text\"", "none of alpha"),
            ("encoding = \"text\"\nx = { at = 0, unit = \"deg\" }", "unit = \"deg\""),
            ("encoding = \"text\"\nx = { at = 0 }", "unit"),
            ("encoding = \"text\"\nx = { at = 0, unit = \"mm\", offset = 1 }", "offset"),
            ("encoding = \"text\"\nrotation = \"zyz\"\nx = { at = 0, unit = \"mm\" }", "rotation must be"),
            (
                "encoding = \"text\"\nstamp = { at = 1, unit = \"h\" }\nx = { at = 0, unit = \"mm\" }",
                "in s, ms or us",
            ),
        ] {
            let reason = DatagramFormat::parse(text).unwrap_err();
            assert!(reason.contains(word), "{text}: {reason}");
        }
    }
}
