//! What all pictures have in common: sizes, colours that are readable on light and dark pages, text whose layout does
//! not depend on the installed fonts.

use hexad_machine::text::files::{FileError, write_whole};
use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::io;
use std::path::Path;

/// Drawing units per pixel. The backend draws in whole units; with whole pixels lines would have steps.
pub const UNIT: i32 = 10;
/// Width of every picture \[drawing units\], as all the lengths below.
pub const WIDTH: i32 = 900 * UNIT;
/// Height of a title without its subtitle.
pub const TITLE_HEIGHT: i32 = 28 * UNIT;
const SUBTITLE_HEIGHT: i32 = 16 * UNIT;
/// Length of the ticks of an axis.
pub const TICK: i32 = 4 * UNIT;
/// Distance between parts of a picture, and from its edges.
pub const MARGIN: i32 = 6 * UNIT;
/// Height below the x axis for its numbers and its label.
pub const X_LABELS: i32 = 42 * UNIT;
/// Width beside the y axis for its numbers and its label.
pub const Y_LABELS: i32 = 78 * UNIT;
/// Height of a line of a legend.
pub const LEGEND_LINE: i32 = 19 * UNIT;
/// Width of the sample of a line in a legend.
pub const SAMPLE: i32 = 26 * UNIT;
/// Font size of labels, numbers and legends \[pixels\].
pub const LABEL_SIZE: i32 = 12;
const AXIS_TITLE_SIZE: i32 = 13;

/// Colours of lines and marks: six legs, seven states. They have a contrast of at least 3:1 on white as well as on a
/// dark page, because not every viewer passes the preferred colour scheme to the image. They differ in lightness too, for
/// colour-blind readers.
pub const PALETTE: [u32; 7] = [0x0A6FD6, 0xB98A00, 0x008573, 0xC8430F, 0x4897E0, 0xC77BA8, 0x8957E5];
/// Colour of text and axes.
pub const INK: u32 = 0x59636E;
const INK_ON_DARK: u32 = 0xB1BAC4;
/// Colour of dashed lines that lie on no other one; readable on both pages as it is.
pub const DASHED_INK: u32 = 0x6E7781;
/// Colour of grids and of lines that lead to labels.
pub const GRID: u32 = 0x8B949E;

/// Part of a picture, in drawing units.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Error of the drawing library.
pub type DrawError = DrawingAreaErrorKind<io::Error>;

/// Reason for which a chart was not written.
#[derive(Debug, thiserror::Error)]
pub enum ChartError {
    /// The drawing library reported an error.
    #[error("cannot draw the chart: {0}")]
    Draw(#[from] DrawError),
    /// The file system reported an error.
    #[error("cannot write the chart: {0}")]
    Write(#[from] FileError),
}

/// Draws a picture of this height and writes it as an SVG file, complete or not at all.
pub fn write_picture(
    path: &Path,
    height: i32,
    draw: impl FnOnce(&Area) -> Result<(), DrawError>,
) -> Result<(), ChartError> {
    Ok(write_whole(path, picture(height, draw)?.as_bytes())?)
}

/// SVG text of a picture of this height.
pub fn picture(height: i32, draw: impl FnOnce(&Area) -> Result<(), DrawError>) -> Result<String, DrawError> {
    let mut svg = String::new();
    {
        let size = (WIDTH.unsigned_abs(), height.unsigned_abs());
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&root)?;
        root.present()?;
    }
    Ok(finish(&svg, height))
}

/// Palette colour of an index, repeating after the last.
pub fn palette(index: usize) -> RGBColor {
    rgb(PALETTE.get(index % PALETTE.len()).copied().unwrap_or(INK))
}

/// Colour of a number such as `0x0A6FD6`.
pub fn rgb(color: u32) -> RGBColor {
    let [_, red, green, blue] = color.to_be_bytes();
    RGBColor(red, green, blue)
}

/// Colour of a dashed line on top of a solid one of a palette colour: a quarter of its brightness.
pub fn dashed_on_top(index: usize) -> RGBColor {
    let RGBColor(red, green, blue) = palette(index);
    RGBColor(red >> 2, green >> 2, blue >> 2)
}

/// Width of a text in the widest of the common fonts (DejaVu Sans, Verdana, monospace), at a font size in pixels.
///
/// A layout that leaves this room cuts no text and lets none overlap, whichever font the viewer has.
pub fn text_width(text: &str, size: i32) -> i32 {
    let hundredths_of_em = |c| match c {
        'm' | 'w' | 'M' | 'W' | '%' | '@' => 100,
        'A'..='Z' | '+' | '=' | '<' | '>' | '\u{2212}' => 84,
        _ => 64,
    };
    text.chars().map(hundredths_of_em).sum::<i32>() * size * UNIT / 100
}

/// Text style of a font size in pixels.
pub fn text(size: i32, anchor: HPos) -> TextStyle<'static> {
    styled(f64::from(size * UNIT), anchor)
}

/// Text style of a font size in pixels, or of a smaller one so that every label fits the room beside it.
pub fn fitted_text(labels: &[(&str, i32)], size: i32, anchor: HPos) -> TextStyle<'static> {
    let shares =
        labels.iter().map(|(label, room)| f64::from(*room) / f64::from(text_width(label, size).max(1)));
    styled(f64::from(size * UNIT) * shares.fold(1.0, f64::min), anchor)
}

fn styled(size: f64, anchor: HPos) -> TextStyle<'static> {
    // The backend divides by the line height.
    ("sans-serif", size * 1.24).into_font().color(&rgb(INK)).pos(Pos::new(anchor, VPos::Center))
}

/// Height of a title with its subtitles.
pub fn title_height(title: &str) -> i32 {
    TITLE_HEIGHT + SUBTITLE_HEIGHT * (title.lines().count() as i32 - 1).max(0)
}

/// Draws a title over the whole width of an area. The lines after the first are subtitles in small print.
pub fn draw_title(area: &Area, title: &str, size: i32) -> Result<(), DrawError> {
    let width = area.dim_in_pixel().0 as i32;
    for (row, line) in title.lines().enumerate() {
        let (size, y) = match row as i32 {
            0 => (size, TITLE_HEIGHT * 3 / 5),
            row => (size.min(11), TITLE_HEIGHT + SUBTITLE_HEIGHT * (2 * row - 1) / 2),
        };
        let style = fitted_text(&[(line, width - 2 * MARGIN)], size, HPos::Center);
        area.draw_text(line, &style, (width / 2, y))?;
    }
    Ok(())
}

/// Positions of the entries of a legend in lines across the picture, and the height of all lines. A position is the
/// middle of the left edge of the entry's sample. The label begins `SAMPLE + MARGIN` to the right of it.
pub fn legend_rows<'a>(labels: impl Iterator<Item = &'a str>) -> (Vec<(i32, i32)>, i32) {
    let (mut left, mut y) = (2 * MARGIN, LEGEND_LINE / 2);
    let mut positions = vec![];
    for label in labels {
        let width = SAMPLE + 3 * MARGIN + text_width(label, LABEL_SIZE);
        if left + width > WIDTH && left > 2 * MARGIN {
            (left, y) = (2 * MARGIN, y + LEGEND_LINE);
        }
        positions.push((left, y));
        left += width;
    }
    (positions, y + LEGEND_LINE / 2)
}

/// Sets axes, grid and labels as in every chart. The axes' titles shrink where their rooms are too small for them.
pub fn house_style<'a, X, Y, DB: DrawingBackend>(
    mesh: &mut plotters::chart::MeshStyle<'a, '_, X, Y, DB>,
    titles: [(&str, i32); 2],
) where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    mesh.axis_style(rgb(INK).stroke_width(10))
        .bold_line_style(rgb(GRID).mix(0.3).stroke_width(10))
        .set_all_tick_mark_size(TICK)
        .label_style(text(LABEL_SIZE, HPos::Center))
        .axis_desc_style(fitted_text(&titles, AXIS_TITLE_SIZE, HPos::Center));
}

const DASH: &str = "stroke-dasharray:60 50";

/// Scales units to pixels, and adds the style that the backend cannot express.
fn finish(svg: &str, height: i32) -> String {
    let number = |RGBColor(red, green, blue): RGBColor| u32::from_be_bytes([0, red, green, blue]);
    let rule = |part: &str, of: u32, rule: &str| format!("[{part}=\"#{of:06X}\"]{{{rule}}}");
    let paint = |part: &str, from: u32, to: u32| rule(part, from, &format!("{part}:#{to:06X}"));
    // Alone in a browser the picture has a dark page for its dark colours, and fits a narrow one.
    let mut style = String::from(
        "svg:root{color-scheme:light dark;max-width:100%;height:auto}text{font-family:Helvetica,Arial,sans-serif}\
         polyline{stroke-linejoin:round}",
    );
    style += &rule("stroke", DASHED_INK, DASH);
    let mut dark = paint("fill", INK, INK_ON_DARK) + &paint("stroke", INK, INK_ON_DARK);
    for index in 0..PALETTE.len() {
        let line = number(dashed_on_top(index));
        style += &rule("stroke", line, DASH);
        // Dark shades would vanish here, so they become light ones.
        dark += &paint("stroke", line, line + 0xC0_C0C0);
    }
    let style = format!(">\n<style>{style}\n@media (prefers-color-scheme:dark){{{dark}}}</style>\n");
    let size = |unit: i32| format!("width=\"{}\" height=\"{}\"", WIDTH / unit, height / unit);
    svg.replacen(&size(1), &size(UNIT), 1).replacen(">\n", &style, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_text_shrinks_into_its_room() {
        let room = 100 * UNIT;
        let long = "a label that is far too long for its room";
        let size = |label| fitted_text(&[(label, room)], LABEL_SIZE, HPos::Left).font.get_size();
        assert_eq!(size("short"), text(LABEL_SIZE, HPos::Left).font.get_size());
        let share = size(long) / size("short");
        assert!((f64::from(text_width(long, LABEL_SIZE)) * share - f64::from(room)).abs() < 1.0);
    }

    #[test]
    fn a_legend_breaks_its_lines_before_the_edge() {
        let labels = ["commanded, with many more words than usual"; 5];
        let (positions, height) = legend_rows(labels.into_iter());
        let end = |left: i32| left + SAMPLE + MARGIN + text_width(labels[0], LABEL_SIZE);
        assert!(positions.iter().all(|(left, y)| end(*left) <= WIDTH && *y < height));
        assert_eq!(height, 3 * LEGEND_LINE);
    }
}
