//! Energy of the machine, body by body: positions, velocities and angular velocities, nothing else.

use super::*;

/// Energies \[J\].
#[derive(Clone, Copy, Debug, Default)]
pub struct Energy {
    /// Of everything that moves, the spin of the legs and reflected masses included.
    pub kinetic: f64,
    /// Of which the legs' turning about their own axes.
    pub spin: f64,
    pub potential: f64,
}

impl Energy {
    pub fn total(&self) -> f64 {
        self.kinetic + self.potential
    }
}

/// Energy of the thirteen bodies.
pub fn energy(machine: &Machine, state: &BodyState) -> Energy {
    let (r, c) = (state.pose.rotation, state.pose.position);
    let (omega, v) = (state.twist.angular, state.twist.linear);
    let body = &machine.platform;
    let arm = r * body.center_of_mass_m;
    let inertia = r * body.inertia * r.transpose();
    let mut sum = Energy {
        kinetic: 0.5 * body.mass_kg * (v + omega.cross(&arm)).norm_squared()
            + 0.5 * omega.dot(&(inertia * omega)),
        potential: -body.mass_kg * machine.gravity_m_s2.dot(&(c + arm)),
        spin: 0.0,
    };
    let Legs { base, platform, universal_axis } = Legs::of(machine);
    for ((a, b), u) in base.iter().zip(&platform).zip(&universal_axis) {
        let arm = r * b;
        let leg = Leg { a: *a, b: c + arm, b_velocity: v + omega.cross(&arm), u: *u };
        leg.add(machine, &mut sum);
    }
    sum
}

/// Kinetic energy at the start \[J\], what is gained in so many pairs of steps, and the integral of a power of the rates, by
/// Simpson's rule.
pub fn worked(
    machine: &Machine,
    simulator: &mut Simulator,
    pairs: u32,
    force: &[f64; 6],
    power: impl Fn([f64; 6]) -> f64,
) -> (f64, f64, f64) {
    let start = energy(machine, simulator.state()).kinetic;
    let mut work = 0.0;
    for _ in 0..pairs {
        for weight in [1.0, 4.0] {
            work += weight * power(simulator.leg_motion().rate_m_s) * DEFAULT_STEP_S / 3.0;
            simulator.advance(DEFAULT_STEP_S, Some(force));
        }
        work += power(simulator.leg_motion().rate_m_s) * DEFAULT_STEP_S / 3.0;
    }
    (start, energy(machine, simulator.state()).kinetic - start, work)
}

/// Where a leg's ends are and how they move.
struct Leg {
    a: Vector3<f64>,
    b: Vector3<f64>,
    b_velocity: Vector3<f64>,
    u: Vector3<f64>,
}

impl Leg {
    fn add(&self, machine: &Machine, sum: &mut Energy) {
        let length = (self.b - self.a).norm();
        let n = (self.b - self.a) / length;
        let rate = n.dot(&self.b_velocity);
        let n_rate = (self.b_velocity - n * rate) / length;
        // The cross of the universal joint turns about u in the base and about w, normal to u and n, in the
        // leg: the leg's angular velocity is a sum of turns about u and w. Its part across n is n x n'; the
        // part along n is what leaves nothing along u x w.
        let across = n.cross(&n_rate);
        let forbidden = self.u.cross(&self.u.cross(&n));
        let spin = -across.dot(&forbidden) / n.dot(&forbidden);
        let angular = across + n * spin;

        let cylinder = &machine.cylinder;
        let at = self.a + n * cylinder.center_of_mass_m;
        add_link(machine, cylinder, length, &n, &at, &(n_rate * cylinder.center_of_mass_m), &angular, sum);
        let rod = &machine.rod;
        let at = self.b - n * rod.center_of_mass_m;
        let velocity = self.b_velocity - n_rate * rod.center_of_mass_m;
        add_link(machine, rod, length, &n, &at, &velocity, &angular, sum);
        sum.kinetic += 0.5 * machine.actuator.reflected_mass_kg * rate * rate;
    }
}

#[allow(clippy::too_many_arguments, reason = "a body's whole state")]
fn add_link(
    machine: &Machine,
    link: &Link,
    length: f64,
    axis: &Vector3<f64>,
    at: &Vector3<f64>,
    velocity: &Vector3<f64>,
    angular: &Vector3<f64>,
    sum: &mut Energy,
) {
    let inertia = &link.transverse_inertia;
    let transverse =
        inertia.constant_kg_m2 + inertia.quadratic_kg * (length - inertia.reference_length_m).powi(2);
    let along = angular.dot(axis);
    let across = angular - axis * along;
    let spin = 0.5 * link.axial_inertia_kg_m2 * along * along;
    sum.kinetic +=
        0.5 * link.mass_kg * velocity.norm_squared() + 0.5 * transverse * across.norm_squared() + spin;
    sum.spin += spin;
    sum.potential -= link.mass_kg * machine.gravity_m_s2.dot(at);
}
