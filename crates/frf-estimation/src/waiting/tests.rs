use super::*;
use proptest::prelude::*;

/// Means of the spectra of one period, by channel and line.
fn spectra(mut waiting: Waiting, signals: &[Vec<f64>]) -> Vec<Vec<C64>> {
    let order = waiting.order();
    assert!(waiting.push(signals.iter()).unwrap());
    let mut mean = Means::new(signals.len(), order);
    waiting.average(&mut mean, 1);
    let lines = 1..=Spectra::lines(signals[0].len());
    let of = |c: usize| lines.clone().map(|k| mean.at(c, order.place(k))).collect();
    (0..signals.len()).map(of).collect()
}

fn library(length: usize, channels: usize) -> Waiting {
    let spectra = Transformed::Spectra(Spectra::new(length), Vec::new());
    Waiting::of(length, channels, TOGETHER, spectra)
}

fn norm(z: &[C64]) -> f64 {
    z.iter().map(C64::norm_sqr).sum::<f64>().sqrt()
}

#[test]
fn a_cosine_and_a_sine_at_every_line() {
    for length in [1 << 10, 1 << 11, 1 << 12] {
        for k in 1..length / 2 {
            if k % 37 > 2 && ![length / 16, length / 8, length / 4].contains(&k) {
                continue;
            }
            // Amplitudes of 2 are 1 in the spectrum.
            let wave = |t: usize| {
                let turn = 2.0 * std::f64::consts::PI * ((t * k) % length) as f64 / length as f64;
                [3.0 + 2.0 * turn.cos(), 3.0 + 2.0 * turn.sin()]
            };
            let signals = [0, 1].map(|i| (0..length).map(|t| wave(t)[i]).collect::<Vec<f64>>());
            let found = spectra(Waiting::new(length, 2), &signals);
            for (channel, expected) in [(0, C64::new(1.0, 0.0)), (1, C64::new(0.0, -1.0))] {
                for (l, z) in found[channel].iter().enumerate() {
                    let expected = if l + 1 == k { expected } else { C64::default() };
                    assert!((z - expected).norm() < 1e-14, "{length} {k} {l} {z}");
                }
            }
        }
    }
}

fn number(i: usize, seed: u64) -> f64 {
    let x = (i as u64 + 1)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add(seed)
        .rotate_left(23);
    (x.wrapping_mul(0xD134_2543_DE82_EF95) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
}

/// So many signals, each of a size and an offset of its own.
fn signals(length: usize, channels: usize, seed: u64) -> Vec<Vec<f64>> {
    let of = |c: usize| {
        let (size, offset) = (10.0_f64.powf(24.0 * number(c, seed)), 20.0 * number(c + 9, seed));
        (0..length)
            .map(|t| size * (offset + number(c * length + t, seed)))
            .collect()
    };
    (0..channels).map(of).collect()
}

/// The largest distance of a channel's spectrum, relative to its size.
fn distance(ours: &[Vec<C64>], theirs: &[Vec<C64>]) -> f64 {
    let of = |(a, b): (&Vec<C64>, &Vec<C64>)| {
        let apart: Vec<C64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        norm(&apart) / norm(b)
    };
    ours.iter().zip(theirs).map(of).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_number_of_signals_as_by_the_library(twos in 10_u32..17, channels in 1_usize..6, seed in 0_u64..1000) {
        let signals = signals(1 << twos, channels, seed);
        let found = distance(
            &spectra(Waiting::new(1 << twos, channels), &signals),
            &spectra(library(1 << twos, channels), &signals),
        );
        prop_assert!(found <= 2e-15, "2^{twos} {channels}: {found:e}");
    }
}

#[test]
fn long_periods_as_by_the_library() {
    for twos in [17, 18, 19] {
        let signals = signals(1 << twos, 2, 3);
        let [ours, theirs] =
            [Waiting::new(1 << twos, 2), library(1 << twos, 2)].map(|w| spectra(w, &signals));
        assert!(
            distance(&ours, &theirs) <= 2e-15,
            "2^{twos}: {:e}",
            distance(&ours, &theirs)
        );
    }
}

#[test]
fn pairs_are_what_is_tested_where_the_machine_has_them() {
    #[cfg(target_arch = "x86_64")]
    let has = pulp::x86::V4::try_new().is_some();
    #[cfg(not(target_arch = "x86_64"))]
    let has = false;
    assert_eq!(
        matches!(Waiting::new(1024, 2).transformed, Transformed::Pairs(_)),
        has
    );
    if !has {
        println!("skipped: no registers of eight numbers, so that all transforms are those of the library");
    }
}

#[test]
fn what_is_constant_stays_zero_beside_anything() {
    for constant in [0.0, 5.0, -1e9, 0.1] {
        let one = vec![constant; 1024];
        let other: Vec<f64> = (0..1024).map(|t| number(t, 1)).collect();
        for pair in [[one.clone(), other.clone()], [other.clone(), one.clone()]] {
            let found = spectra(Waiting::new(1024, 2), &pair);
            let silent = usize::from(pair[1] == one);
            assert!(found[silent].iter().all(|z| *z == C64::default()), "{constant}");
            assert!(norm(&found[1 - silent]) > 0.0);
        }
    }
}

#[test]
fn powers_of_two_change_no_digit() {
    let all = signals(2048, 3, 7);
    let reference = spectra(Waiting::new(2048, 3), &all);
    for twos in [[40, 0, -60], [-500, 300, 3], [0, -80, 700]] {
        let scaled = |c: usize| {
            all[c]
                .iter()
                .map(|x| x * 2.0_f64.powi(twos[c]))
                .collect::<Vec<f64>>()
        };
        let found = spectra(Waiting::new(2048, 3), &[scaled(0), scaled(1), scaled(2)]);
        for (c, (a, b)) in found.iter().zip(&reference).enumerate() {
            assert!(
                a.iter().zip(b).all(|(a, b)| *a == b * 2.0_f64.powi(twos[c])),
                "{twos:?} {c}"
            );
        }
    }
}

#[test]
fn scatter_does_not_depend_on_the_transform() {
    let (length, channels) = (1 << 11, 3);
    let period = |m: usize| -> Vec<Vec<f64>> {
        let value = |c: usize, t: usize| ((t * (c + 2) + m * t * t % 97) as f64 * 0.37).sin();
        (0..channels)
            .map(|c| (0..length).map(|t| value(c, t)).collect())
            .collect()
    };
    let of = |mut waiting: Waiting| {
        let order = waiting.order();
        let (mut mean, mut scatter) = (Means::new(channels, order), Scatter::new(channels, order));
        for m in 0..5 {
            waiting.push(period(m).iter()).unwrap();
            if waiting.is_full() || m == 4 {
                waiting.take_up(&mut mean, &mut scatter);
            }
        }
        let mut all = Vec::new();
        for k in 1..=Spectra::lines(length) {
            all.extend(scatter.at(order.place(k)));
            all.extend((0..channels).map(|c| mean.at(c, order.place(k))));
        }
        all
    };
    let (ours, theirs) = (of(Waiting::new(length, channels)), of(library(length, channels)));
    let apart: Vec<C64> = ours.iter().zip(&theirs).map(|(a, b)| a - b).collect();
    assert!(
        norm(&apart) < 1e-14 * norm(&theirs),
        "{:e}",
        norm(&apart) / norm(&theirs)
    );
}

#[test]
fn a_sample_that_is_not_finite_is_seen() {
    for at in [0, 1, 700, 1023] {
        for bad in [f64::NAN, f64::INFINITY] {
            for channel in 0..3 {
                let mut signals = vec![vec![1.0; 1024]; 3];
                signals[channel][at] = bad;
                assert!(!Waiting::new(1024, 3).push(signals.iter()).unwrap());
                assert!(!library(1024, 3).push(signals.iter()).unwrap());
            }
        }
    }
}
