use super::*;
use nalgebra::dmatrix;

fn local() -> StateSpace<Continuous> {
    // Two modes of real shape, in coordinates that mix them.
    let a = dmatrix![0.0, 1.0, 0.0, 0.0; -4.0, -0.1, 0.0, 0.0; 0.0, 0.0, 0.0, 1.0; 0.0, 0.0, -9.0, -0.2];
    let b = dmatrix![0.0, 0.0; 1.0, 0.3; 0.0, 0.0; -0.2, 0.5];
    let c = dmatrix![0.6, 0.0, 0.1, 0.0; 0.05, 0.0, 0.4, 0.0];
    let t = dmatrix![1.0, 0.3, 0.0, -0.2; 0.1, 1.0, 0.4, 0.0; 0.0, 0.2, 1.0, 0.1; 0.3, 0.0, -0.1, 1.0];
    let inverse = t.clone().try_inverse().unwrap();
    StateSpace::new(
        &t * a * &inverse,
        &t * b,
        c * &inverse,
        DMatrix::zeros(2, 2),
        Continuous,
    )
    .unwrap()
}

fn form(channels: RandomChannels) -> MechanicalForm {
    let gamma = dmatrix![1.0, 0.0; 0.0, 2.0];
    let range = SchedulingRange::interval(-0.3, 0.3).unwrap();
    let deltas = [lpv_core::DeltaBlock {
        parameter: 0,
        repetitions: 2,
    }];
    let mut flexible = Candidate::flexible(&local(), Some(&gamma), &deltas, range, channels).unwrap();
    // Without w in B and in the outputs C B = 0 holds at every p.
    let mut m = flexible.matrix().clone();
    for z in 10..12 {
        m[(z, 8)] = 0.0;
        m[(z, 9)] = 0.0;
        m[(8, z)] = 0.0;
        m[(9, z)] = 0.0;
    }
    flexible = flexible.with_matrix(m);
    MechanicalForm::in_sizes(&flexible, &[1.0, 0.05]).unwrap()
}

#[test]
fn the_response_is_that_of_the_candidate() {
    let form = form(RandomChannels { seed: 1, size: 0.05 });
    let f = [0.05, 0.3, 0.5, 2.0];
    for p in [-0.3, 0.0, 0.2] {
        let own = form.frozen(&[p]).unwrap();
        let nq = own.states() / 2;
        assert_eq!(own.b().rows(0, nq).amax(), 0.0);
        let own = own.frequency_response(&f).unwrap();
        let truth = form
            .candidate
            .frozen(&[p])
            .unwrap()
            .frequency_response(&f)
            .unwrap();
        let error = own.relative_error(&truth).unwrap();
        assert!(error.iter().all(|e| *e < 1e-9), "{p}: {error:?}");
    }
    let split = DeltaSplit::default();
    let fixed = form.candidate(split, RandomChannels::default()).unwrap();
    let own = fixed.frozen(&[0.1]).unwrap().frequency_response(&f).unwrap();
    let truth = form
        .candidate
        .frozen(&[0.0])
        .unwrap()
        .frequency_response(&f)
        .unwrap();
    assert!(own.relative_error(&truth).unwrap().iter().all(|e| *e < 1e-9));
}

#[test]
fn integrators_are_exact_with_any_deltas() {
    let form = form(RandomChannels { seed: 1, size: 0.05 });
    let split = DeltaSplit {
        forces: 1,
        outputs: 1,
        accelerations: 2,
    };
    let made = form
        .candidate(split, RandomChannels { seed: 3, size: 0.3 })
        .unwrap();
    assert_eq!((made.states(), made.delta_count()), (8, 4));
    for p in [-0.3, -0.1, 0.2] {
        let system = made.frozen(&[p]).unwrap();
        // A has rank 6, and A^2 rank 4: two chains of length two at zero.
        let a = system.a();
        let rank = |m: &DMatrix<f64>| svd(m.clone()).unwrap().rank(1e-9 * m.norm());
        assert_eq!(
            (rank(a), rank(&(a * a))),
            (6, 4),
            "{p}: {:?}",
            (a * a).singular_values()
        );
        assert!((system.c() * system.b()).amax() < 1e-14);
    }
    assert_eq!(made.to_lfr().unwrap().delta_count(), 4);
}

#[test]
fn real_poles_are_refused() {
    let lags = dmatrix![-1.0, 0.0; 0.0, -2.0];
    let (b, c) = (dmatrix![1.0; 1.0], dmatrix![1.0, 1.0]);
    let lag = StateSpace::new(lags, b, c, dmatrix![0.0], Continuous).unwrap();
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    let random = RandomChannels::default();
    let made = Candidate::flexible(&lag, Some(&dmatrix![1.0]), &[], range, random).unwrap();
    let refused = MechanicalForm::in_sizes(&made, &[1.0]);
    assert!(matches!(refused, Err(FitError::Start { .. })));
}
