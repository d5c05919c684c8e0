//! What is read of datagrams, and a search for one that is read as what it does not mean.

use super::super::rejection::RejectionCounts;
use super::*;
use hexad_core::model::random::Random;
use hexad_core::model::task::pose_of;

const HOME: [f64; 6] = [0.0, 0.0, 0.0, 0.1, -0.2, 1.0];

fn read_as(format: &DatagramFormat, bytes: &[u8]) -> Result<[f64; 6], Rejection> {
    let datagram = format.read(bytes, &pose_of(&HOME), &HOME)?;
    Ok(core::array::from_fn(|k| datagram.x[k] - HOME[k]))
}

fn read(name: &str, bytes: &[u8]) -> Result<[f64; 6], Rejection> {
    read_as(&DatagramFormat::load(name).unwrap(), bytes)
}

fn assert_near(found: Result<[f64; 6], Rejection>, degrees: [f64; 3], millimetres: [f64; 3]) {
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
    let text = b"12.5, -3,4,1.0 ,-2.0,30\r\n";
    assert_near(read("flypt-mover", text), [1.0, -2.0, 30.0], [12.5, -3.0, 4.0]);
    let wrong = |text: &str| read("flypt-mover", text.as_bytes()).unwrap_err().to_string();
    for (text, word) in [
        ("1,2,3,4,5", "has 5 fields, must have 6"),
        ("12,5,-3,4,1,-2,3", "a decimal comma where commas separate?"),
        ("1;2;3;4;5;6", "has 1 fields"),
        ("1,2,3,4,5,nan", "gamma is NaN, which is no number"),
        ("1,2,3,4,5,-999", "gamma = -999 deg is not in its range"),
        ("1,2,3,4,5,\u{2212}6", "is no number; it contains U+2212, which may look like '-'"),
        ("1,2,3,4,5,", "\"\" is no number"),
    ] {
        assert!(wrong(text).contains(word), "{}", wrong(text));
    }

    let mut xplane = b"DATA*".to_vec();
    for (number, values) in [(3_u32, [9.0_f32; 8]), (17, [5.0, -10.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0])] {
        xplane.extend(number.to_le_bytes());
        xplane.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
    assert_near(read("x-plane", &xplane), [-10.0, -5.0, 0.0], [0.0; 3]);
    assert_eq!(read("x-plane", &xplane[..41]), Err(Rejection::NoRecord(17)));
    assert_eq!(read("x-plane", &xplane[..40]), Err(Rejection::NoXPlane), "cut");
    assert_eq!(read("x-plane", b"DATA"), Err(Rejection::NoXPlane));

    let simtools: Vec<_> =
        [65535_u16, 0, 32768, 65535, 32767, 0].iter().flat_map(|v| v.to_be_bytes()).collect();
    let found = read("simtools", &simtools).unwrap();
    assert!([found[3] - 0.1, found[4] + 0.1, found[5]].iter().all(|x| x.abs() < 2e-6), "{found:?}");
}

#[test]
fn a_wrong_format_is_refused_by_name() {
    for (text, word) in [
        ("encoding = \"text\"\nx = { at = 0, unit = \"mm\" }", "separator must be \",\""),
        ("encoding = \"text\"", "none of alpha"),
        ("encoding = \"text\"\nx = { at = 0, unit = \"deg\" }", "unit = \"deg\""),
        ("encoding = \"text\"\nx = { at = 0 }", "unit"),
        ("encoding = \"text\"\nx = { at = 0, unit = \"mm\", offset = 1 }", "offset"),
        ("encoding = \"text\"\nrotation = \"zyz\"\nx = { at = 0, unit = \"mm\" }", "rotation must be"),
        (
            "encoding = \"text\"\nstamp = { at = 1, unit = \"h\" }\nx = { at = 0, unit = \"mm\" }",
            "in s, ms or us",
        ),
        ("encoding = \"text\"\nx = { at = 0, unit = \"mm\", range = [3, -3] }", "range = [3, -3]"),
        (
            "encoding = \"text\"\nfields = 1\nx = { at = 1, unit = \"mm\" }",
            "fields = 1: must be in [2, 8192]",
        ),
        (
            "encoding = \"text\"\nx = { at = 1, unit = \"mm\" }\ny = { at = 1, unit = \"mm\" }",
            "at = 1 is part of two",
        ),
        (
            "encoding = \"binary\"\nx = { at = 0, unit = \"mm\" }\ny = { at = 3, unit = \"mm\" }",
            "at = 3 is part of two numbers",
        ),
        ("encoding = \"binary\"\nx =\u{a0}{ at = 0, unit = \"mm\" }", "contains U+00A0"),
    ] {
        let text = &text.replacen(
            "\"text\"",
            "\"text\"\nseparator = \";\"",
            usize::from(!word.starts_with("separator")),
        );
        let reason = DatagramFormat::parse(text).unwrap_err();
        assert!(reason.contains(word), "{text}: {reason}");
    }
}

/// How a source writes a pose of gamma, x, y, z, in the units of its format.
type Writer = fn(&[f64; 4]) -> Vec<u8>;

fn text(values: &[f64], separator: &str) -> Vec<u8> {
    values.iter().map(|value| format!("{value:.6}")).collect::<Vec<_>>().join(separator).into_bytes()
}

fn with_comma(values: &[f64; 4]) -> Vec<u8> {
    String::from_utf8(text(values, ";")).unwrap().replace('.', ",").into_bytes()
}

/// A packet of 60 bytes with its kind in byte 6, and numbers of 32 bits with the high byte first.
fn packet(kind: u8, values: &[f64; 4]) -> Vec<u8> {
    let mut bytes = vec![0; 60];
    bytes[6] = kind;
    for (place, value) in bytes[20..36].chunks_exact_mut(4).zip(values) {
        place.copy_from_slice(&((1e6 * value.min(800.0)).round() as i32).to_be_bytes());
    }
    bytes
}

/// Numbers of 24 bits, in steps of 1/10000 from -800, up to 800.
fn in_24_bits(values: &[f64; 4]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| {
            ((1e4 * (value.min(800.0) + 800.0)).round() as u32).to_le_bytes().into_iter().take(3)
        })
        .collect()
}

fn xplane(values: &[f64; 4]) -> Vec<u8> {
    let numbers = [0, 0, 0, 1, 2, 3, 0, 0].map(|k: usize| values[k] as f32);
    b"DATA*"
        .iter()
        .copied()
        .chain(17_u32.to_le_bytes())
        .chain(numbers.into_iter().flat_map(f32::to_le_bytes))
        .collect()
}

/// Sources with their formats; numbers are within 400, in deg and mm.
const SOURCES: [(&str, Writer, &str); 7] = [
    (
        "encoding = \"text\"\nseparator = \",\"\nend = \"\\n\"",
        |v| [text(v, ","), b"\n".into()].concat(),
        "type = \"f32\"",
    ),
    (
        "encoding = \"text\"\nseparator = \";\"\nend = \"#\"",
        |v| [text(v, ";"), b"#".into()].concat(),
        "type = \"f32\"",
    ),
    (
        "encoding = \"text\"\nseparator = \";\"\nend = \"#\"",
        |v| [with_comma(v), b"#".into()].concat(),
        "type = \"f32\"",
    ),
    (
        "encoding = \"text\"\nseparator = \"space\"\nend = \"\\n\"",
        |v| [text(v, "  "), b"\n".into()].concat(),
        "type = \"f32\"",
    ),
    (
        "encoding = \"binary\"\nbyte_order = \"big\"\nlength_bytes = 60\nmark = [{ at = 6, bytes = [3] }]",
        |v| packet(3, v),
        "type = \"i32\", scale = 1e-6",
    ),
    ("encoding = \"binary\"", in_24_bits, "type = \"u24\", zero = 8e6, scale = 1e-4"),
    ("encoding = \"x-plane\"", xplane, "record = 17"),
];

/// Datagrams that other programs, other settings and faults make of a pose.
fn mutated(random: &mut Random, sent: &[u8], values: &[f64; 4], write: Writer) -> Vec<u8> {
    let index = |random: &mut Random, len: usize| (random.uniform() * len as f64) as usize;
    let is_text = sent.len() > 12 && !sent.contains(&0);
    let replaced = |from: &str, to: &str| match std::str::from_utf8(sent) {
        Ok(text) if is_text => text.replace(from, to).into_bytes(),
        _ => vec![],
    };
    let invalid = f64::NAN;
    match index(random, 15) {
        0 => sent.into(),
        1 => sent[..index(random, sent.len())].into(),
        2 => [sent, sent].concat(),
        3 => [sent, &write(&values.map(|value| 0.5 * value))].concat(),
        4 => (0..index(random, 3000)).map(|_| random.bits() as u8).collect(),
        5 => replaced(".", ","),
        6 => replaced(",", ";"),
        7 => replaced(";", ","),
        8 => replaced("-", "\u{2212}"),
        9 => replaced("1", "\u{661}"),
        10 => replaced(";", " "),
        11 => packet(index(random, 3) as u8, values),
        12 => write(&[[-999.0; 4], [9999.0; 4], [invalid; 4]][index(random, 3)]),
        13 => {
            let mut bytes = sent.to_vec();
            bytes.insert(index(random, sent.len()), b"\0 ,;\nx\xe2|"[index(random, 8)]);
            bytes
        }
        _ => text(values, [",", ";", " ", "\t", "|"][index(random, 5)]),
    }
}

/// Not searched: a digit or sign that is another one or one more (UDP has a checksum), other datagrams of the stated length without a mark, and texts without
/// a stated end that are cut within their last number: no format can know those.
#[test]
fn a_datagram_is_followed_as_it_was_meant_or_not_at_all() {
    // A million with `HEXAD_LONG=1`.
    let count = if std::env::var_os("HEXAD_LONG").is_some() { 1_000_000 } else { 20_000 };
    let mut random = Random::new(1);
    let fields = |more: &str, is_binary: bool| {
        let size = if more.contains("24") { 3 } else { 4 };
        let place = |k: usize| match is_binary {
            true if size == 4 => 20 + 4 * k,
            true => size * k,
            false => k,
        };
        let places = if more.contains("17") { [2, 3, 4, 5] } else { [0, 1, 2, 3].map(place) };
        let names = [("gamma", "deg"), ("x", "mm"), ("y", "mm"), ("z", "mm")];
        let lines = names.iter().zip(places).map(|((name, unit), at)| {
            format!("{name} = {{ at = {at}, unit = \"{unit}\", range = [-400, 400], {more} }}\n")
        });
        lines.collect::<String>()
    };
    let formats = SOURCES.map(|(head, write, more)| {
        let text = format!("{head}\n{}", fields(more, head.contains("binary")));
        (DatagramFormat::parse(&text).unwrap(), write)
    });
    let (mut followed, mut rejected) = ([0; SOURCES.len()], RejectionCounts::default());
    for k in 0..count {
        let source = k % formats.len();
        let (format, write) = &formats[source];
        let range = [179.0, 399.0, 399.0, 399.0];
        // Numbers that all the formats hold.
        let values = range.map(|range| (4.0 * range * random.signed()).round() / 4.0);
        let bytes = mutated(&mut random, &write(&values), &values, *write);
        match read_as(format, &bytes) {
            Ok(x) => {
                followed[source] += 1;
                let meant = [values[0].to_radians(), 1e-3 * values[1], 1e-3 * values[2], 1e-3 * values[3]];
                let is_meant = x[2..].iter().zip(meant).all(|(x, meant)| (x - meant).abs() < 1e-9);
                assert!(
                    is_meant && x[..2] == [0.0; 2],
                    "source {source}: {values:?} as {x:?} from {bytes:?}"
                );
            }
            Err(rejection) => {
                rejected.add(&rejection);
            }
        }
    }
    assert!(followed.iter().all(|followed| *followed > count / 300), "{followed:?}");
    println!("{followed:?} of each format followed{rejected}");
}
