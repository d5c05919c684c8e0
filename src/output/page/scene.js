// The platform in 3D: base, legs, platform, its reference, forces as arrows.

const scene = document.getElementById("scene");
// Direction of the eye [rad], and size of the machine in the picture.
const eye = { turn: -0.65, rise: 0.42, size: 1 };
const EYE_DISTANCE = 4;
// Longest arrow as a share of the size of the machine.
const LONGEST_ARROW = 0.38;

const add = (a, b, scale = 1) => a.map((number, k) => number + scale * b[k]);
const dot = (a, b) => a.reduce((sum, number, k) => sum + number * b[k], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((number) => number / (Math.sqrt(dot(a, a)) || 1));

// R = Rx(alpha) Ry(beta) Rz(gamma), row by row; angles in degrees.
function rotation(angles) {
  const [[sa, ca], [sb, cb], [sg, cg]] = angles.map((deg) => [Math.sin((deg * Math.PI) / 180), Math.cos((deg * Math.PI) / 180)]);
  return [
    [cb * cg, -cb * sg, sb],
    [ca * sg + sa * sb * cg, ca * cg - sa * sb * sg, -sa * cb],
    [sa * sg - ca * sb * cg, sa * cg + ca * sb * sg, ca * cb],
  ];
}

// Joints of the platform in base axes.
function placed(angles, position) {
  const rows = rotation(angles);
  return HEAD.machine.platform.map((joint) => add(position, rows.map((row) => dot(row, joint))));
}

// Up is against gravity; without gravity it is z.
const up = (() => {
  const { gravity } = HEAD.machine;
  const size = Math.sqrt(dot(gravity, gravity));
  return size > 0 ? gravity.map((number) => -number / size) : [0, 0, 1];
})();
const home = placed(HEAD.machine.home.slice(0, 3).map((rad) => (rad * 180) / Math.PI), HEAD.machine.home.slice(3));
const joints = HEAD.machine.base.concat(home);
const middle = joints.reduce((sum, joint) => add(sum, joint, 1 / joints.length), [0, 0, 0]);
const extent = Math.max(...joints.map((joint) => Math.sqrt(dot(add(joint, middle, -1), add(joint, middle, -1)))));

// Largest force of the recording, for the length of the arrows [N].
let largestForce = 0;
function findLargestForce() {
  const coarsest = levels.reduce((a, b) => (b.samples > 0 && b.step > a.step ? b : a), levels[0]);
  for (let leg = 0; leg < 6 && coarsest; leg++) {
    const column = coarsest.columns[HEAD.columns.force + leg];
    for (let k = 0; k < coarsest.samples; k++) {
      if (Math.abs(column[k]) > largestForce) largestForce = Math.abs(column[k]);
    }
  }
  const text = largestForce > 0 ? quantityText(largestForce, "N") : "no force";
  document.getElementById("scale").textContent = text;
}

// A function from base axes to points of the picture.
function projection(width, height) {
  const right0 = unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
  const front0 = cross(right0, up);
  const level = add(front0.map((n) => n * Math.cos(eye.turn)), right0, Math.sin(eye.turn));
  const back = add(level.map((n) => n * Math.cos(eye.rise)), up, Math.sin(eye.rise));
  const right = unit(cross(up, back));
  const above = cross(back, right);
  const pixels = (0.4 * Math.min(width, height) * eye.size) / extent;
  return (point) => {
    const from = add(point, middle, -1);
    const scale = pixels / (1 - dot(from, back) / (EYE_DISTANCE * extent));
    return [width / 2 + dot(from, right) * scale, height * 0.54 - dot(from, above) * scale];
  };
}

// Joints in the order in which an outline goes around them.
function outline(points) {
  const center = points.reduce((sum, point) => add(sum, point, 1 / points.length), [0, 0, 0]);
  const first = unit(add(points[0], center, -1));
  const normal = unit(points.map((p, k) => cross(add(p, center, -1), add(points[(k + 1) % points.length], center, -1)))
    .reduce((sum, it) => add(sum, it, dot(sum, it) < 0 ? -1 : 1), [0, 0, 0]));
  const second = cross(normal, first);
  const angle = (p) => Math.atan2(dot(add(p, center, -1), second), dot(add(p, center, -1), first));
  return points.slice().sort((a, b) => angle(a) - angle(b));
}

function path(pen, points, isClosed) {
  pen.beginPath();
  points.forEach(([x, y], k) => (k === 0 ? pen.moveTo(x, y) : pen.lineTo(x, y)));
  if (isClosed) pen.closePath();
}

function arrow(pen, from, to, stroke) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const long = Math.hypot(dx, dy);
  if (long < 2) return;
  const [ux, uy] = [dx / long, dy / long];
  const head = Math.min(8, long);
  pen.strokeStyle = pen.fillStyle = stroke;
  pen.lineWidth = 2.5;
  path(pen, [from, [to[0] - ux * head, to[1] - uy * head]]);
  pen.stroke();
  path(pen, [to, [to[0] - ux * head - uy * head * 0.5, to[1] - uy * head + ux * head * 0.5],
    [to[0] - ux * head + uy * head * 0.5, to[1] - uy * head - ux * head * 0.5]], true);
  pen.fill();
}

function drawScene(sample) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [scene.clientWidth, scene.clientHeight];
  scene.width = Math.round(width * ratio);
  scene.height = Math.round(height * ratio);
  const pen = scene.getContext("2d");
  pen.scale(ratio, ratio);
  pen.lineJoin = pen.lineCap = "round";
  pen.font = "600 12px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  const project = projection(width, height);
  const [angles, position] = [signalAt(sample, "angle", 3), signalAt(sample, "position", 3)];
  const isKnown = angles.concat(position).every(Number.isFinite);
  const platform = isKnown ? placed(angles, position) : home;
  drawBase(pen, project);
  pen.globalAlpha = isKnown ? 1 : 0.35;
  platform.forEach((joint, leg) => {
    path(pen, [project(HEAD.machine.base[leg]), project(joint)]);
    pen.strokeStyle = color(`c${leg}`);
    pen.lineWidth = 4;
    pen.stroke();
  });
  path(pen, outline(platform).map(project), true);
  pen.fillStyle = color("plate");
  pen.strokeStyle = color("accent");
  pen.lineWidth = 2;
  pen.fill();
  pen.stroke();
  pen.globalAlpha = 1;
  drawReference(pen, project, sample);
  drawForces(pen, project, platform, signalAt(sample, "force", 6));
  describe(angles, position, isKnown);
}

function drawBase(pen, project) {
  path(pen, outline(HEAD.machine.base).map(project), true);
  pen.fillStyle = color("grid");
  pen.strokeStyle = color("steel");
  pen.lineWidth = 1.5;
  pen.fill();
  pen.stroke();
  const center = HEAD.machine.base.reduce((sum, joint) => add(sum, joint, 1 / 6), [0, 0, 0]);
  HEAD.machine.base.forEach((joint, leg) => {
    const [x, y] = project(add(joint, add(joint, center, -1), 0.16));
    pen.fillStyle = color(`c${leg}`);
    pen.fillText(String(leg + 1), x, y);
  });
  AXES.forEach((name, axis) => {
    const tip = [0, 0, 0].map((_, k) => (k === axis ? 0.3 * extent : 0));
    pen.strokeStyle = color("faint");
    pen.lineWidth = 1.2;
    path(pen, [project([0, 0, 0]), project(tip)]);
    pen.stroke();
    pen.fillStyle = color("faint");
    pen.fillText(name, ...project(tip.map((number) => 1.2 * number)));
  });
}

function drawReference(pen, project, sample) {
  const [angles, position] = [signalAt(sample, "angle_ref", 3), signalAt(sample, "position_ref", 3)];
  if (!angles.concat(position).every(Number.isFinite)) return;
  path(pen, outline(placed(angles, position)).map(project), true);
  pen.setLineDash([5, 4]);
  pen.strokeStyle = color("ink");
  pen.lineWidth = 1.2;
  pen.stroke();
  pen.setLineDash([]);
}

function drawForces(pen, project, platform, forces) {
  forces.forEach((force, leg) => {
    if (!Number.isFinite(force) || largestForce === 0) return;
    const along = unit(add(platform[leg], HEAD.machine.base[leg], -1));
    const tip = add(platform[leg], along, (LONGEST_ARROW * extent * force) / largestForce);
    arrow(pen, project(platform[leg]), project(tip), color(`c${leg}`));
  });
}

function describe(angles, position, isKnown) {
  const line = (names, numbers, unitName, digits) =>
    names.map((name, k) => `${name} ${fixed(numbers[k], digits)} ${unitName}`).join(", ");
  const { m_digits, deg_digits } = HEAD.machine;
  const millimetres = position.map((number) => 1000 * number);
  const pose = [line(AXES, millimetres, "mm", m_digits - 3), line(["alpha", "beta", "gamma"], angles, "°", deg_digits)];
  const shown = isKnown ? pose : ["pose unknown; drawn at home", ""];
  document.getElementById("pose").textContent = [...shown, intervalText(now)].join("\n");
}

// The view turns by dragging and by the arrow keys.
function watchScene(redraw) {
  let last = null;
  const turn = (byX, byY) => {
    eye.turn += byX;
    eye.rise = Math.max(-1.5, Math.min(1.5, eye.rise + byY));
    redraw();
  };
  scene.addEventListener("pointerdown", (event) => {
    last = [event.clientX, event.clientY];
    scene.setPointerCapture(event.pointerId);
  });
  scene.addEventListener("pointermove", (event) => {
    if (!last) return;
    turn(-(event.clientX - last[0]) * 0.01, (event.clientY - last[1]) * 0.01);
    last = [event.clientX, event.clientY];
  });
  scene.addEventListener("pointerup", () => { last = null; });
  scene.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    const sizes = { "+": 1.1, "-": 1 / 1.1 };
    if (sizes[event.key]) eye.size *= sizes[event.key];
    if (!turns[event.key] && !sizes[event.key]) return;
    event.preventDefault();
    turn(...(turns[event.key] || [0, 0]));
  });
}
