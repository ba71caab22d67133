//! The measured ball-screw axis against the published figures of its benchmark.

use crate::shared;
use lpv_core::Discrete;
use lpv_core::nalgebra::{DMatrix, DVector};
use lti_ident::Segment;
use lti_ident::rigid_body::{Motion, RigidBodySettings, decimated, identify};

#[test]
fn with_a_coulomb_term_the_filters_give_the_published_figures() {
    let Some(bundle) = shared("emps") else { return };
    let record = bundle.load(0).unwrap();
    let clock = Discrete::new(1e-3).unwrap();
    let motion = Motion::new(&record.outputs.columns[0], clock, 100.0).unwrap();
    let reduced = |v: &[f64]| decimated(v, clock, 40.0, 10).unwrap();
    let sign: Vec<f64> = motion.velocity.iter().map(|v| v.signum()).collect();
    let columns = [&motion.acceleration, &motion.velocity, &sign].map(|c| reduced(c));
    let force = DVector::from_vec(reduced(&record.inputs.columns[0]));
    let w = DMatrix::from_fn(force.len(), 4, |i, j| columns.get(j).map_or(1.0, |c| c[i]));
    let theta = (w.transpose() * &w).cholesky().unwrap().solve(&w.tr_mul(&force));
    let error = 100.0 * (&force - &w * &theta).norm() / force.norm();
    println!("{theta} {error}");
    assert!((theta[0] / 95.109 - 1.0).abs() < 0.005);
    assert!((theta[1] / 203.50 - 1.0).abs() < 0.01);
    assert!((theta[2] / 20.394 - 1.0).abs() < 0.02);
    assert!((theta[3] + 3.165).abs() < 0.03);
    assert!((error - 4.083).abs() < 0.3, "{error}");
}

#[test]
fn without_one_the_inertia_stays_and_the_friction_takes_its_place() {
    let Some(bundle) = shared("emps") else { return };
    let record = bundle.load(0).unwrap();
    let settings = RigidBodySettings::default();
    let fit = identify(
        &[Segment::whole(&record)],
        Discrete::new(1e-3).unwrap(),
        &settings,
    )
    .unwrap();
    let (axis, account) = (fit.model.axes()[0], &fit.axes[0]);
    println!("{axis:?} {account:?}");
    assert!(
        (axis.inertia - 95.109).abs() < 2.0 * axis.inertia_deviation,
        "{axis:?}"
    );
    assert!((axis.inertia / 95.109 - 1.0).abs() < 0.02 && axis.inertia_deviation < 3.0);
    // Viscous friction alone has to carry the Coulomb friction.
    assert!(axis.viscous > 300.0 && axis.viscous < 500.0);
    assert!(account.relative_force_error_percent > 10.0 && account.relative_force_error_percent < 25.0);
    assert!(account.effective_rows < account.rows as f64);
}
