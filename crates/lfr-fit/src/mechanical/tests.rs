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

/// With large random deltas everywhere.
fn with_deltas(form: &MechanicalForm) -> Candidate<Continuous> {
    let split = DeltaSplit {
        forces: 1,
        outputs: 1,
        accelerations: 2,
    };
    form.candidate(split, RandomChannels { seed: 3, size: 0.3 })
        .unwrap()
}

/// Rank of A and of its square: how many chains of what length end at zero.
fn ranks(a: &DMatrix<f64>) -> (usize, usize) {
    let rank = |m: &DMatrix<f64>| svd(m.clone()).unwrap().rank(1e-9 * m.norm());
    (rank(a), rank(&(a * a)))
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
    let made = with_deltas(&form);
    assert_eq!((made.states(), made.delta_count()), (8, 4));
    for p in [-0.3, -0.1, 0.2] {
        let system = made.frozen(&[p]).unwrap();
        // A has rank 6, and A^2 rank 4: two chains of length two at zero.
        let a = system.a();
        assert_eq!(ranks(a), (6, 4), "{p}: {:?}", (a * a).singular_values());
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

/// A rigid body with friction, or with a gain that depends on p, keeps its integrals and its response.
#[test]
fn rigid_bodies_within_the_local_model() {
    use crate::Rigid;
    use lpv_core::linalg::{block_diagonal, from_blocks};
    let (zero, one) = (DMatrix::zeros(2, 2), DMatrix::identity(2, 2));
    let gain = dmatrix![1.0, 0.2; 0.1, 2.0];
    let f = [0.05, 0.3, 0.5, 2.0];
    let range = SchedulingRange::interval(-0.3, 0.3).unwrap();
    for (rigid, rate, rank) in [
        (Rigid::Varying, zero.clone(), (6, 4)),
        (Rigid::Friction, dmatrix![0.05, 0.01; 0.0, 0.02], (6, 6)),
    ] {
        let body = from_blocks(&[&[&zero, &one], &[&zero, &-&rate]]).unwrap();
        let modes = local();
        let whole = StateSpace::new(
            block_diagonal(&body, modes.a()),
            from_blocks(&[&[&zero], &[&gain], &[modes.b()]]).unwrap(),
            from_blocks(&[&[&one, &zero, modes.c()]]).unwrap(),
            zero.clone(),
            Continuous,
        )
        .unwrap();
        let deltas = [lpv_core::DeltaBlock {
            parameter: 0,
            repetitions: 2,
        }];
        let channels = RandomChannels { seed: 2, size: 0.01 };
        let made = Candidate::flexible(&whole, rigid, &deltas, range.clone(), channels).unwrap();
        // Whatever the channels are, no position moves a speed: two poles at zero at least.
        for p in [-0.3, 0.1] {
            let a = made.frozen(&[p]).unwrap().a().clone();
            assert_eq!(a.columns(0, 2).amax(), 0.0);
            assert!((a.view((0, 2), (2, 2)) - &one).amax() == 0.0);
        }
        let gain_moves =
            made.frozen(&[0.3]).unwrap().b().rows(2, 2) - made.frozen(&[-0.3]).unwrap().b().rows(2, 2);
        assert!(gain_moves.amax() > 1e-6);
        let form = MechanicalForm::in_sizes(&made, &[1.0, 0.05]).unwrap();
        let own = form.frozen(&[0.0]).unwrap().frequency_response(&f).unwrap();
        let truth = whole.frequency_response(&f).unwrap();
        let error = own.relative_error(&truth).unwrap();
        assert!(error.iter().all(|e| *e < 1e-3), "{rigid:?}: {error:?}");
        let made = with_deltas(&form);
        for p in [-0.3, 0.2] {
            let system = made.frozen(&[p]).unwrap();
            let a = system.a();
            assert_eq!(ranks(a), rank, "{rigid:?} at {p}");
        }
    }
    // A local model too small for a rigid body.
    let small = StateSpace::new(
        dmatrix![-1.0],
        dmatrix![1.0],
        dmatrix![1.0],
        dmatrix![0.0],
        Continuous,
    )
    .unwrap();
    assert!(Candidate::flexible(&small, Rigid::Friction, &[], range, RandomChannels::default()).is_err());
}
