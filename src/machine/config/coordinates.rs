//! Coordinates that people and panels use: of a tool in a work frame, in an order of rotations.

use super::Config;
use hexad_client::operator::status_report::StatusReport;
use hexad_core::model::rigid::Twist;
use hexad_core::model::task::{TaskState, pose_of, task_coordinates};
use hexad_core::motion::frames::Frames;
use hexad_core::motion::rotation_order::RotationOrder;

/// Coordinates of a tool in a work frame. Without frames and another order of rotations, X stays as it is, to the bit.
#[derive(Clone, Debug, Default)]
pub struct Coordinates {
    frames: Option<Frames>,
    order: RotationOrder,
    /// Home of the platform and of the tool: X near which the angles are.
    homes: [[f64; 6]; 2],
    /// Text of what has these coordinates; empty without frames.
    pub label: String,
}

impl Coordinates {
    /// Coordinates of the tool of `frames` in its work frame, of the platform in the base frame without these. Their names are for
    /// the label.
    pub fn new(
        config: &Config,
        frames: Option<Frames>,
        names: [Option<&str>; 2],
        order: RotationOrder,
    ) -> Self {
        let home = frames.unwrap_or_default().tool_pose(&config.machine.home_pose());
        let home = order.coordinates(&home, &config.machine.home);
        let [tool, work] = names;
        let (tool, work) = (tool.unwrap_or("the platform"), work.unwrap_or("the base frame"));
        let label = frames.map_or_else(String::new, |_| format!("coordinates of {tool} in {work}"));
        Self { frames, order, homes: [config.machine.home, home], label }
    }

    /// Whether X describes the platform in the base frame.
    pub fn is_empty(&self) -> bool {
        self.frames.is_none()
    }

    /// The tool frame and the work frame.
    pub fn frames(&self) -> Frames {
        self.frames.unwrap_or_default()
    }

    /// X of the tool in the work frame.
    pub fn tool_x(&self, platform: &[f64; 6]) -> [f64; 6] {
        let [_, home] = &self.homes;
        if self.is_x() {
            return *platform;
        }
        self.order.coordinates(&self.frames().tool_pose(&pose_of(platform)), home)
    }

    /// X of the platform in the base frame.
    pub fn platform_x(&self, tool: &[f64; 6]) -> [f64; 6] {
        let [home, _] = &self.homes;
        if self.is_x() {
            return *tool;
        }
        let pose = self.order.motion(&TaskState::at_rest(*tool)).pose;
        task_coordinates(&self.frames().platform_pose(&pose), home)
    }

    fn is_x(&self) -> bool {
        self.frames.is_none() && self.order == RotationOrder::Xyz
    }

    /// A status report with the coordinates and errors of the tool.
    pub fn report(&self, report: &StatusReport) -> StatusReport {
        let Some(frames) = self.frames else { return report.clone() };
        let in_work = |x: Option<[f64; 6]>| x.map(|x| self.tool_x(&x));
        let error = report.pose.zip(report.orientation_error_rad).zip(report.position_error_m);
        let error = error.map(|((pose, angular), linear)| {
            let pose = pose_of(&pose);
            let reference = pose.displaced(&Twist { angular: angular.into(), linear: linear.into() });
            frames.tool_pose(&pose).displacement_to(&frames.tool_pose(&reference))
        });
        StatusReport {
            pose: in_work(report.pose),
            setpoint: in_work(report.setpoint),
            target: in_work(report.target),
            orientation_error_rad: error.map(|error| error.angular.into()),
            position_error_m: error.map(|error| error.linear.into()),
            ..report.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../config/fried2008.toml");
    const FRAMES: &str = "[[frame]]\nname = 'vertex'\nkind = 'tool'\npose = [0, 0, 0, 0.35, 0, 0]\n\
                          [[frame]]\nname = 'optics'\nkind = 'work'\npose = [0, 0, 1.5707963267948966, 1, 0, 0]\n";

    fn config() -> Config {
        Config::parse(&format!("{MACHINE}\n{FRAMES}"), "a test").unwrap()
    }

    fn coordinates(tool: Option<&str>, work: Option<&str>) -> Coordinates {
        let config = config();
        let frames = config.frames_named(tool, work).unwrap();
        let frames = (tool.is_some() || work.is_some()).then_some(frames);
        Coordinates::new(&config, frames, [tool, work], RotationOrder::Xyz)
    }

    #[test]
    fn coordinates_are_those_of_the_tool_in_the_work_frame() {
        let coordinates = coordinates(Some("vertex"), Some("optics"));
        assert_eq!(coordinates.label, "coordinates of vertex in optics");
        // Home is 1.1 m along x; x of the base is -y of the work frame, whose origin is 1 m along it.
        let home = coordinates.tool_x(&[0.0, 0.0, 0.0, 1.1, 0.0, 0.0]);
        let wanted = [0.0, 0.0, -core::f64::consts::FRAC_PI_2, 0.0, -0.45, 0.0];
        assert!(home.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-15), "{home:?}");
        let x = [0.1, -0.2, 0.3, 0.01, -0.4, 0.05];
        assert!(
            coordinates.tool_x(&coordinates.platform_x(&x)).iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-14)
        );
    }

    #[test]
    fn a_report_has_the_error_of_the_tool() {
        let report = StatusReport {
            pose: Some([0.0, 0.0, 0.0, 1.1, 0.0, 0.0]),
            position_error_m: Some([0.0; 3]),
            orientation_error_rad: Some([0.0, 0.0, 1e-3]),
            ..StatusReport::default()
        };
        // Turned by a milliradian about z of the base: the tool goes 0.35 mm along y of the base, which is x of the work frame.
        let found = coordinates(Some("vertex"), Some("optics")).report(&report);
        let [x, y, z] = found.position_error_m.unwrap();
        assert!((x - 0.35e-3).abs() < 1e-9 && y.abs() < 1e-6 && z == 0.0, "{x} {y} {z}");
        assert!((found.orientation_error_rad.unwrap()[2] - 1e-3).abs() < 1e-12);
        assert_eq!(found.setpoint, None);
        assert_eq!(format!("{:?}", coordinates(None, None).report(&report)), format!("{report:?}"));
    }
}
