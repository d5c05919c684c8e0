//! The structs that are sent against the definitions of ROS 2: rclpy states the same type hashes (REP 2016).

use std::collections::BTreeMap;
use std::fs;

use serde_reflection::{ContainerFormat, Format, Named, Registry, Tracer, TracerConfig};

use crate::ros_messages as ros;
use crate::{not_run, python, rclpy};

/// Number of a type in a type description, and its name if it is none of the basic ones.
fn field_type(format: &Format) -> (u32, &str) {
    match format {
        Format::TypeName(name) => (1, name),
        Format::U8 => (3, ""),
        Format::I32 => (6, ""),
        Format::U32 => (7, ""),
        Format::F64 => (11, ""),
        Format::Bool => (15, ""),
        Format::Str => (17, ""),
        // Sequences without a bound.
        Format::Seq(element) => (field_type(element).0 + 144, field_type(element).1),
        other => panic!("{other:?} is not among the types of the messages"),
    }
}

/// Fields of each type: name, number of the type, name of the type.
fn fields<'r>(registry: &'r Registry) -> BTreeMap<&'r str, Vec<(&'r str, u32, &'r str)>> {
    let of_struct = |(name, container): (&'r str, &'r ContainerFormat)| {
        let ContainerFormat::Struct(fields) = container else { panic!("{name} is no struct") };
        let rows = fields.iter().map(|Named { name, value }| (name.as_str(), field_type(value)));
        (name, rows.map(|(name, (number, kind))| (name, number, kind)).collect())
    };
    registry.iter().map(|(name, container)| of_struct((name.as_str(), container))).collect()
}

#[test]
fn type_hashes_are_those_of_rclpy() {
    let environment = match rclpy() {
        Ok(environment) => environment,
        Err(why) => return not_run::lacking(&why),
    };
    let mut tracer = Tracer::new(TracerConfig::default());
    tracer.trace_simple_type::<ros::TfMessage>().unwrap();
    tracer.trace_simple_type::<ros::JointState>().unwrap();
    tracer.trace_simple_type::<ros::PoseStamped>().unwrap();
    tracer.trace_simple_type::<ros::TwistStamped>().unwrap();
    tracer.trace_simple_type::<ros::AccelStamped>().unwrap();
    tracer.trace_simple_type::<ros::MultiDofTrajectory>().unwrap();
    tracer.trace_simple_type::<ros::TriggerRequest>().unwrap();
    tracer.trace_simple_type::<ros::TriggerResponse>().unwrap();
    let registry = tracer.registry().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("types.json");
    fs::write(&file, serde_json::to_string(&fields(&registry)).unwrap()).unwrap();
    let mut command = std::process::Command::new(environment.join("bin/python"));
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/rclpy/type_hashes.py");
    let text = python::output(command.arg(script).arg(&file)).unwrap();
    // All but TFMessage, whose package is not on PyPI; its only field is one of the others.
    assert_eq!(text.lines().filter(|line| line.ends_with(" equal")).count(), registry.len() - 1, "{text}");
    assert!(text.contains("rclpy states 5 of them"), "{text}");
}
