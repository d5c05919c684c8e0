#!/usr/bin/env python3
"""Reference inverse dynamics of a Gough-Stewart platform (6-UPS hexapod) from first principles.

This is an oracle for tests. It holds no formula for the velocity, acceleration or force of a leg. All it states is
where every body is, as a function of the pose: the rest follows from differences with a step of 1e-20 at 80 digits
and from d'Alembert's principle. It needs Python 3.11 or newer and mpmath.

Method
    path          X(t) = X + Xd t + Xdd t^2 / 2, X = [alpha beta gamma x y z], R = Rx(alpha) Ry(beta) Rz(gamma)
    bodies        the platform; per leg a cylinder (centre of mass e1 from A along the leg) and a rod (e2 from B back
                  toward A). A universal joint at A orients both: first axis u fixed in the base, second axis
                  perpendicular to u and to the leg n. Body axes: n, y / |y| with y = u - (u.n) n, and their product.
    derivatives   p' = m x'' from positions, w from S' S^T of the body axes S, H = I w, H' from differences of H
    d'Alembert    for six virtual twists of the platform (rotation about C, displacement of C):
                  sum over bodies of (p' - m g) . dx + H' . dphi = sum over legs of Gamma_i dL_i;  6 x 6 solved for Gamma
    actuators     plus reflected_mass L'' + viscous L' + coulomb sign(L')

Conventions
    inertia       xy, xz, yz are elements of the inertia tensor about the centre of mass, in platform axes
    spin          the legs turn about their own axes as the universal joint forces them to ("force");
                  "force_no_spin" is the same with both axial moments of inertia set to zero
    variable rod  transverse inertia c + q (L - l0)^2 is taken at the sampled length and held there while
                  differentiating: no terms in dI/dt or dI/dL (see --verify, which reports what they would be worth)

Every input (parameters of the machine, X, Xd, Xdd) is a double and is taken as that exact number; every output is the
nearest double to the result, printed with the fewest digits that read back the same.

Modes
    make_vectors.py MACHINE.toml --output MACHINE.csv --seed N [ranges]   draw states about home, write vectors
    make_vectors.py MACHINE.toml --verify MACHINE.csv [--every K]         compare; exit 1 if beyond 1e-14
    make_vectors.py MACHINE.toml --home                                   validate the machine, print its state at home

States are drawn evenly from home +- range (one number for all three axes, or three). Rejected and drawn again are states
whose length or rate leaves [actuator], whose N = [b x n ; n] is worse conditioned than --max-condition or has
changed the sign of its determinant since home, whose leg comes within asin(0.1) of its universal joint's first axis, or
whose legs move slower than --min-length-rate-mm-s.

fried2008, tsai2000 and motion_base come from another author's generator; this script reproduces them with --verify. The
others were written with

    python make_vectors.py ceiling.toml --output ceiling.csv --seed 101 --angle-deg 12 --position-mm 120 --angle-rate-deg-s 45 --velocity-mm-s 600 --angle-accel-deg-s2 350 --accel-mm-s2 6000
    python make_vectors.py tilted.toml --output tilted.csv --seed 102 --angle-deg 12 --position-mm 100 --angle-rate-deg-s 45 --velocity-mm-s 600 --angle-accel-deg-s2 350 --accel-mm-s2 6000
    python make_vectors.py scattered.toml --output scattered.csv --seed 103 --angle-deg 10 --position-mm 80 --angle-rate-deg-s 40 --velocity-mm-s 500 --angle-accel-deg-s2 300 --accel-mm-s2 5000 --min-length-rate-mm-s 2.5
    python make_vectors.py sideways_x_up.toml --output sideways_x_up.csv --seed 104 --angle-deg 12 --position-mm 120 --angle-rate-deg-s 60 --velocity-mm-s 700 --angle-accel-deg-s2 500 --accel-mm-s2 8000
    python make_vectors.py tabletop.toml --output tabletop.csv --seed 105 --angle-deg 4 --position-mm 5 --angle-rate-deg-s 60 --velocity-mm-s 100 --angle-accel-deg-s2 6000 --accel-mm-s2 20000
    python make_vectors.py telescope.toml --output telescope.csv --seed 106 --angle-deg 0.5 --position-mm 6 --angle-rate-deg-s 0.05 --velocity-mm-s 2 --angle-accel-deg-s2 0.2 --accel-mm-s2 10
    python make_vectors.py gimbal.toml --output gimbal.csv --seed 107 --angle-deg 12 --position-mm 80 --angle-rate-deg-s 30 --velocity-mm-s 300 --angle-accel-deg-s2 150 --accel-mm-s2 3000
"""

import argparse
import csv
import random
import sys
import time
import tomllib

from mpmath import mp, mpf

mp.dps = 80
STEP = mpf(10) ** -20  # both truncation and rounding stay near 1e-40
AXES = ("alpha", "beta", "gamma", "x", "y", "z")
LEGS = range(6)
VERIFY_TOLERANCE = mpf("1e-14")
MIN_SINE_TO_FIRST_AXIS = 0.1


# --- three-vectors and 3 x 3 matrices as tuples; a matrix is a tuple of its columns --------------------------------

def add(a, b):
    return tuple(x + y for x, y in zip(a, b))


def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def scale(k, a):
    return tuple(k * x for x in a)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a):
    return mp.sqrt(dot(a, a))


def unit(a):
    return scale(1 / norm(a), a)


def apply(columns, a):
    return tuple(sum(columns[k][i] * a[k] for k in range(3)) for i in range(3))


def apply_transposed(columns, a):
    return tuple(dot(column, a) for column in columns)


def multiply(a, b):
    return tuple(apply(a, column) for column in b)


def rotation(axis, angle):
    """Rotation about coordinate axis 0, 1 or 2."""
    c, s = mp.cos(angle), mp.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    columns = [[mpf(0)] * 3 for _ in range(3)]
    columns[axis][axis] = mpf(1)
    columns[j][j], columns[j][k] = c, s
    columns[k][j], columns[k][k] = -s, c
    return tuple(tuple(column) for column in columns)


def small_rotation(before, after, at):
    """Rotation vector of (after - before) at^T, to first order: the vector of its antisymmetric part."""
    total = (mpf(0),) * 3
    for b, a, m in zip(before, after, at):
        total = add(total, cross(m, sub(a, b)))
    return scale(mpf(1) / 2, total)


# --- the machine ---------------------------------------------------------------------------------------------------

def vector(values):
    return tuple(mpf(float(v)) for v in values)


def number(table, key, default=None):
    return mpf(float(table[key] if default is None else table.get(key, default)))


class Machine:
    def __init__(self, path):
        with open(path, "rb") as file:
            data = tomllib.load(file)
        self.name = data["name"]
        self.gravity = vector(data["gravity_m_s2"])
        platform = data["platform"]
        self.mass = number(platform, "mass_kg")
        self.center_of_mass = vector(platform["center_of_mass_m"])
        i = platform["inertia_kg_m2"]
        xx, yy, zz = (number(i, k) for k in ("xx", "yy", "zz"))
        xy, xz, yz = (number(i, k, 0.0) for k in ("xy", "xz", "yz"))
        self.inertia = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
        self.cylinder, self.rod = data["cylinder"], data["rod"]
        actuator = data["actuator"]
        self.min_length = number(actuator, "min_length_m")
        self.max_length = number(actuator, "max_length_m")
        self.max_rate = number(actuator, "max_rate_m_s")
        self.max_force = number(actuator, "max_force_n")
        self.reflected_mass = number(actuator, "reflected_mass_kg", 0.0)
        self.viscous = number(actuator, "viscous_friction_n_s_m", 0.0)
        self.coulomb = number(actuator, "coulomb_friction_n", 0.0)
        self.home = [float(v) for v in data["home"]["pose"]]
        legs = data["leg"]
        assert len(legs) == 6, "six legs"
        self.base = [vector(leg["base_m"]) for leg in legs]
        self.platform = [vector(leg["platform_m"]) for leg in legs]
        self.universal_axis = [unit(vector(leg.get("universal_axis", (0, 1, 0)))) for leg in legs]


def transverse_inertia(body, length):
    value = body["transverse_inertia_kg_m2"]
    if not isinstance(value, dict):
        return mpf(float(value))
    c, q, l0 = (number(value, k) for k in ("constant_kg_m2", "quadratic_kg", "reference_length_m"))
    return c + q * (length - l0) ** 2


# --- where everything is: the only statements about geometry ----------------------------------------------------------

def platform_pose(state, t):
    """Platform axes (columns, in base axes) and origin at time t on the path through the state."""
    x, xd, xdd = state
    at = [p + v * t + a * t * t / 2 for p, v, a in zip(x, xd, xdd)]
    r = multiply(multiply(rotation(0, at[0]), rotation(1, at[1])), rotation(2, at[2]))
    return r, tuple(at[3:])


class Configuration:
    """Axes and centres of mass of the thirteen bodies, and the six lengths, at one pose of the platform."""

    def __init__(self, machine, r, c):
        self.lengths, self.axes, self.centers = [], [r], [add(c, apply(r, machine.center_of_mass))]
        e1 = number(machine.cylinder, "center_of_mass_m")
        e2 = number(machine.rod, "center_of_mass_m")
        for a, b, u in zip(machine.base, machine.platform, machine.universal_axis):
            joint = add(c, apply(r, b))
            leg = sub(joint, a)
            length = norm(leg)
            n = scale(1 / length, leg)
            y = unit(sub(u, scale(dot(u, n), n)))
            axes = (n, y, cross(n, y))
            self.lengths.append(length)
            self.axes += [axes, axes]
            self.centers += [add(a, scale(e1, n)), sub(joint, scale(e2, n))]


def body_properties(machine, lengths, axial):
    """(mass, inertia about the centre of mass in body axes) of the bodies, in the order of Configuration."""
    bodies = [(machine.mass, machine.inertia)]
    for length in lengths:
        for body in (machine.cylinder, machine.rod):
            ia = number(body, "axial_inertia_kg_m2") if axial else mpf(0)
            it = transverse_inertia(body, length)
            bodies.append((number(body, "mass_kg"), ((ia, mpf(0), mpf(0)), (mpf(0), it, mpf(0)), (mpf(0), mpf(0), it))))
    return bodies


# --- d'Alembert -------------------------------------------------------------------------------------------------------

def virtual_displacements(machine, r, c):
    """Six twists about C, angular first. Of each: (dx, dphi) of the thirteen bodies, and dL of the six legs."""
    now = Configuration(machine, r, c)
    result = []
    for k in range(6):
        ends = []
        for h in (-STEP, STEP):
            if k < 3:
                moved = Configuration(machine, multiply(rotation(k, h), r), c)
            else:
                moved = Configuration(machine, r, tuple(x + (h if i == k - 3 else 0) for i, x in enumerate(c)))
            ends.append(moved)
        before, after = ends
        half = 1 / (2 * STEP)
        dx = [scale(half, sub(a, b)) for a, b in zip(after.centers, before.centers)]
        dphi = [scale(half, small_rotation(b, a, m)) for a, b, m in zip(after.axes, before.axes, now.axes)]
        dl = [half * (a - b) for a, b in zip(after.lengths, before.lengths)]
        result.append((dx, dphi, dl))
    return result


class Reference:
    """Everything the vectors hold, for one state (X, Xd, Xdd), in mpmath."""

    def __init__(self, machine, state, hold_inertia=True):
        state = [[mpf(v) for v in part] for part in state]
        h = STEP
        self.machine = machine
        self.path = [Configuration(machine, *platform_pose(state, k * h)) for k in range(-2, 3)]
        lengths = [c.lengths for c in self.path]
        self.length = lengths[2]
        self.rate = [(lengths[3][i] - lengths[1][i]) / (2 * h) for i in LEGS]
        self.accel = [(lengths[3][i] - 2 * lengths[2][i] + lengths[1][i]) / h**2 for i in LEGS]
        self.virtual = virtual_displacements(machine, *platform_pose(state, mpf(0)))
        # row k: dL of virtual twist k, which is N = [b x n ; n] by definition of virtual work
        self.n_matrix = mp.matrix([dl for _, _, dl in self.virtual])
        self.hold_inertia = hold_inertia

    def momentum_rates(self, axial):
        """(m x'' - m g, H') of every body."""
        h, path = STEP, self.path
        held = [2, 2] if self.hold_inertia else [1, 3]
        spins = []
        for at, source in zip((1, 3), held):
            bodies = body_properties(self.machine, path[source].lengths, axial)
            now = path[at]
            row = []
            for k, (_, inertia) in enumerate(bodies):
                s = now.axes[k]
                w = scale(1 / (2 * h), small_rotation(path[at - 1].axes[k], path[at + 1].axes[k], s))
                row.append(apply(s, apply(inertia, apply_transposed(s, w))))
            spins.append(row)
        rates = []
        for k, (mass, _) in enumerate(bodies):
            x0, x1, x2 = (path[j].centers[k] for j in (1, 2, 3))
            acceleration = scale(1 / h**2, add(sub(x2, x1), sub(x0, x1)))
            force = scale(mass, sub(acceleration, self.machine.gravity))
            rates.append((force, scale(1 / (2 * h), sub(spins[1][k], spins[0][k]))))
        return rates

    def forces(self, axial=True):
        rates = self.momentum_rates(axial)
        work = [
            sum(dot(f, x) + dot(m, p) for (f, m), x, p in zip(rates, dx, dphi))
            for dx, dphi, _ in self.virtual
        ]
        gamma = mp.lu_solve(self.n_matrix, mp.matrix(work))
        m = self.machine
        return [
            gamma[i] + m.reflected_mass * self.accel[i] + m.viscous * self.rate[i] + m.coulomb * mp.sign(self.rate[i])
            for i in LEGS
        ]

    def outputs(self):
        """The columns from force_1 on."""
        return [*self.forces(True), *self.forces(False), *self.length, *self.rate, *self.accel]

    def sine_to_first_axis(self):
        """Smallest sine of the angle between a leg and the first axis of its universal joint."""
        return min(norm(cross(self.path[2].axes[1 + 2 * i][0], self.machine.universal_axis[i])) for i in LEGS)


def condition_number(matrix):
    with mp.workdps(30):
        s = mp.svd_r(matrix, compute_uv=False)
        return s[0] / s[5]


# --- checks ---------------------------------------------------------------------------------------------------------

def problems_of_machine(machine):
    """What is physically wrong with the machine: empty if nothing."""
    found = []
    with mp.workdps(30):
        a, b, c = sorted(mp.eigsy(mp.matrix(machine.inertia), eigvals_only=True))
    if a <= 0 or a + b < c * (1 - mpf("1e-12")):
        found.append("platform inertia breaks the triangle inequality")
    for name, body in (("cylinder", machine.cylinder), ("rod", machine.rod)):
        axial = number(body, "axial_inertia_kg_m2")
        for length in (machine.min_length, machine.max_length):
            if axial < 0 or 2 * transverse_inertia(body, length) < axial or transverse_inertia(body, length) <= 0:
                found.append(f"{name} inertia is that of no body of revolution")
        if number(body, "mass_kg") <= 0 or not 0 <= number(body, "center_of_mass_m") <= machine.max_length:
            found.append(f"{name} mass or centre of mass")
    if machine.mass <= 0:
        found.append("platform mass")
    return found


def reason_to_reject(reference, home_sign, limits):
    m = reference.machine
    if any(not m.min_length < length < m.max_length for length in reference.length):
        return "length"
    if any(abs(rate) > m.max_rate for rate in reference.rate):
        return "rate"
    if any(abs(rate) < mpf(limits.min_length_rate_mm_s) / 1000 for rate in reference.rate):
        return "slow leg"
    if mp.sign(mp.det(reference.n_matrix)) != home_sign:
        return "other side of a singularity"
    if condition_number(reference.n_matrix) > limits.max_condition:
        return "condition"
    if reference.sine_to_first_axis() < MIN_SINE_TO_FIRST_AXIS:
        return "leg near first axis"
    return None


# --- modes ------------------------------------------------------------------------------------------------------------

def columns():
    names = ["t", *AXES, *(a + "_rate" for a in AXES), *(a + "_accel" for a in AXES)]
    for quantity in ("force", "force_no_spin", "length", "length_rate", "length_accel"):
        names += [f"{quantity}_{i + 1}" for i in LEGS]
    return names


def at_home(machine):
    return Reference(machine, (machine.home, [0.0] * 6, [0.0] * 6))


def show_home(machine):
    home = at_home(machine)
    for problem in problems_of_machine(machine):
        print("PROBLEM:", problem)
    print("lengths  ", [mp.nstr(v, 6) for v in home.length],
          "within", mp.nstr(machine.min_length), mp.nstr(machine.max_length))
    print("forces   ", [mp.nstr(v, 6) for v in home.forces()])
    print("condition", mp.nstr(condition_number(home.n_matrix), 6), "  det", mp.nstr(mp.det(home.n_matrix), 4),
          "  sine to first axis", mp.nstr(home.sine_to_first_axis(), 4))


def three(values, factor):
    values = values * 3 if len(values) == 1 else values
    assert len(values) == 3, "a range is one number or three"
    return [v * factor for v in values]


def draw(machine, source, limits):
    """A state about home, as doubles."""
    degree = float(mp.pi) / 180.0
    x = three(limits.angle_deg, degree) + three(limits.position_mm, 1e-3)
    xd = three(limits.angle_rate_deg_s, degree) + three(limits.velocity_mm_s, 1e-3)
    xdd = three(limits.angle_accel_deg_s2, degree) + three(limits.accel_mm_s2, 1e-3)
    return (
        [h + source.uniform(-r, r) for h, r in zip(machine.home, x)],
        [source.uniform(-r, r) for r in xd],
        [source.uniform(-r, r) for r in xdd],
    )


def write(machine, limits):
    found = problems_of_machine(machine)
    if found:
        sys.exit("; ".join(found))
    source = random.Random(limits.seed)
    home_sign = mp.sign(mp.det(at_home(machine).n_matrix))
    rows, rejected, worst_force, worst_condition, worst_sine, spin = [], {}, 0, 0, 1, 0
    start = time.monotonic()
    while len(rows) < limits.rows:
        state = draw(machine, source, limits)
        reference = Reference(machine, state)
        reason = reason_to_reject(reference, home_sign, limits)
        if reason:
            rejected[reason] = rejected.get(reason, 0) + 1
            assert sum(rejected.values()) < 100 * limits.rows, rejected
            continue
        out = reference.outputs()
        largest = max(abs(f) for f in out[:6])
        worst_force = max(worst_force, largest)
        worst_condition = max(worst_condition, condition_number(reference.n_matrix))
        worst_sine = min(worst_sine, reference.sine_to_first_axis())
        spin = max(spin, max(abs(a - b) for a, b in zip(out[:6], out[6:12])) / largest)
        rows.append([len(rows) / 1000, *state[0], *state[1], *state[2], *(float(v) for v in out)])
    with open(limits.output, "w", encoding="ascii", newline="\n") as file:
        for line in (columns(), *([repr(v) for v in row] for row in rows)):
            file.write(",".join(line) + "\n")
    print(f"{machine.name}: {len(rows)} rows, {time.monotonic() - start:.1f} s, rejected {rejected or 'none'}")
    print(f"  condition up to {mp.nstr(worst_condition, 4)}, force up to {mp.nstr(worst_force, 5)} N"
          f" (limit {mp.nstr(machine.max_force)}), spin up to {mp.nstr(spin, 3)} of the row's largest force,"
          f" sine to first axis down to {mp.nstr(worst_sine, 3)}")
    if worst_force > machine.max_force:
        sys.exit("a force exceeds max_force_n")


def verify(machine, path, every):
    """Largest differences, each relative to the row's largest value of that quantity."""
    with open(path, encoding="ascii", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == columns(), "columns"
    groups = {"force": 19, "force_no_spin": 25, "length": 31, "length_rate": 37, "length_accel": 43}
    worst = dict.fromkeys(groups, mpf(0))
    equal = total = 0
    spin = variable = mpf(0)
    start = time.monotonic()
    for row in rows[::every]:
        values = [float(row[c]) for c in columns()]
        state = (values[1:7], values[7:13], values[13:19])
        reference = Reference(machine, state)
        out = reference.outputs()
        largest_force = max(abs(f) for f in out[:6])
        for name, at in groups.items():
            ours, theirs = out[at - 19:at - 13], values[at:at + 6]
            largest = largest_force if name.startswith("force") else max(abs(v) for v in ours)
            worst[name] = max(worst[name], *(abs(a - b) / largest for a, b in zip(ours, theirs)))
            equal += sum(float(a) == b for a, b in zip(ours, theirs))
            total += 6
        spin = max(spin, *(abs(a - b) / largest_force for a, b in zip(out[:6], out[6:12])))
        moving = Reference(machine, state, hold_inertia=False).forces()
        variable = max(variable, *(abs(a - b) / largest_force for a, b in zip(out[:6], moving)))
    seconds = time.monotonic() - start
    count = len(rows[::every])
    print(f"{machine.name}: {count} of {len(rows)} rows, {seconds / count:.2f} s per row;"
          f" {equal} of {total} values are the same double")
    for name, value in worst.items():
        print(f"  {name:14} {mp.nstr(value, 3)}")
    print(f"  worth of the leg spin {mp.nstr(spin, 3)}, of dI/dt in H' (not in the vectors) {mp.nstr(variable, 3)}")
    if max(worst.values()) > VERIFY_TOLERANCE:
        sys.exit(f"beyond {mp.nstr(VERIFY_TOLERANCE)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("machine")
    mode = parser.add_mutually_exclusive_group(required=True)
    mode.add_argument("--output")
    mode.add_argument("--verify")
    mode.add_argument("--home", action="store_true")
    parser.add_argument("--every", type=int, default=1, help="verify one row in so many")
    parser.add_argument("--rows", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--max-condition", type=float, default=1e6)
    parser.add_argument("--min-length-rate-mm-s", type=float, default=0.0)
    for name, default in (("angle-deg", 10.0), ("position-mm", 100.0), ("angle-rate-deg-s", 40.0),
                          ("velocity-mm-s", 500.0), ("angle-accel-deg-s2", 300.0), ("accel-mm-s2", 5000.0)):
        parser.add_argument("--" + name, type=float, nargs="+", default=[default])
    arguments = parser.parse_args()
    machine = Machine(arguments.machine)
    if arguments.home:
        show_home(machine)
    elif arguments.verify:
        verify(machine, arguments.verify, arguments.every)
    else:
        write(machine, arguments)


if __name__ == "__main__":
    main()
