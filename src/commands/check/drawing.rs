//! Drawing of a machine at its home pose: from above, from the side, in perspective, and the strokes of its legs.
//!
//! Legs, and outlines through the joints, cross each other if the joints are not in the order of the legs.

use nalgebra::{Vector2, Vector3};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use std::path::Path;

use crate::output::axis::Axis;
use crate::output::svg::{
    Area, ChartError, DrawError, GRID, INK, LABEL_SIZE, MARGIN, TITLE_HEIGHT, UNIT, X_LABELS, Y_LABELS,
    draw_title, house_style, palette, rgb, text, title_height, write_picture,
};
use hexad_core::model::LEGS;
use hexad_core::model::inverse_geometry::leg_lengths;
use hexad_core::model::machine::Machine;
use hexad_core::model::task::TaskState;

const CELL_HEIGHT: i32 = 390 * UNIT;
/// Approximate number of ticks on an axis.
const TICKS: f64 = 6.0;
/// Empty border around a machine as a share of its extent.
const BORDER: f64 = 0.06;
/// Half the size of a joint with its number, and the size of the number \[pixels\].
const RADIUS: i32 = 7 * UNIT;
const NUMBER_SIZE: i32 = 11;
/// Perspective view: distance of the eye from the machine, in extents of the machine, and its direction: to
/// the right, to the back, up.
const EYE_DISTANCE: f64 = 3.0;
const EYE: [f64; 3] = [0.45, -0.75, 0.5];
/// Length of the axes in the corner of the perspective view.
const AXES_LENGTH: f64 = (26 * UNIT) as f64;

/// Point of an area \[drawing units\].
type Pixel = Vector2<f64>;
/// Centres of six joints.
type JointCentres = [Vector3<f64>; LEGS];

/// Writes the drawing as one SVG file, complete or not at all.
pub fn write_svg(path: &Path, name: &str, machine: &Machine) -> Result<(), ChartError> {
    let title = format!(
        "{name}: the machine at home\nNumbers: legs. Squares: joints on the base. Discs: joints on the platform."
    );
    let head = title_height(&title);
    write_picture(path, head + 2 * CELL_HEIGHT, |root| {
        draw_title(root, &title, 15)?;
        let cells = root.split_vertically(head).1.split_evenly((2, 2));
        let axes = axes(&machine.gravity_m_s2);
        let joints = joints(machine);
        let views = [View::above(axes), View::side(axes), View::perspective(axes, &joints)];
        cells.iter().zip(&views).try_for_each(|(cell, view)| view.draw(cell, &joints))?;
        cells.last().map_or(Ok(()), |cell| draw_strokes(cell, machine))
    })
}

/// Joint centres on the base and on the platform at home, in base axes \[m\].
fn joints(machine: &Machine) -> [JointCentres; 2] {
    let pose = TaskState::at_rest(machine.home).motion().pose;
    let joints = &machine.joints;
    let [base, platform] = [&joints.base, &joints.platform].map(|lanes| joints.triples.unpack_vectors(lanes));
    [base, platform.map(|joint| pose.position + pose.rotation * joint)]
}

/// Right-handed axes along axes of the base: two horizontal ones, and one against gravity. Without gravity z
/// is up.
fn axes(gravity: &Vector3<f64>) -> [Vector3<f64>; 3] {
    let vertical = if gravity.norm() > 0.0 { gravity.iamax() } else { 2 };
    let unit = |axis: usize| Vector3::ith(axis % 3, 1.0);
    let (first, second, up) = (unit(vertical + 1), unit(vertical + 2), unit(vertical));
    if gravity.dot(&up) > 0.0 { [second, first, -up] } else { [first, second, up] }
}

/// Projection of the base frame onto a page.
struct View {
    title: &'static str,
    /// Right-handed axes of the page, the third towards the eye, in base axes.
    page: [Vector3<f64>; 3],
    /// Point at which lengths are drawn to scale.
    center: Vector3<f64>,
    /// Distance of the eye from the center \[m\]; infinite for a parallel projection.
    eye_distance: f64,
}

impl View {
    fn above(page: [Vector3<f64>; 3]) -> Self {
        Self { title: "from above", page, center: Vector3::zeros(), eye_distance: f64::INFINITY }
    }

    fn side([first, second, up]: [Vector3<f64>; 3]) -> Self {
        Self { title: "from the side", ..Self::above([first, up, -second]) }
    }

    fn perspective(axes: [Vector3<f64>; 3], joints: &[JointCentres; 2]) -> Self {
        let all = || joints.iter().flatten();
        let center = all().sum::<Vector3<f64>>() / (2 * LEGS) as f64;
        let extent = all().map(|joint| (joint - center).norm()).fold(0.0, f64::max);
        let [_, _, vertical] = axes;
        let back = axes.iter().zip(EYE).map(|(axis, share)| axis * share).sum::<Vector3<f64>>().normalize();
        let right = vertical.cross(&back).normalize();
        let page = [right, back.cross(&right), back];
        Self { title: "in perspective", page, center, eye_distance: EYE_DISTANCE * extent }
    }

    fn project(&self, point: &Vector3<f64>) -> (f64, f64) {
        let [right, up, back] = self.page.map(|axis| axis.dot(&(point - self.center)));
        let scale = 1.0 / (1.0 - back / self.eye_distance);
        (right * scale, up * scale)
    }

    /// Labels of the axes of a parallel view, such as `x [m]`.
    fn axis_labels(&self) -> Option<[String; 2]> {
        let label = |axis: Vector3<f64>| {
            let names = ["x [m]", "y [m]", "z [m]"];
            let sign = if axis.sum() < 0.0 { "\u{2212}" } else { "" };
            format!("{sign}{}", names.get(axis.iamax()).copied().unwrap_or_default())
        };
        let [right, up, _] = self.page;
        self.eye_distance.is_infinite().then(|| [right, up].map(label))
    }

    fn draw(&self, area: &Area, joints: &[JointCentres; 2]) -> Result<(), DrawError> {
        let points: Vec<_> = joints.iter().flatten().map(|joint| self.project(joint)).collect();
        let (width, height) = area.dim_in_pixel();
        let room = [
            width as i32 - Y_LABELS - 3 * MARGIN - 2 * RADIUS,
            height as i32 - TITLE_HEIGHT - X_LABELS - MARGIN - 2 * RADIUS,
        ];
        let labels = self.axis_labels();
        let [x_label, y_label] =
            labels.as_ref().map_or([""; 2], |labels| labels.each_ref().map(String::as_str));
        let axes = Axis::with_equal_scales([x_label, y_label], &points, BORDER, room.map(f64::from), TICKS);
        let chart = draw_axes(area, self.title, axes, labels.is_some())?;
        if labels.is_none() {
            self.draw_base_axes(area)?;
        }
        let (left, top) = area.get_base_pixel();
        let [base, platform] = joints.map(|joints| {
            joints.map(|joint| {
                let (x, y) = chart.backend_coord(&self.project(&joint));
                Pixel::new(f64::from(x - left), f64::from(y - top))
            })
        });
        draw_outline(area, &base, 0.15)?;
        draw_outline(area, &platform, 0.35)?;
        // The farthest first.
        let [_, _, back] = self.page;
        let [on_base, on_platform] = joints;
        let depths = on_base.iter().zip(on_platform).map(|(from, to)| (from + to).dot(&back));
        let mut legs: Vec<_> = depths.zip(base.iter().zip(&platform)).enumerate().collect();
        legs.sort_by(|(_, (a, _)), (_, (b, _))| a.total_cmp(b));
        for (leg, (_, (from, to))) in legs {
            area.draw(&PathElement::new(vec![whole(from), whole(to)], palette(leg).stroke_width(28)))?;
        }
        draw_joints(area, &base, &platform)
    }

    /// Directions of the axes of the base, in the lower left corner.
    fn draw_base_axes(&self, area: &Area) -> Result<(), DrawError> {
        let [right, up, _] = self.page;
        let height = f64::from(area.dim_in_pixel().1);
        let corner = Pixel::new(f64::from(Y_LABELS / 2), height - f64::from(X_LABELS));
        for (name, axis) in ["x", "y", "z"].into_iter().zip(0..) {
            let axis = Vector3::ith(axis, AXES_LENGTH);
            let direction = Pixel::new(axis.dot(&right), -axis.dot(&up));
            let line = vec![whole(&corner), whole(&(corner + direction))];
            area.draw(&PathElement::new(line, rgb(INK).stroke_width(12)))?;
            area.draw_text(name, &text(LABEL_SIZE, HPos::Center), whole(&(corner + 1.25 * direction)))?;
        }
        Ok(())
    }
}

/// Draws a coordinate system, with or without numbers and grid.
fn draw_axes<'a>(
    area: &Area<'a>,
    title: &str,
    [x, y]: [Axis; 2],
    has_grid: bool,
) -> Result<ChartContext<'a, SVGBackend<'a>, Cartesian2d<Axis, Axis>>, DrawError> {
    draw_title(area, title, 13)?;
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .margin_top(TITLE_HEIGHT)
        .margin_right(2 * MARGIN)
        .x_label_area_size(X_LABELS)
        .y_label_area_size(Y_LABELS)
        .build_cartesian_2d(x.clone(), y.clone())?;
    if has_grid {
        let [x_title, y_title] = [x.title(), y.title()];
        let mut mesh = chart.configure_mesh();
        house_style(&mut mesh, [(&x_title, CELL_HEIGHT), (&y_title, CELL_HEIGHT)]);
        mesh.x_desc(x_title).y_desc(y_title).draw()?;
    }
    Ok(chart)
}

/// Each leg as a line from its shortest to its longest length, with a disc at its length at home.
fn draw_strokes(area: &Area, machine: &Machine) -> Result<(), DrawError> {
    let lengths = leg_lengths(machine, &TaskState::at_rest(machine.home).motion().pose);
    let ends = [machine.actuator.min_length_m, machine.actuator.max_length_m];
    let x = Axis::new("length [m]", ends.into_iter().chain(lengths), 0.08, TICKS);
    let y = Axis::new("leg", [0.5, LEGS as f64 + 0.5].into_iter(), 0.0, LEGS as f64).reversed();
    let mut chart = draw_axes(area, "stroke of each leg; discs: length at home", [x, y], true)?;
    for (index, length) in lengths.into_iter().enumerate() {
        let (leg, color) = (index as f64 + 1.0, palette(index));
        chart.draw_series([PathElement::new(ends.map(|end| (end, leg)), color.stroke_width(28))])?;
        chart.draw_series([Circle::new((length, leg), RADIUS / 2, color.filled())])?;
    }
    Ok(())
}

/// The plane through six joints.
fn draw_outline(area: &Area, joints: &[Pixel; LEGS], opacity: f64) -> Result<(), DrawError> {
    let corners: Vec<_> = joints.iter().chain(joints.first()).map(whole).collect();
    area.draw(&Polygon::new(corners.clone(), rgb(GRID).mix(opacity).filled()))?;
    area.draw(&PathElement::new(corners, rgb(GRID).stroke_width(12)))
}

/// Draws the joints with the numbers of their legs. Joints that would hide each other are moved along their
/// legs.
fn draw_joints(area: &Area, base: &[Pixel; LEGS], platform: &[Pixel; LEGS]) -> Result<(), DrawError> {
    let mut drawn: Vec<Pixel> = vec![];
    for (ends, others, is_base) in [(base, platform, true), (platform, base, false)] {
        for (leg, (end, other)) in ends.iter().zip(others).enumerate() {
            let step = (other - end).try_normalize(0.0).unwrap_or_default() * f64::from(UNIT);
            let most = 0.45 * (other - end).norm() / f64::from(UNIT);
            let mut places = (0..=most as u32).map(|steps| end + step * f64::from(steps));
            let is_free = |place: &Pixel| drawn.iter().all(|at| (at - place).norm() > f64::from(2 * RADIUS));
            let place = places.find(is_free).unwrap_or(*end);
            drawn.push(place);
            let (x, y) = whole(&place);
            let style = palette(leg).filled();
            if is_base {
                area.draw(&Rectangle::new([(x - RADIUS, y - RADIUS), (x + RADIUS, y + RADIUS)], style))?;
            } else {
                area.draw(&Circle::new((x, y), RADIUS, style))?;
            }
            let number = text(NUMBER_SIZE, HPos::Center).color(&WHITE);
            area.draw_text(&format!("{}", leg + 1), &number, (x, y))?;
        }
    }
    Ok(())
}

fn whole(pixel: &Pixel) -> (i32, i32) {
    (pixel.x as i32, pixel.y as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::arguments::DEFAULT_CONFIG;
    use hexad_machine::config::Config;

    #[test]
    fn views_are_not_mirrored_and_look_down_whatever_gravity_is() {
        for gravity in [[0.0, 0.0, -9.81], [0.0, 0.0, 9.81], [-9.81, 0.0, 0.1], [0.2, 9.81, 0.0], [0.0; 3]] {
            let gravity = Vector3::from(gravity);
            let axes = axes(&gravity);
            let joints = [[Vector3::x(); LEGS], [Vector3::y(); LEGS]];
            for view in [View::above(axes), View::side(axes), View::perspective(axes, &joints)] {
                let [right, up, back] = view.page;
                assert!((right.cross(&up) - back).norm() < 1e-12, "{}", view.title);
                assert!(back.dot(&gravity) <= 0.0 && (view.title == "from above" || up.dot(&gravity) <= 0.0));
            }
        }
    }

    #[test]
    fn every_joint_has_its_number_in_every_view() {
        let machine = Config::parse(DEFAULT_CONFIG, "test").unwrap().machine;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("machine.svg");
        write_svg(&path, "test", &machine).unwrap();
        let svg = std::fs::read_to_string(path).unwrap();
        // In three views on two bodies, and beside the stroke.
        let mut numbers: Vec<u32> = svg.lines().filter_map(|line| line.trim().parse().ok()).collect();
        numbers.sort_unstable();
        let counts = numbers.chunk_by(|a, b| a == b).map(|same| (same[0], same.len()));
        assert!(counts.eq((1..=6).map(|leg| (leg, 7))), "{numbers:?}");
    }
}
