//! The regressor form: exact, linear, and blind in the directions it names.

use hexad::model::regressor::{
    COULOMB, DYNAMIC_PARAMETER_COUNT, DynamicParameters, INDISTINGUISHABLE_PAIRS, REFLECTED, Regressor,
    VISCOUS, dynamic_parameters, regressor, rod_mass_null_direction,
};

use super::*;

fn forces(machine: &Machine, motion: &Motion) -> Vector6<f64> {
    inverse_dynamics::<Exact>(machine, motion).unwrap().into()
}

/// `|Y| |p|`: what is summed up to a force, hence what rounding is a share of.
fn summed(y: &Regressor, p: &DynamicParameters) -> f64 {
    (y.abs() * p.abs()).amax()
}

/// The machine that has these parameters, on the geometry of another.
fn with_parameters(mut machine: Machine, p: &DynamicParameters) -> Machine {
    let at = |index: usize| p[index];
    let center = Vector3::new(at(1), at(2), at(3)) / at(0);
    let about_c = Matrix3::new(at(4), at(7), at(8), at(7), at(5), at(9), at(8), at(9), at(6));
    let shift = Matrix3::identity() * center.norm_squared() - center * center.transpose();
    machine.platform.mass_kg = at(0);
    machine.platform.center_of_mass_m = center;
    machine.platform.inertia = about_c - shift * at(0);
    // The mass of the cylinder is not felt: any will do.
    machine.cylinder.mass_kg = 3.0;
    machine.rod.mass_kg = at(14);
    for (link, moment) in [(&mut machine.cylinder, 10), (&mut machine.rod, 15)] {
        link.center_of_mass_m = at(moment) / link.mass_kg;
        link.transverse_inertia.constant_kg_m2 = at(moment + 1) - at(moment) * link.center_of_mass_m;
        link.axial_inertia_kg_m2 = at(moment + 2);
        link.transverse_inertia.quadratic_kg = at(moment + 3);
    }
    machine.actuator.reflected_mass_kg = at(REFLECTED);
    machine.actuator.viscous_friction_n_s_m = core::array::from_fn(|leg| at(VISCOUS + leg));
    machine.actuator.coulomb_friction_n = core::array::from_fn(|leg| at(COULOMB + leg));
    machine
}

proptest! {
    #![proptest_config(cases(1000))]

    /// Another machine of the same geometry needs the forces that the same Y predicts.
    #[test]
    fn forces_are_linear_in_the_parameters(
        (machine, _, motion) in machine_in_motion(),
        other in any_machine(),
        quadratic in [0.0..5.0f64, 0.0..5.0],
        turned in vector3(),
    ) {
        let y = regressor(&machine, &motion).unwrap();
        let mut other = Machine { joints: machine.joints.clone(), gravity_m_s2: machine.gravity_m_s2, ..other };
        other.actuator.coulomb_smoothing_m_s = machine.actuator.coulomb_smoothing_m_s;
        let turn = nalgebra::Rotation3::from_scaled_axis(turned).into_inner();
        other.platform.inertia = turn * other.platform.inertia * turn.transpose();
        for (other, (one, q)) in [&mut other.cylinder, &mut other.rod]
            .into_iter()
            .zip([&machine.cylinder, &machine.rod].into_iter().zip(quadratic))
        {
            other.transverse_inertia.reference_length_m = one.transverse_inertia.reference_length_m;
            other.transverse_inertia.quadratic_kg = q;
        }
        for machine in [&machine, &other] {
            let p = dynamic_parameters(machine);
            let difference = (y * p - forces(machine, &motion)).amax();
            prop_assert!(difference < 1e-12 * summed(&y, &p), "{difference:e} of {:e}", summed(&y, &p));
        }
        // And p says all there is to say about a machine.
        let p = dynamic_parameters(&other);
        let rebuilt = with_parameters(machine, &p);
        prop_assert!((dynamic_parameters(&rebuilt) - p).amax() < 1e-12 * p.amax());
        prop_assert!((forces(&rebuilt, &motion) - forces(&other, &motion)).amax() < 1e-11 * summed(&y, &p));
    }

    #[test]
    fn some_parameters_show_only_in_combination((machine, _, motion) in machine_in_motion()) {
        let y = regressor(&machine, &motion).unwrap();
        for [a, b] in INDISTINGUISHABLE_PAIRS {
            prop_assert_eq!(y.column(a), y.column(b));
        }
        let hidden = rod_mass_null_direction(&machine);
        prop_assert!((y * hidden).amax() < 1e-12 * summed(&y, &hidden));
    }
}

proptest! {
    #![proptest_config(cases(30))]

    /// Over many motions of one machine, what is not named as hidden is seen: rank 29, or 28 where q1 and
    /// q2 have the same reference length.
    #[test]
    fn everything_else_can_be_identified(
        machine in any_machine(),
        at in proptest::collection::vec([vector6(), vector6(), vector6()], 60),
    ) {
        for (apart, rank) in [(0.3 * machine.joints.radius_m, 29), (0.0, 28)] {
            let mut machine = machine.clone();
            let reference = machine.rod.transverse_inertia.reference_length_m;
            machine.cylinder.transverse_inertia.reference_length_m = reference + apart;
            let mut stacked = DMatrix::zeros(6 * at.len(), DYNAMIC_PARAMETER_COUNT);
            for (i, at) in at.iter().enumerate() {
                let mut state = state_near_home(&machine, at);
                state.xd *= 3.0;
                if let Some(y) = regressor(&machine, &state.motion()) {
                    stacked.rows_mut(6 * i, 6).copy_from(&(y / y.amax()));
                }
            }
            // Columns of length one: units do not count.
            stacked.column_iter_mut().for_each(|mut column| column.unscale_mut(column.norm()));
            let mut values: Vec<f64> = stacked.singular_values().iter().copied().collect();
            values.sort_by(|a, b| b.total_cmp(a));
            prop_assert!(values[rank - 1] > 1e-6 && values[rank] < 1e-13, "{values:?}");
        }
    }
}
