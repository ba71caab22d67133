//! `lpv inspect`: figures of signals whose figures are known.

use crate::common::{
    Desk, Noise, csv, entry, head, machine_bundle, mode, mode_bundle, multisine, number, response,
};

/// A bundle `bundle` of one record with `u` and `y`.
fn bundle(desk: &Desk, u: &[f64], y: &[f64], period: Option<usize>) {
    desk.write("bundle/run.csv", csv(&[("u", u), ("y", y)]));
    desk.write(
        "bundle/experiment.toml",
        head(10.0) + &entry("run.csv", period, "estimation"),
    );
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{found}, expected {expected}"
    );
}

#[test]
fn crest_factor_noise_and_signal_to_noise_ratio() {
    const PERIOD: usize = 400;
    const PERIODS: usize = 50;
    const NOISE: f64 = 0.3;
    let desk = Desk::new();
    // One cosine of amplitude 2 at line 20, sampled at its peaks.
    let u: Vec<f64> = multisine(20..21, PERIOD, PERIODS * PERIOD);
    let u: Vec<f64> = (0..u.len())
        .map(|n| 2.0 * (std::f64::consts::TAU * (n % 20) as f64 / 20.0).cos())
        .collect();
    let noise = Noise(5).samples(u.len(), NOISE);
    let y: Vec<f64> = u.iter().zip(&noise).map(|(u, e)| 1.5 * u + e).collect();
    bundle(&desk, &u, &y, Some(PERIOD));
    let found = desk.json("inspect bundle --json");
    let input = &found["records"][0]["channels"][1];
    assert_eq!(
        (input["role"].as_str(), input["name"].as_str()),
        (Some("input"), Some("u"))
    );
    close(number(input, "/crest_factor"), 2f64.sqrt(), 1e-9);
    close(number(input, "/rms"), 2f64.sqrt(), 1e-9);
    close(number(&found, "/records/0/duration"), 2000.0, 1e-9);
    let experiment = &found["experiments"][0];
    assert_eq!(experiment["instrument"], "inputs");
    close(number(experiment, "/band_hz/0"), 0.5, 1e-12);
    // Of 20,000 samples a deviation is known to half a percent, two of them to two.
    close(number(&found, "/noise/0"), NOISE, 0.01 * NOISE);
    // A cosine of amplitude a stands a^2 T / (4 s^2) above the noise of one period: 33 dB.
    let one = 3.0 * 3.0 * PERIOD as f64 / (4.0 * NOISE * NOISE);
    let used = number(experiment, "/periods_used");
    // The noise at one line is known from 49 periods: to 1 dB.
    close(
        number(experiment, "/output_snr_db/0/median"),
        10.0 * (one * used).log10(),
        2.0,
    );
    close(number(experiment, "/coherence/0/median"), one / (1.0 + one), 1e-4);
}

#[test]
fn coherence_of_a_noisy_period() {
    const PERIOD: usize = 256;
    let desk = Desk::new();
    let u = multisine(1..120, PERIOD, 40 * PERIOD);
    // a^2 T / (4 s^2) = 1 at every line: half of the power of a period is noise.
    let noise = Noise(7).samples(u.len(), 8.0);
    let y: Vec<f64> = u.iter().zip(&noise).map(|(u, e)| u + e).collect();
    bundle(&desk, &u, &y, Some(PERIOD));
    let found = desk.json("inspect bundle --json");
    close(number(&found, "/experiments/0/coherence/0/median"), 0.5, 0.04);
    close(
        number(&found, "/experiments/0/output_snr_db/0/median"),
        10.0 * 40f64.log10(),
        0.8,
    );
    close(number(&found, "/noise/0"), 8.0, 0.1);
    // Relative deviation of F = 1: sqrt(1 / 40).
    close(
        number(&found, "/experiments/0/frf_deviation/median"),
        40f64.recip().sqrt(),
        0.02,
    );
}

/// Squared amplitude spectrum of a real signal over one period.
fn power(x: &[f64], line: usize) -> f64 {
    let n = x.len();
    let angle = |t: usize| std::f64::consts::TAU * ((line * t) % n) as f64 / n as f64;
    let sum = |f: fn(f64) -> f64| -> f64 { x.iter().enumerate().map(|(t, x)| x * f(angle(t))).sum() };
    sum(f64::cos).powi(2) + sum(f64::sin).powi(2)
}

#[test]
fn odd_and_even_distortion_by_line() {
    const PERIOD: usize = 512;
    let desk = Desk::new();
    // Odd lines, each fourth of them left out to see odd distortion.
    let lines = || (1..120).step_by(2).filter(|k| k % 8 != 5);
    let u = multisine(lines(), PERIOD, 6 * PERIOD);
    let distortion: Vec<f64> = u.iter().map(|u| 1e-3 * u * u + 1e-4 * u.powi(3)).collect();
    let noise = Noise(3).samples(u.len(), 1e-5);
    let y: Vec<f64> = (0..u.len()).map(|n| u[n] + distortion[n] + noise[n]).collect();
    bundle(&desk, &u, &y, Some(PERIOD));
    let found = desk.json("inspect bundle --json");
    let experiment = &found["experiments"][0];
    let (d, whole) = (&distortion[..PERIOD], &y[..PERIOD]);
    let excited: f64 = lines().map(|k| power(whole, k)).sum::<f64>() / lines().count() as f64;
    for (parity, field) in [("odd", "odd_distortion"), ("even", "even_distortion")] {
        let quiet: Vec<&serde_json::Value> = experiment["detection"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|l| l["parity"] == parity)
            .collect();
        let numbers: Vec<usize> = quiet.iter().map(|l| number(l, "/line") as usize).collect();
        assert_eq!(
            numbers.len(),
            if parity == "odd" { 15 } else { 59 },
            "{numbers:?}"
        );
        let powers: Vec<f64> = numbers.iter().map(|&k| power(d, k)).collect();
        // Each line, in the unit of the amplitude spectrum, up to a noise of 1e-5 that is spread over all lines.
        for (line, power) in quiet.iter().zip(&powers) {
            close(number(line, "/level/0"), power.sqrt() / PERIOD as f64, 1e-6);
        }
        let expected = (powers.iter().sum::<f64>() / powers.len() as f64 / excited).sqrt();
        close(
            number(experiment, &format!("/{field}/0")),
            expected,
            0.02 * expected,
        );
    }
    let warnings = found["warnings"].to_string();
    assert!(
        warnings.contains("odd nonlinear distortion") && warnings.contains("even nonlinear distortion"),
        "{warnings}"
    );
    let table = desk.done("inspect bundle --lines");
    let rows: Vec<&str> = table.lines().collect();
    // 45 excited lines, and what lies between the first and the last of them.
    assert_eq!(rows.len(), 1 + lines().count() + 15 + 59);
    assert!(rows.iter().all(|r| r.split(',').count() == 10), "{table}");
    assert_eq!(rows.iter().filter(|r| r.contains(",even,")).count(), 59);
}

#[test]
fn coherence_of_a_transient_record() {
    let desk = Desk::new();
    let mut noise = Noise(9);
    let u = noise.samples(8192, 1.0);
    let clean = response(&mode(), &u);
    let disturbed = noise.samples(u.len(), 1.0);
    for (y, low, high) in [(clean, 0.97, 1.0), (disturbed, 0.0, 0.2)] {
        bundle(&desk, &u, &y, None);
        let found = desk.json("inspect bundle --json");
        let median = number(&found, "/records/0/coherence/0/median");
        assert!((low..=high).contains(&median), "{median}");
        assert_eq!(found["experiments"], serde_json::json!([]));
        let warned = found["warnings"].to_string().contains("explain little");
        assert_eq!(warned, median < 0.5);
    }
}

#[test]
fn a_sensor_that_is_clipped_is_refused() {
    let desk = Desk::new();
    let u = multisine(1..100, 256, 1280);
    let y: Vec<f64> = response(&mode(), &u)
        .into_iter()
        .map(|y| y.clamp(-20.0, 20.0))
        .collect();
    bundle(&desk, &u, &y, Some(256));
    let message = desk.refused("inspect bundle");
    assert!(
        ["run.csv", "`y`", "clip"].iter().all(|p| message.contains(p)),
        "{message}"
    );
}

#[test]
fn the_text_names_what_is_there_and_the_file_stands_for_the_folder() {
    let desk = Desk::new();
    machine_bundle(&desk);
    let text = desk.done("inspect bundle");
    for part in [
        "12 records at 20 Hz",
        "output: y1 [m], y2 [rad]",
        "scheduling covers [-0.06",
        "periodic estimation at 5 positions",
        "noise of one sample",
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
    assert_eq!(text, desk.done("inspect bundle/experiment.toml"));
    // The noise of the machine file's default sensors, at both outputs.
    let found = desk.json("inspect bundle --json");
    close(number(&found, "/noise/0"), 3.3e-8, 1.5e-8);
    close(number(&found, "/noise/1"), 1.7e-6, 0.3e-6);
    mode_bundle(&desk, "mode");
    let warnings = desk.json("inspect mode --json")["warnings"].to_string();
    assert!(warnings.contains("nothing is left to judge"), "{warnings}");
}
