//! Which input moves which outputs, which sensor is late, and whether inputs run on between samples: signals from formulas.

use crate::common::record;
use lpv_diagnose::lpv_core::{Discrete, Record};
use lpv_diagnose::observer::{self, Observer};
use lpv_diagnose::{Axis, Base, TraceError, Track, axes, compare, skew};

use std::f64::consts::TAU;

const RATE: f64 = 250.0;

/// Uniform noise between -1 and 1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Position, speed and acceleration of a motion with three sines, another one for each axis and record.
fn motion(axis: usize, number: usize, t: f64) -> [f64; 3] {
    let mut all = [0.0; 3];
    for (j, hz) in [0.37, 0.83, 1.71].into_iter().enumerate() {
        let w = TAU * hz * (1.0 + 0.23 * axis as f64) * (1.0 + 0.07 * number as f64);
        let phase = 1.3 * axis as f64 + 2.1 * j as f64 + number as f64;
        let (s, c) = (w * t + phase).sin_cos();
        all[0] += s / (1.0 + j as f64);
        all[1] += w * c / (1.0 + j as f64);
        all[2] -= w * w * s / (1.0 + j as f64);
    }
    all
}

#[test]
fn inputs_find_their_outputs() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(RATE)?;
    // Output i tells of this axis; inertias and units over six decades.
    let told = [2, 0, 1, 0, 2];
    let scale = [1e-3, 1.0, 1e3, 0.5, -2e-3];
    let mut noise = Noise(7);
    let records: Vec<Record> = (0..2)
        .map(|number| {
            let at = |axis: usize, k: usize| motion(axis, number, k as f64 / RATE);
            let force = |axis: usize, k: usize| {
                let [_, v, a] = at(axis, k);
                10_f64.powi(3 * axis as i32 - 3) * (a + 3.0 * v.signum() + 0.5 * v)
            };
            let outputs = told.iter().zip(scale).map(|(axis, scale)| {
                let one = |k| scale * at(*axis, k)[0];
                (0..2500).map(one).collect()
            });
            let inputs = (0..3).map(|axis| {
                let size = 10_f64.powi(3 * axis as i32 - 3);
                (0..2500).map(|k| force(axis, k) + size * noise.next()).collect()
            });
            record(&number.to_string(), outputs.collect(), inputs.collect())
        })
        .collect();
    let found = axes(&records, clock)?;
    let channels: Vec<_> = found
        .iter()
        .map(|a| (a.input, a.output, a.further.clone()))
        .collect();
    assert_eq!(channels, [(0, 1, vec![3]), (1, 2, vec![]), (2, 0, vec![4])]);
    assert!(found.iter().all(|a| a.explained > 0.9), "{found:?}");
    Ok(())
}

#[test]
fn positions_without_inputs_are_refused() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(RATE)?;
    let column = |axis: usize| {
        (0..2500)
            .map(|k| motion(axis, 0, f64::from(k) / RATE)[0])
            .collect()
    };
    let one = record("a", vec![column(0), column(1)], vec![column(0)]);
    let refused = axes(&[one], clock);
    assert!(
        matches!(
            refused,
            Err(TraceError::Axes {
                inputs: 1,
                positions: 2
            })
        ),
        "{refused:?}"
    );
    Ok(())
}

#[test]
fn a_late_sensor() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(RATE)?;
    for (seed, samples) in [0.0, 0.03, 0.3, -0.75, 3.0, 30.0].into_iter().enumerate() {
        let mut noise = Noise(seed as u64 + 1);
        let mut both = |number: usize| {
            let q = |t: f64| motion(0, number, t)[0];
            let mut reading = |t: f64| q(t) + 1e-4 * noise.next();
            let one = (0..2500).map(|k| reading(f64::from(k) / RATE)).collect();
            let late = (0..2500).map(|k| 1.002 * reading((f64::from(k) - samples) / RATE) + 3.0);
            record("r", vec![one, late.collect()], vec![vec![0.0; 2500]])
        };
        let (fitted, judged) = ([both(0), both(1)], [both(2)]);
        let found = skew((0, 1), &fitted, &judged, clock);
        if samples == 0.0 {
            assert!(found.is_none(), "{found:?}");
            continue;
        }
        let found = found.ok_or("no skew")?;
        let error = found.time * RATE - samples;
        assert!(error.abs() < 4.0 * found.deviation * RATE, "{samples}: {found:?}");
        assert!(found.deviation * RATE < 0.01, "{samples}: {found:?}");
    }
    Ok(())
}

/// A second encoder of another scale, or with a wave of its own, late or not.
#[test]
fn a_second_encoder_is_compared() -> Result<(), Box<dyn std::error::Error>> {
    const NOISE: f64 = 1e-5;
    let clock = Discrete::from_rate(RATE)?;
    for (seed, (gain, wave, samples)) in [
        (1.0, 0.0, 0.0),
        (1.0, 0.0, 2.5),
        (1.0005, 0.0, 0.0),
        (0.7, 0.0, 1.5),
        (1.0, 2e-3, 0.0),
        (1.05, 2e-2, 3.0),
    ]
    .into_iter()
    .enumerate()
    {
        let mut noise = Noise(seed as u64 + 1);
        let mut both = |number: usize| {
            let q = |t: f64| motion(0, number, t)[0];
            let one = (0..2500)
                .map(|k| q(f64::from(k) / RATE) + NOISE * noise.next())
                .collect();
            let other = (0..2500).map(|k| {
                let q = q((f64::from(k) - samples) / RATE);
                gain * q + wave * (60.0 * q).sin() + NOISE * noise.next() + 3.0
            });
            record("r", vec![one, other.collect()], vec![vec![0.0; 2500]])
        };
        let (fitted, judged) = ([both(0), both(1)], [both(2)]);
        let found = compare((0, 1), &fitted, &judged, clock).ok_or("nothing to compare")?;
        assert_eq!(found.skew.is_some(), samples != 0.0, "{found:?}");
        let [told, deviation] = found.gain;
        let near = (4.0 * deviation).max(5e-6) + wave;
        assert!((told - gain).abs() < near, "{gain}: {found:?}");
        if wave > 0.0 {
            assert!(found.left > 0.3 * wave, "{found:?}");
            continue;
        }
        // Noise of a uniform distribution between -1 and 1, of both.
        let size = NOISE * (2.0_f64 / 3.0).sqrt();
        assert!(
            (0.5 * size..2.0 * size).contains(&found.noise),
            "{size}: {found:?}"
        );
        assert!(found.left < 1.5 * found.noise, "{found:?}");
    }
    Ok(())
}

/// A mass on a spring under four sines of force, integrated by hand in fine steps, the force held or not.
#[test]
fn inputs_that_were_measured_run_on() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(RATE)?;
    for held in [true, false] {
        for hz in [2.0, 8.0, 30.0] {
            let w: f64 = TAU * hz;
            let (mass, damping, stiffness) = (1.0 / (w * w), 0.1 / w, 1.0);
            let force = |t: f64| -> f64 {
                [0.31, 0.77, 1.1, 1.6]
                    .iter()
                    .map(|r| (r * w * t + 9.0 * r).sin())
                    .sum()
            };
            const FINE: usize = 100;
            let h = 1.0 / (RATE * FINE as f64);
            let (mut x, mut v) = (0.0, 0.0);
            let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
            for k in 0..3000 {
                outputs.push(x);
                inputs.push(force(k as f64 / RATE));
                for j in 0..FINE {
                    let t = if held { 0.0 } else { (j as f64 + 0.5) * h };
                    v += h * (force(k as f64 / RATE + t) - damping * v - stiffness * x) / mass;
                    x += h * v;
                }
            }
            let one = observer::followed(record("r", vec![outputs], vec![inputs]));
            let base = Base::Axis(Axis::new(1.02 * mass, damping, 0.0).on_spring(stiffness));
            let observer = Observer::new(&base, std::slice::from_ref(&one), clock)?;
            let start = observer.controller.start()?;
            let track = Track::new(&one, 1.0 / RATE, 2, Some(&start))?;
            let (runs_on, left) = observer::runs_on(&base, &start, &[track]).ok_or("diverges")?;
            assert_eq!(runs_on, !held, "{hz} Hz: {left:?}");
        }
    }
    Ok(())
}

/// Inputs that are noise, and positions that do not know of them.
#[test]
fn inputs_of_no_position_are_refused() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(RATE)?;
    let at = |axis: usize, k: usize| motion(axis, 0, k as f64 / RATE);
    let output = |axis: usize| (0..2500).map(|k| at(axis, k)[0]).collect();
    let mut noise = Noise(3);
    let mut input = || (0..2500).map(|_| noise.next()).collect();
    let one = record("a", vec![output(0), output(1)], vec![input(), input()]);
    let refused = axes(&[one], clock);
    assert!(matches!(refused, Err(TraceError::Coupled { .. })), "{refused:?}");
    Ok(())
}
