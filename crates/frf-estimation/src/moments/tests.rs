use super::*;
use pulp::Scalar;

impl Scatter {
    /// That of one line, column-major.
    pub(crate) fn at(&self, place: Place) -> Vec<C64> {
        let simd = Scalar::new();
        let mut all = vec![ComplexLanes::zero(simd); self.channels * self.channels];
        self.gather(simd, &[place; WIDEST], &mut all);
        all.iter().map(|z| z.value()).collect()
    }
}

/// Observations in ascending order, lines from index 0 on.
struct Given<'a> {
    channels: usize,
    observations: &'a [Vec<C64>],
}

impl Observed for Given<'_> {
    fn count(&self) -> usize {
        self.observations.len()
    }

    fn chunk<S: Simd, const COUNT: usize>(&mut self, _: S, at: usize, from: usize, out: &mut [[Part; 2]]) {
        for (m, z) in self.observations[from..from + COUNT].iter().enumerate() {
            for (channel, z) in z.chunks_exact(z.len() / self.channels).enumerate() {
                for l in 0..CHUNK {
                    let z = z.get(at * CHUNK + l).copied().unwrap_or_default();
                    let [re, im] = &mut out[channel * COUNT + m];
                    (re[l], im[l]) = (z.re, z.im);
                }
            }
        }
    }
}

fn push(scatter: &mut Scatter, mean: &mut Means, observations: &[Vec<C64>]) {
    let channels = scatter.channels;
    scatter.push(
        mean,
        &mut Given {
            channels,
            observations,
        },
    );
}

fn empty(channels: usize, lines: usize) -> (Means, Scatter) {
    let order = Order::Ascending(lines);
    (Means::new(channels, order), Scatter::new(channels, order))
}

fn line(k: usize) -> Place {
    Order::Ascending(k).place(k)
}

#[test]
fn matches_two_pass_formula_under_a_large_offset() {
    // Five observations by hand: z = 1e6 + {0, 3, 6, 3, 3}, w = 1e6 j + {j, 0, -j, 0, 0}.
    let z = |(a, b): (f64, f64)| vec![C64::new(1e6 + a, 0.0), C64::new(0.0, 1e6 + b)];
    let all = [(0.0, 1.0), (3.0, 0.0), (6.0, -1.0), (3.0, 0.0), (3.0, 0.0)].map(z);
    // One after the other, or as many together as there may be, and a rest.
    for parts in [
        vec![1; 5],
        vec![TOGETHER, TOGETHER, 1],
        vec![1, TOGETHER, TOGETHER],
        vec![3, 2],
    ] {
        let (mut mean, mut scatter) = empty(2, 1);
        let mut left = &all[..];
        for part in parts {
            push(&mut scatter, &mut mean, &left[..part]);
            left = &left[part..];
        }
        assert_eq!(mean.count(), 5);
        assert!((mean.at(0, line(1)) - (1e6 + 3.0)).norm() < 1e-9);
        assert!((mean.at(1, line(1)) - C64::new(0.0, 1e6)).norm() < 1e-9);
        let s = scatter.at(line(1));
        // sum (z - mean) conj(w - mean) = (-3)(-j) + 0 + (3)(j) = 6j.
        let expected = [
            C64::new(18.0, 0.0),
            C64::new(0.0, -6.0),
            C64::new(0.0, 6.0),
            C64::new(2.0, 0.0),
        ];
        for (a, b) in s.iter().zip(expected) {
            assert!((a - b).norm() < 1e-9, "{a} {b}");
        }
        assert!((scatter.diagonal(1, line(1)) - 2.0).abs() < 1e-9);
    }
}

#[test]
fn experiments_scatter_about_their_own_means() {
    let (_, mut scatter) = empty(1, 1);
    for offset in [0.0, 1e3] {
        let (mut mean, _) = empty(1, 1);
        let z = [offset - 1.0, offset + 1.0].map(|z| vec![C64::from(z)]);
        push(&mut scatter, &mut mean, &z);
        assert_eq!(mean.at(0, line(1)), C64::new(offset, 0.0));
    }
    assert!((scatter.diagonal(0, line(1)) - 4.0).abs() < 1e-12);
}

#[test]
fn lines_beyond_one_chunk_are_alike() {
    let lines = 2 * CHUNK + 3;
    let (mut mean, mut scatter) = empty(3, lines);
    for k in 0..4 {
        let value = |i: usize| ((i / lines * 7 + k * 3) % 5) as f64;
        let spectra = (0..3 * lines).map(|i| C64::new(value(i), 2.0 - value(i)));
        push(&mut scatter, &mut mean, &[spectra.collect()]);
    }
    let first = scatter.at(line(1));
    for k in 2..=lines {
        assert_eq!(scatter.at(line(k)), first);
    }
    assert!(first[0].re > 0.0);
}

#[test]
fn a_mean_alone_counts_what_is_repeated() {
    let (mut mean, _) = empty(1, 2);
    for (k, times) in [(0.0, 1), (1.0, 2), (4.0, 1)] {
        let observations = &[vec![C64::new(k, 1.0), C64::new(0.0, -k)]];
        mean.push(
            &mut Given {
                channels: 1,
                observations,
            },
            times,
        );
    }
    assert_eq!(mean.count(), 4);
    assert_eq!(
        (mean.at(0, line(1)), mean.at(0, line(2))),
        (C64::new(1.5, 1.0), C64::new(0.0, -1.5))
    );
}
