//! Experiments at constant p against exact models.

use lpv_core::{Discrete, StateSpace};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use realfft::RealFftPlanner;
use xytable_plant::{
    ControllerSettings, Experiment, ExperimentSettings, Lines, LoopKind, Machine, MachineParameters,
    Multisine, MultisineSettings, Noise, PlantError, VerifiedController,
};

fn setup() -> (Machine, VerifiedController, Discrete) {
    let machine = MachineParameters::default().check().unwrap();
    let clock = Discrete::from_rate(20.0).unwrap();
    let k = VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock).unwrap();
    (machine, k, clock)
}

fn multisine(period: usize) -> Multisine {
    MultisineSettings {
        period,
        crest_iterations: 10,
        ..MultisineSettings::default()
    }
    .check()
    .unwrap()
}

/// Outputs and inputs of all periods, `[experiment][channel]`, channels `y1, y2, u1, u2`.
type Signals = Vec<Vec<Vec<f64>>>;

fn run(experiment: &Experiment<'_>) -> Signals {
    let mut all = vec![vec![Vec::new(); 4]; 2];
    experiment
        .run(&mut |b| -> Result<(), PlantError> {
            for (i, c) in b.outputs.iter().chain(b.inputs).enumerate() {
                all[b.experiment][i].extend_from_slice(c);
            }
            Ok(())
        })
        .unwrap();
    all
}

fn spectrum(x: &[f64]) -> Vec<Complex<f64>> {
    let plan = RealFftPlanner::new().plan_fft_forward(x.len());
    let (mut input, mut output) = (x.to_vec(), plan.make_output_vec());
    plan.process(&mut input, &mut output).unwrap();
    output
}

/// The digital loop as one state space from `r` to `[y; u]`.
fn closed_loop(machine: &Machine, k: &VerifiedController, p: f64, clock: Discrete) -> StateSpace<Discrete> {
    let plant = machine.sampled(p, clock).unwrap();
    let c = k.sampled()[0].beside(&k.sampled()[1]).unwrap();
    let (n, m) = (plant.states(), c.states());
    let mut a = DMatrix::zeros(n + m, n + m);
    a.view_mut((0, 0), (n, n))
        .copy_from(&(plant.a() - plant.b() * c.d() * plant.c()));
    a.view_mut((0, n), (n, m)).copy_from(&(plant.b() * c.c()));
    a.view_mut((n, 0), (m, n)).copy_from(&(-c.b() * plant.c()));
    a.view_mut((n, n), (m, m)).copy_from(c.a());
    let mut b = DMatrix::zeros(n + m, 2);
    b.view_mut((0, 0), (n, 2)).copy_from(&(plant.b() * c.d()));
    b.view_mut((n, 0), (m, 2)).copy_from(c.b());
    let mut out = DMatrix::zeros(4, n + m);
    out.view_mut((0, 0), (2, n)).copy_from(plant.c());
    out.view_mut((2, 0), (2, n)).copy_from(&(-c.d() * plant.c()));
    out.view_mut((2, n), (2, m)).copy_from(c.c());
    let mut d = DMatrix::zeros(4, 2);
    d.view_mut((2, 0), (2, 2)).copy_from(c.d());
    StateSpace::new(a, b, out, d, clock).unwrap()
}

#[test]
fn the_kernel_is_the_closed_loop() {
    let (machine, k, clock) = setup();
    let r = multisine(1000);
    for p in [-0.3, 0.0, 0.17] {
        let settings = ExperimentSettings {
            periods: 2,
            noise: Noise::Off,
            ..ExperimentSettings::default()
        };
        let ours = run(&Experiment::new(&machine, &k, &r, p, settings).unwrap());
        let model = closed_loop(&machine, &k, p, clock);
        for e in 0..2 {
            let inputs = DMatrix::from_fn(2, 2000, |i, j| r.signal(e, i).unwrap()[j % 1000]);
            let truth = model
                .simulate(&DVector::zeros(model.states()), &inputs)
                .unwrap()
                .outputs;
            for i in 0..4 {
                let size = truth.row(i).amax();
                for j in 0..2000 {
                    let error = (ours[e][i][j] - truth[(i, j)]).abs();
                    assert!(
                        error < 1e-9 * size,
                        "p = {p}, experiment {e}, channel {i}, sample {j}: {error:e} of {size:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn noise_free_frf_is_the_frozen_response_up_to_nyquist() {
    let (machine, k, clock) = setup();
    let period = 1 << 15;
    let r = MultisineSettings {
        crest_iterations: 2,
        ..MultisineSettings::default()
    }
    .check()
    .unwrap();
    let f = r.frequencies_hz(clock);
    assert_eq!((f.len(), f[f.len() - 1]), (1 << 14, 10.0));
    for p in [-0.3, 0.0, 0.12] {
        let settings = ExperimentSettings {
            periods: 3,
            noise: Noise::Off,
            ..ExperimentSettings::default()
        };
        let all = run(&Experiment::new(&machine, &k, &r, p, settings).unwrap());
        let spectra: Vec<Vec<_>> = all
            .iter()
            .map(|e| e.iter().map(|c| spectrum(&c[2 * period..])).collect())
            .collect();
        let truth = machine.sampled(p, clock).unwrap().frequency_response(&f).unwrap();
        let mut worst = (0.0, 0);
        for (index, &line) in r.lines().iter().enumerate() {
            let matrix = |first: usize| nalgebra::Matrix2::from_fn(|i, e| spectra[e][first + i][line]);
            let g = matrix(0) * matrix(2).try_inverse().unwrap();
            let truth = truth.line(index);
            let error = (g - truth).norm() / truth.norm();
            if error > worst.0 {
                worst = (error, line);
            }
        }
        eprintln!("p = {p}: worst relative error {:e} at line {}", worst.0, worst.1);
        assert!(worst.0 < 1e-6, "p = {p}: {worst:?}");
    }
}

#[test]
fn the_continuous_loop_has_an_intersample_error_that_grows_with_frequency() {
    let (machine, k, clock) = setup();
    let r = multisine(4096);
    let settings = ExperimentSettings {
        periods: 3,
        noise: Noise::Off,
        loop_kind: LoopKind::Continuous,
        ..ExperimentSettings::default()
    };
    let all = run(&Experiment::new(&machine, &k, &r, 0.2, settings).unwrap());
    let spectra: Vec<Vec<_>> = all
        .iter()
        .map(|e| e.iter().map(|c| spectrum(&c[8192..])).collect())
        .collect();
    let truth = machine
        .sampled(0.2, clock)
        .unwrap()
        .frequency_response(&r.frequencies_hz(clock))
        .unwrap();
    let error = |line: usize| {
        let matrix = |first: usize| nalgebra::Matrix2::from_fn(|i, e| spectra[e][first + i][line]);
        let g = matrix(0) * matrix(2).try_inverse().unwrap();
        (g - truth.line(line - 1)).norm() / truth.line(line - 1).norm()
    };
    let (low, high) = (error(20), error(1500));
    eprintln!("inter-sample error: {low:e} at line 20, {high:e} at line 1500");
    assert!(low < 0.1 && high > 0.1 && high > low, "{low} {high}");
}

#[test]
fn noise_has_its_deviation_and_its_own_stream() {
    let (machine, k, _) = setup();
    let r = MultisineSettings {
        period: 4096,
        amplitude: 1e-30,
        lines: Lines::List(vec![1]),
        crest_iterations: 0,
        ..MultisineSettings::default()
    }
    .check()
    .unwrap();
    let noisy = |seed, p| {
        let settings = ExperimentSettings {
            periods: 8,
            seed,
            ..ExperimentSettings::default()
        };
        run(&Experiment::new(&machine, &k, &r, p, settings).unwrap())
    };
    let one = noisy(7, 0.1);
    assert_eq!(one, noisy(7, 0.1));
    assert_eq!(noisy(7, 0.0), noisy(7, -0.0));
    assert_ne!(one[0][0], one[1][0]);
    assert_ne!(one[0][0], noisy(8, 0.1)[0][0]);
    assert_ne!(one[0][0], noisy(7, 0.2)[0][0]);
    // The loop amplifies the noise at its bandwidth, so compare the high-pass part: neighbours' differences.
    for (channel, std) in [(0, 1e-7 / 3.0), (1, 5e-6 / 3.0)] {
        let y = &one[0][channel];
        let v = y.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f64>() / (y.len() - 1) as f64;
        let ratio = (0.5 * v).sqrt() / std;
        assert!((ratio - 1.0).abs() < 0.05, "channel {channel}: {ratio}");
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let (machine, k, _) = setup();
    let r = multisine(64);
    let settings = ExperimentSettings::default();
    for p in [0.31, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            Experiment::new(&machine, &k, &r, p, settings),
            Err(PlantError::Position { .. })
        ));
    }
    let none = ExperimentSettings {
        periods: 0,
        ..settings
    };
    assert!(matches!(
        Experiment::new(&machine, &k, &r, 0.0, none),
        Err(PlantError::Setting { .. })
    ));
    let three = MultisineSettings {
        period: 63,
        inputs: 3,
        ..MultisineSettings::default()
    }
    .check()
    .unwrap();
    assert!(matches!(
        Experiment::new(&machine, &k, &three, 0.0, settings),
        Err(PlantError::Length { .. })
    ));
    let stopped = Experiment::new(&machine, &k, &r, 0.0, settings)
        .unwrap()
        .run(&mut |_| Err(PlantError::NoLines { period: 0 }));
    assert_eq!(stopped, Err(PlantError::NoLines { period: 0 }));
}
