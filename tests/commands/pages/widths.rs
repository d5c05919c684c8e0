//! Pages fit every screen, from a phone to a wide one, and have the same axes as the pictures.

use std::path::Path;

use hexad::model::random::Random;
use hexad::output::axis::Axis;
use hexad::recording::RunInfo;
use hexad::recording::file::RecordingFile;
use plotters::coord::ranged1d::{BoldPoints, Ranged, ValueFormatter};
use serde_json::{Value, json};

use super::super::Folder;
use super::report::{FAULT, RATE_HZ, cycle, machine};
use hexad_support::browser::Browser;

const WIDTHS: [u32; 3] = [390, 1280, 2560];

/// Nothing of a page is clipped or overlaps in any width; returns what is shown in each.
pub(super) fn fits_every_width(page: &Path, cases: &str) -> Vec<Value> {
    let Some(browser) = Browser::find() else { return vec![] };
    let script = include_str!("widths.js").replace("CASES", cases);
    let found = browser.run_in_widths(page, &script, &WIDTHS);
    for (shown, width) in found.as_array().unwrap().iter().zip(WIDTHS) {
        assert_eq!(shown["width"], width, "the frame must have its width");
        assert!(shown["texts"].as_u64() > Some(20), "{shown}");
        for fault in ["clipped", "overlapping", "outside"] {
            assert_eq!(shown[fault], json!([]), "{fault} in {width} pixels");
        }
        assert_eq!(shown["error"], Value::Null);
        for axis in shown["axes"].as_array().unwrap() {
            let texts: Vec<&str> =
                axis["texts"].as_array().unwrap().iter().map(|it| it.as_str().unwrap()).collect();
            assert!(texts.len() >= 2 && texts.windows(2).all(|pair| pair[0] != pair[1]), "{axis}");
            assert!(texts.iter().all(|text| text.chars().count() <= 9 && !text.contains('e')), "{axis}");
        }
    }
    found.as_array().unwrap().clone()
}

/// A recording in which x moves by micrometres, y by decimetres, and the forces are large.
fn write(folder: &Folder) {
    let config = folder.config();
    let info = RunInfo { name: "widths".into(), configuration: config.text.clone(), ..RunInfo::default() };
    let mut file = RecordingFile::create(&folder.path("widths.mcap"), &info, None).unwrap();
    for number in FAULT - 600..FAULT + 200 {
        let mut cycle = cycle(&config, number);
        let t = number as f64 / RATE_HZ as f64;
        cycle.position_m[0] += 8e-6 * t.sin();
        cycle.position_m[1] += 0.1 * t.sin();
        cycle.force_n.iter_mut().for_each(|force| *force *= 90.0);
        file.write_cycle(&cycle).unwrap();
    }
    file.finish().unwrap();
}

fn axes(found: &Value) -> Vec<&str> {
    found["axes"].as_array().unwrap().iter().map(|axis| axis["title"].as_str().unwrap()).collect()
}

#[test]
#[ignore = "second tier: needs Chromium"]
fn a_page_fits_every_width_and_has_the_axes_of_the_pictures() {
    let folder = machine();
    write(&folder);
    folder.says("report -o @/widths.html @/widths.mcap");

    let mut random = Random::new(11);
    let labels = ["position [m]", "force [N]", "angle [deg]", "time [s]", "condition"];
    let cases: Vec<_> = (0..600)
        .map(|k| {
            let middle = random.signed() * 10f64.powf(12.0 * random.uniform() - 8.0);
            let span = middle.abs() * 10f64.powf(6.0 * random.uniform() - 5.0);
            (labels[k % labels.len()], middle - span, middle + span)
        })
        .collect();
    for shown in fits_every_width(&folder.path("widths.html"), &json!(cases).to_string()) {
        let titles = axes(&shown);
        assert_eq!(titles[1..4], ["x [mm]", "y [mm]", "z [m]"], "{titles:?}");
        assert!(titles.contains(&"force [kN]") && titles.contains(&"computation [µs]"), "{titles:?}");
        for ((label, low, high), computed) in cases.iter().zip(shown["computed"].as_array().unwrap()) {
            let axis = Axis::new(label, [*low, *high].into_iter(), 0.05, 5.0);
            let ticks = axis.key_points(BoldPoints(9));
            let texts = ticks.iter().map(|tick| axis.format_ext(tick));
            let of_picture: Vec<_> = [axis.title()].into_iter().chain(texts).collect();
            assert_eq!(*computed, json!(of_picture), "{label} from {low} to {high}");
        }
    }
}
