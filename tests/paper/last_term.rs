//! Item 2: the last term of (43), (45), the leg's angular acceleration from the motion of B.
//!
//! ```text
//! (37)   omega  = R_b L~ R_b^T v_B / L^2
//! d/dt   omega' = R_b L~ R_b^T (a_B - omega x v_B) / L^2  +  R_b L'~ L~ R_b^T omega / L^2
//! ```
//!
//! L and L' stand for the vectors `[L 0 0]`, `[L' 0 0]` where they wear a tilde. The last term is
//! `-J_Bv^-1 J_Bv'` on the angular velocity. It is an acceleration only with `L^2`: any other power gives
//! another motion in another unit of length. How the print is wrong beyond its units is not known here, so
//! the two nearest powers and the opposite sign stand for it.

use super::errata::assert_worth;
use super::vectors::{ROUNDING, errors, load};
use super::*;

const RIGHT: LastTerm = LastTerm { sign: 1.0, power: 2 };
pub const OPPOSITE: LastTerm = LastTerm { sign: -1.0, power: 2 };
pub const LENGTH: LastTerm = LastTerm { sign: 1.0, power: 1 };
pub const CUBED: LastTerm = LastTerm { sign: 1.0, power: 3 };

/// The same machine with millimetres for metres: forces come out in mN.
fn in_millimetres(machine: &Machine) -> Machine {
    let mut scaled = machine.clone();
    scaled.gravity *= 1e3;
    scaled.platform.center_of_mass *= 1e3;
    scaled.platform.inertia *= 1e6;
    for joints in &mut scaled.joints {
        joints.base *= 1e3;
        joints.platform *= 1e3;
    }
    for link in [&mut scaled.cylinder, &mut scaled.rod] {
        link.center_of_mass *= 1e3;
        link.axial_inertia *= 1e6;
        link.transverse_inertia.constant *= 1e6;
        link.transverse_inertia.reference_length *= 1e3;
    }
    scaled.drive.coulomb_friction *= 1e3;
    scaled
}

#[test]
fn item_2_only_the_corrected_last_term_does_not_depend_on_the_unit_of_length() {
    let case = load("fried2008");
    let machine = in_millimetres(&case.machine);
    let difference = |last_term: LastTerm| {
        let form = Form { last_term, ..PAPER };
        errors(case.rows.iter().flat_map(|row| {
            let mut state: State = row.state;
            for part in [&mut state.x, &mut state.xd, &mut state.xdd] {
                part.fixed_rows_mut::<3>(3).scale_mut(1e3);
            }
            let metres = forces(&case.machine, &row.state, &form);
            let millimetres = forces(&machine, &state, &form) / 1e3;
            <[f64; 6]>::from((millimetres - metres) / row.no_spin.amax())
        }))
    };
    assert!(difference(RIGHT).max < ROUNDING);
    assert_worth("2: L, millimetres for metres", "fried2008", difference(LENGTH), [1.37e1, 1.956e1, 9.72e1]);
    let cubed = difference(CUBED);
    assert_worth("2: L^3, millimetres for metres", "fried2008", cubed, [9.55e-3, 1.373e-2, 6.85e-2]);
}
