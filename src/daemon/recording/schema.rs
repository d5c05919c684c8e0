//! Schemas in `ros2msg`: those of hexad's structs follow from their layouts, the others are those of ROS.

use core::fmt::Write as _;

use hexad_client::messages::layout::{Field, Kind, Layout};

/// Line between the parts of a schema.
const SEPARATOR: &str = "================================================================================";

/// Schema of the memory of the controller.
pub const MEMORY: (&str, &str) = (
    "hexad/msg/Memory",
    "# Memory of the controller before a cycle, for `hexad replay` of the same version.\nuint64 cycle\nuint8[] content\n",
);

/// Schema of frames.
pub const FRAMES: (&str, &str) = (
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/TransformStamped[] transforms
================================================================================
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
",
);

/// Schema of the legs.
pub const JOINTS: (&str, &str) = (
    "sensor_msgs/msg/JointState",
    "std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
",
);

/// Name and text of the schema of a struct, with those of the structs in it.
pub fn of_layout(layout: &'static Layout) -> (String, String) {
    let mut text = fields(layout);
    let mut parts: Vec<&'static Layout> = vec![];
    nested(layout, &mut parts);
    for part in parts {
        let _ = write!(text, "{SEPARATOR}\nMSG: hexad/{}\n{}", part.class(), fields(part));
    }
    (format!("hexad/msg/{}", layout.class()), text)
}

fn nested(layout: &'static Layout, found: &mut Vec<&'static Layout>) {
    for field in layout.fields {
        if let Kind::Struct(part) = field.kind
            && found.iter().all(|other| other.type_name != part.type_name)
        {
            found.push(part);
            nested(part, found);
        }
    }
}

fn fields(layout: &Layout) -> String {
    let mut text = String::new();
    for Field { name: field, kind, count, unit, doc, .. } in layout.fields {
        let kind = match kind {
            Kind::U32 => "uint32".into(),
            Kind::U64 => "uint64".into(),
            Kind::F64 => "float64".into(),
            Kind::Struct(part) => format!("hexad/{}", part.class()),
        };
        let count = count.map_or_else(String::new, |count| format!("[{count}]"));
        let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
        let _ = writeln!(text, "#{doc}{unit}\n{kind}{count} {field}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexad_client::messages::CycleMessage;
    use hexad_client::messages::layout::Declared as _;

    #[test]
    fn the_schema_of_a_cycle_names_every_field_with_type_unit_and_meaning() {
        let (name, text) = of_layout(&CycleMessage::LAYOUT);
        assert_eq!(name, "hexad/msg/Cycle");
        assert!(text.starts_with("# Number of the cycle, from 1.\nuint64 cycle\n"), "{text}");
        for part in [
            "# Gamma. [N]\nfloat64[6] force_n\n",
            "hexad/Diagnostic request_diagnostic\n",
            "=\nMSG: hexad/Diagnostic\n",
        ] {
            assert_eq!(text.matches(part).count(), 1, "{part}: {text}");
        }
    }
}
