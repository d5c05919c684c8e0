//! Legs in joint coordinates of the library, `hexad inverse-dynamics --joint-space`, against the dense matrices, and as a balance
//! of the platform.

use hexad::model::joint_space::joint_space;

use super::vectors::{ROUNDING, load};
use super::*;

#[test]
fn legs_in_joint_coordinates_are_those_of_the_dense_matrices() {
    for name in MACHINES {
        let (case, machine) = (load(name), machine(name));
        let (mut matrices, mut vectors, mut balance) =
            (Errors::default(), Errors::default(), Errors::default());
        for row in &case.rows {
            let p = platform(&row.state);
            let motion = TaskState { x: row.state.x, xd: row.state.xd, xdd: row.state.xdd }.motion();
            let found = joint_space(&machine, &motion, &row.exact.into());
            let of_paper = legs(&case.machine, &p);
            let mut wrench = Vector6::zeros();
            for (found, leg) in found.iter().zip(&of_paper) {
                let joint = joint(leg, &EXACT);
                let dense = Dense::new(&case.machine, leg, &joint);
                let gravity = leg.axes.tr_mul(&case.machine.gravity);
                let mass = dense.mass_matrix();
                matrices.add((Matrix3::from_diagonal(&found.mass) - mass).amax() / mass.amax());
                let bias = dense.newton_euler(&joint, &Default::default(), &gravity);
                let scale = bias.amax() + mass.component_mul(&Matrix3::from_diagonal(&joint.accel)).amax();
                vectors.add((found.bias - bias).amax() / scale);
                vectors.add((found.accel - joint.accel).amax() / joint.accel.amax());
                // J_Bv^-T D = n (Gamma - drive) - phi
                wrench += at_c(&leg.arm, &found.contact_force_n);
            }
            let expected = platform_wrench(&case.machine, &p, &EXACT);
            balance.add((wrench - expected).amax() / row.exact.amax());
        }
        matrices.assert_within(ROUNDING, &format!("{name} M"));
        vectors.assert_within(100.0 * ROUNDING, &format!("{name} C + G, q''"));
        balance.assert_within(ROUNDING, &format!("{name} phi"));
    }
}
