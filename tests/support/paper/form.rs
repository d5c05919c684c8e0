//! Which reading of the equations is evaluated: the right one, or the right one with one printed error.

/// What the first two joint rates of a leg are, and which axes H_1 gives them (25), (27), (39), (53).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rates {
    /// Rates of the Euler angles of (2) along the true axes of the universal joint: exact, with spin.
    Euler,
    /// Components of the leg's angular velocity along its own y and z axes, nothing along the leg: the
    /// reading under which (25), (27) hold. No spin.
    Angular,
    /// Rates of the Euler angles as in (39) put into the H_1 and J_Bv of the other reading, as in (25), (27).
    EulerAsAngular,
}

/// `sign R_b L'~ L~ R_b^T / L^power`, the last term of (43), (45).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LastTerm {
    pub sign: f64,
    pub power: i32,
}

/// How a transverse inertia that depends on the length of the leg enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inertia {
    /// The instantaneous value in Newton-Euler, as in the paper: no term with its rate of change.
    Instantaneous,
    /// Lagrange: `dI/dt omega` as well, and `-1/2 dI/dL omega^2` along the leg.
    Varying,
}

/// One reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    pub rates: Rates,
    /// Only `Rates::Angular` goes through (43), (45).
    pub last_term: LastTerm,
    pub inertia: Inertia,
    /// +1: the platform feels `v' - g`, like the legs (`v0' = -g` in (74)); -1: `v' + g`.
    pub platform_gravity: f64,
    /// Whether the inertia beside the first moments about C is taken about C too (90), (91).
    pub parallel_axis: bool,
    /// Sign of `m omega x (omega x CG)` in (92).
    pub centrifugal: f64,
}

/// The equations corrected: agrees with `force_*`.
pub const EXACT: Form = Form {
    rates: Rates::Euler,
    last_term: LastTerm { sign: 1.0, power: 2 },
    inertia: Inertia::Instantaneous,
    platform_gravity: 1.0,
    parallel_axis: true,
    centrifugal: 1.0,
};

/// The paper's model, its slips corrected, its neglect of the spin kept: agrees with `force_no_spin_*`.
pub const PAPER: Form = Form { rates: Rates::Angular, ..EXACT };
