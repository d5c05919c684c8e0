// The figures: what is drawn of which signals, with names and units.

const AXES = ["x", "y", "z"];
const LEGS = ["leg 1", "leg 2", "leg 3", "leg 4", "leg 5", "leg 6"];

// { label with unit, names of the components, signal, the reference it is compared with, and digits after the point of its resolution }
const FIGURES = [
  { title: HEAD.coordinates ? `Pose: ${HEAD.coordinates}` : "Pose of the platform", panels: [
    { label: "angle [deg]", names: ["alpha", "beta", "gamma"], signal: "angle", reference: "angle_ref", digits: HEAD.machine.deg_digits },
    { label: "position [m]", names: AXES, signal: "position", reference: "position_ref", digits: HEAD.machine.m_digits },
  ] },
  { title: "Velocity of the platform", panels: [
    { label: "angular velocity [deg/s]", names: AXES, signal: "angular_velocity", reference: "angular_velocity_ref" },
    { label: "velocity [m/s]", names: AXES, signal: "velocity", reference: "velocity_ref" },
  ] },
  { title: "Acceleration of the platform (differences of the velocity)", panels: [
    { label: "angular acceleration [deg/s²]", names: AXES, signal: "angular_acceleration", reference: "angular_acceleration_ref" },
    { label: "acceleration [m/s²]", names: AXES, signal: "acceleration", reference: "acceleration_ref" },
  ] },
  { title: "Lengths of the legs", panels: [
    { label: "length [m]", names: LEGS, signal: "length", reference: "length_ref", digits: HEAD.machine.m_digits },
  ] },
  { title: "Velocities of the legs", panels: [
    { label: "velocity [m/s]", names: LEGS, signal: "leg_rate", reference: "leg_rate_ref" },
  ] },
  { title: "Accelerations of the legs (differences of the velocity)", panels: [
    { label: "acceleration [m/s²]", names: LEGS, signal: "leg_acceleration", reference: "leg_acceleration_ref" },
  ] },
  { title: "Actuator forces, and by inverse dynamics of the reference", panels: [
    { label: "force [N]", names: LEGS, signal: "force", reference: "force_ref" },
    { label: "difference [N]", names: LEGS, signal: "force_difference" },
  ] },
  { title: "Tracking error: reference less estimated platform", panels: [
    { label: "position [m]", names: ["distance"], signal: "position_error" },
    { label: "orientation [rad]", names: ["angle"], signal: "orientation_error", color: 1 },
  ] },
  { title: "Timing of the cycles", panels: [
    { label: "wake-up [s]", names: [HEAD.is_live ? "wake-up, largest in 1 s" : "wake-up"], signal: "wakeup", color: 0 },
    { label: "computation [s]", names: [HEAD.is_live ? "compute, largest in 1 s" : "compute"], signal: "compute", color: 1 },
    { label: "age of the measurement [s]", names: ["measurement"], signal: "measured_age", color: 2 },
    { label: "age of the setpoint [s]", names: ["setpoint"], signal: "setpoint_age", color: 3 },
  ] },
  { title: "Condition of the pose", panels: [
    { label: "condition", names: ["condition"], signal: "condition", color: 4 },
  ] },
];
