use super::{FrozenDeviation, spread};
use lfr_fit::{Candidate, FrozenData, RefineSettings, Refined, refine};
use lpv_core::nalgebra::{DMatrix, dmatrix};
use lpv_core::num_complex::Complex;
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf, FrfEstimate, Lfr, LfrBlocks, SchedulingRange};

const POSITIONS: [f64; 3] = [-1.0, 0.0, 1.0];

/// Deviation of the noise of a channel.
const NOISE: f64 = 1e-3;

fn clock() -> Discrete {
    Discrete::new(0.5).unwrap()
}

/// A mass on a spring of stiffness 2 + p/2, with two outputs.
fn spring() -> Candidate<Continuous> {
    let blocks = LfrBlocks {
        a: dmatrix![0.0, 1.0; -2.0, -0.1],
        b1: dmatrix![0.0; 1.0],
        b2: dmatrix![0.0; 1.0],
        c1: dmatrix![-0.5, 0.0],
        d11: dmatrix![0.0],
        d12: dmatrix![0.0],
        c2: dmatrix![1.0, 0.0; 0.3, 1.0],
        d21: dmatrix![0.0; 0.0],
        d22: dmatrix![0.0; 0.0],
    };
    let delta = DeltaBlock {
        parameter: 0,
        repetitions: 1,
    };
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    Candidate::from_lfr(&Lfr::new(blocks, vec![delta], range, Continuous).unwrap()).unwrap()
}

fn lines() -> Vec<f64> {
    (1..40).map(|k| 0.025 * f64::from(k)).collect()
}

fn response(model: &Candidate<Continuous>, p: f64, lines: &[f64]) -> Frf {
    let frozen = model.frozen(&[p]).unwrap().zero_order_hold(clock()).unwrap();
    frozen.frequency_response(lines).unwrap()
}

/// A fit to the model's own responses, known to [`NOISE`].
fn fit(model: &Candidate<Continuous>) -> Refined<Continuous> {
    let estimate = |p: f64| {
        let frf = response(model, p, &lines());
        let covariance = DMatrix::<Complex<f64>>::identity(2, 2) * Complex::from(NOISE * NOISE);
        let n = frf.len();
        let all = (0..n).flat_map(|_| covariance.iter().copied().collect::<Vec<_>>());
        let one = vec![Complex::from(1.0); n];
        let estimate = FrfEstimate::new(frf, all.collect(), one, f64::INFINITY, Some(p.into()));
        (vec![p], estimate.unwrap())
    };
    let data = FrozenData::weighted(clock(), &POSITIONS.map(estimate), 0.0).unwrap();
    refine(model, &data, &RefineSettings::default()).unwrap()
}

/// Known but for the gain of the first output: its error lies along the response, and is that of a least-squares gain.
#[test]
fn an_unknown_gain_is_an_error_along_the_response() {
    let model = spring();
    let mut free = DMatrix::from_element(5, 4, false);
    free[(2, 0)] = true;
    let found = fit(&model.clone().with_free(free).unwrap());
    let at = [0.05, 0.2, 0.5];
    let table = FrozenDeviation::of_fit(&found, POSITIONS.to_vec(), at.to_vec(), clock())
        .unwrap()
        .unwrap();
    let power: f64 = POSITIONS
        .iter()
        .flat_map(|p| response(&model, *p, &lines()).channel(0, 0).collect::<Vec<_>>())
        .map(|g| g.norm_sqr())
        .sum();
    let relative = NOISE / (2.0 * power).sqrt();
    for (n, p) in POSITIONS.into_iter().enumerate() {
        let own = response(&model, p, &at);
        for k in 0..at.len() {
            let size = own.line(k)[(0, 0)].norm();
            let found = table.in_phase[n][k][0][0] / size;
            assert!((found / relative - 1.0).abs() < 1e-3, "{found} for {relative}");
            assert!(table.quadrature[n][k][0][0] < 1e-6 * relative * size);
            assert!(table.in_phase[n][k][1][0] == 0.0 && table.quadrature[n][k][1][0] == 0.0);
        }
    }
}

/// With everything unknown, both parts together are the deviation of the channel, and neither is all of it.
#[test]
fn both_parts_make_the_deviation_of_the_channel() {
    let found = fit(&spring());
    let at = [0.05, 0.225, 0.5];
    let table = FrozenDeviation::of_fit(&found, vec![0.3], at.to_vec(), clock())
        .unwrap()
        .unwrap();
    let whole = found.response_deviation(&[0.3], &at).unwrap();
    for k in 0..at.len() {
        for i in 0..2 {
            let (a, b) = (table.in_phase[0][k][i][0], table.quadrature[0][k][i][0]);
            assert!((a.hypot(b) / whole[k][(i, 0)] - 1.0).abs() < 1e-3);
            assert!(a > 0.01 * b && b > 0.01 * a, "{a} {b}");
            // The fit has far fewer parameters than the data have lines.
            assert!(a.hypot(b) < NOISE, "{a} {b}");
        }
    }
}

#[test]
fn without_a_known_noise_there_is_no_table() {
    let model = spring();
    let relative: Vec<_> = POSITIONS
        .into_iter()
        .map(|p| (vec![p], response(&model, p, &lines())))
        .collect();
    let data = FrozenData::relative(clock(), &relative).unwrap();
    let found = refine(&model, &data, &RefineSettings::default()).unwrap();
    let table = FrozenDeviation::of_fit(&found, vec![0.0], vec![0.1], clock()).unwrap();
    assert!(table.is_none());
}

#[test]
fn lines_are_measured_ones_and_include_the_ends() {
    let few: Vec<f64> = (1..=60).map(f64::from).collect();
    assert_eq!(spread(&few), few);
    let many: Vec<f64> = (0..=5000).map(|k| 0.002 * f64::from(k)).collect();
    let chosen = spread(&many);
    assert!(chosen.len() <= 60 && chosen.len() > 40, "{}", chosen.len());
    assert_eq!((chosen[0], chosen[chosen.len() - 1]), (0.002, 10.0));
    assert!(chosen.windows(2).all(|w| w[0] < w[1]));
    assert!(chosen.iter().all(|f| many.contains(f)));
    assert!(spread(&[0.0]).is_empty());
}
