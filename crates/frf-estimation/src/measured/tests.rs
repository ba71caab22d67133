use super::*;
use proptest::prelude::*;

fn response(lines: &[f64], outputs: usize, inputs: usize) -> Frf {
    let value = |f: f64, c: usize| {
        let s = C64::new(0.0, f);
        let mode = 20.0 * (1 + c) as f64;
        C64::from(1.0) / (s * s) + C64::from(0.3) / (s * s + s * 0.05 * mode + mode * mode)
    };
    let values = lines
        .iter()
        .flat_map(|f| (0..outputs * inputs).map(move |c| value(*f, c)))
        .collect();
    Frf::new(lines.to_vec(), outputs, inputs, values).unwrap()
}

/// Unit normal numbers from a linear congruence and the central limit, good enough for medians.
fn noise(seed: &mut u64) -> f64 {
    let mut sum = 0.0;
    for _ in 0..12 {
        *seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        sum += (*seed >> 11) as f64 / (1_u64 << 53) as f64;
    }
    sum - 6.0
}

proptest! {
    /// What is a product comes back, whatever its size and shape.
    #[test]
    fn a_product_is_found_again(
        outputs in 1..4_usize,
        inputs in 1..4_usize,
        entries in proptest::collection::vec(-1.0..1.0_f64, 36),
        decade in -20..20_i32,
    ) {
        let random = |n: usize, from: usize| {
            let entry = |i: usize, j: usize| C64::new(entries[(from + 3 * i + j) % 36], entries[(from + 5 * j + 7 * i + 1) % 36]);
            let half = DMatrix::from_fn(n, n, entry);
            &half * half.adjoint() + DMatrix::identity(n, n) * C64::from(0.1)
        };
        let (c, s) = (random(outputs, 0) * C64::from(10f64.powi(decade)), random(inputs, 17));
        let n = outputs * inputs;
        let full = DMatrix::from_fn(n, n, |a, b| {
            let (i, j, k, l) = (a % outputs, a / outputs, b % outputs, b / outputs);
            c[(i, k)] * s[(l, j)]
        });
        let frf = response(&[1.0], outputs, inputs);
        let found = with_covariance(frf.clone(), full.as_slice(), 5.0, None).unwrap();
        prop_assert!(found.factor < 1.0 + 1e-9);
        let product = |a: usize, b: usize| {
            let (i, j, k, l) = (a % outputs, a / outputs, b % outputs, b / outputs);
            found.estimate.output_covariance(0)[(i, k)] * found.estimate.input_factor(0)[(l, j)]
        };
        for a in 0..n {
            for b in 0..n {
                prop_assert!((product(a, b) - full[(a, b)]).norm() < 1e-9 * full.norm());
            }
        }
        let variance: Vec<f64> = (0..n).map(|a| full[(a, a)].re).collect();
        let found = with_variance(frf, &variance, f64::INFINITY, None).unwrap();
        prop_assert!(found.factor < 1.0 + 1e-9);
        for j in 0..inputs {
            for i in 0..outputs {
                let off = found.estimate.variance(0, i, j) / variance[j * outputs + i] - 1.0;
                prop_assert!(off.abs() < 1e-9);
            }
        }
    }
}

#[test]
fn what_is_no_product_is_told() {
    let frf = response(&[1.0], 2, 2);
    let found = with_variance(frf, &[1.0, 1.0, 1.0, 16.0], f64::INFINITY, None).unwrap();
    // Means of 1 and 8.5: ratios of 1, 1 / 8.5 twice, 16 / 72.25, and their mean is the scale.
    let scale = (1.0 + 2.0 / 8.5 + 16.0 / 72.25) / 4.0;
    assert!((found.factor - 8.5 * scale).abs() < 1e-12, "{}", found.factor);
}

#[test]
fn scatter_is_the_noise_of_a_smooth_response_whatever_its_slope() {
    let lines: Vec<f64> = (0..400)
        .map(|k| 10f64.powf(-1.0 + 4.0 * f64::from(k) / 400.0))
        .collect();
    let exact = response(&lines, 2, 1);
    let clean = scatter(&exact).unwrap();
    assert!(clean < 1e-4, "{clean}");
    for level in [1e-3, 1e-2, 0.1] {
        let mut seed = 7;
        let mut noisy = exact.clone();
        for v in noisy.values_mut() {
            *v *= C64::from(1.0) + C64::new(noise(&mut seed), noise(&mut seed)) * (level / 2f64.sqrt());
        }
        let found = scatter(&noisy).unwrap();
        assert!((found / level - 1.0).abs() < 0.15, "{level}: {found}");
    }
    assert_eq!(scatter(&response(&[1.0, 2.0, 3.0, 4.0], 1, 1)), None);
}

#[test]
fn coherence_over_averages_is_a_variance() {
    let frf = response(&[1.0, 2.0], 1, 1);
    let found = variance_of_coherence(&frf, &[0.5, 1.0], 10.0);
    let power = |k: usize| frf.line(k)[(0, 0)].norm_sqr();
    assert!((found[0] / (power(0) / 10.0) - 1.0).abs() < 1e-12);
    assert!((found[1] / (power(1) * 1e-7) - 1.0).abs() < 1e-9);
}

#[test]
fn an_assumed_error_says_so() {
    let lines: Vec<f64> = (1..60).map(f64::from).collect();
    let found = with_assumed_error(response(&lines, 1, 1), 0.02, None).unwrap();
    assert!(found.covariance_is_assumed());
    assert!(found.select(|k, _| k > 3).covariance_is_assumed());
    assert!((found.relative_deviation(3) - 0.02).abs() < 1e-12);
    assert!(with_assumed_error(response(&lines, 1, 1), 0.0, None).is_err());
}

/// Variances over twenty decades: the noise of a line, in units of what the estimate says of each channel, adds up to one a channel, and the
/// largest variance of a line is not said to be less than a part of it.
#[test]
fn a_small_variance_makes_no_other_small() {
    let mut seed = 3;
    for _ in 0..200 {
        let variance: Vec<f64> = (0..12).map(|_| 10f64.powf(4.0 * noise(&mut seed))).collect();
        let found = with_variance(response(&[1.0], 4, 3), &variance, f64::INFINITY, None).unwrap();
        let own = |at: usize| found.estimate.variance(0, at % 4, at / 4);
        let all: f64 = (0..12).map(|at| variance[at] / own(at)).sum();
        assert!((all - 12.0).abs() < 1e-6, "{all}");
        let largest = (0..12)
            .max_by(|a, b| variance[*a].total_cmp(&variance[*b]))
            .unwrap();
        assert!(own(largest) > variance[largest] / 12.0);
    }
}
