//! The works that are compared: their inputs, our way, and the error of a result.

mod moving;
mod positions;
mod refinement;

use lpv_benches::{Bench, accumulator, twelve_poles};
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::num_complex::Complex;
use lpv_core::{Clock, Discrete, Frf, FrfEstimate, PeriodBlock, StateSpace};
use lpv_ident::{RegressionSettings, regress};
use pole_fit::fit;
use std::error::Error;
use std::path::Path;
use xytable_plant::{Experiment, ExperimentSettings, MultisineSettings};

type C64 = Complex<f64>;
pub(crate) type Failure = Box<dyn Error + Send + Sync>;

/// One run, which gives the result as numbers.
pub(crate) type Run = Box<dyn FnMut() -> Result<Vec<f64>, Failure>>;

/// One of the other tools.
pub(crate) struct Peer {
    pub(crate) name: &'static str,
    pub(crate) way: Way,
    /// Ratio of the times, theirs over ours, that is asked for on one thread.
    pub(crate) bar: f64,
}

/// How another tool is run.
pub(crate) enum Way {
    /// Script in `benches/peers`, and a word for it.
    Python(&'static str, &'static str),
    /// A crate.
    Rust(fn() -> Result<Run, Failure>),
}

/// What both do.
pub(crate) struct Work {
    pub(crate) name: &'static str,
    pub(crate) what: &'static str,
    pub(crate) peers: &'static [Peer],
    /// Writes the inputs.
    pub(crate) export: fn(&Path) -> Result<(), Failure>,
    pub(crate) ours: fn() -> Result<Run, Failure>,
    /// Relative error of a result.
    pub(crate) error: fn(&[f64]) -> Result<f64, Failure>,
    /// Error that is small enough, whatever the peer's is.
    pub(crate) enough: f64,
    /// Parts of equal length of a result; in each, ours and theirs are to be the same numbers; 0 where they need not.
    pub(crate) same: usize,
}

impl Work {
    /// Largest relative difference of results that are the same.
    const SAME: f64 = 1e-8;

    /// That both have computed the same, where they have to.
    pub(crate) fn compare(&self, ours: &[f64], theirs: &[f64]) -> Result<(), Failure> {
        if self.same == 0 {
            return Ok(());
        }
        if ours.len() != theirs.len() {
            return Err(format!(
                "{}: {} numbers and {} of theirs",
                self.name,
                ours.len(),
                theirs.len()
            )
            .into());
        }
        let length = ours.len().div_ceil(self.same).max(1);
        for (part, (a, b)) in ours.chunks(length).zip(theirs.chunks(length)).enumerate() {
            let difference = distance(a, b)?;
            if difference.is_nan() || difference > Self::SAME {
                return Err(format!(
                    "{}: part {part} of ours differs from theirs by {difference:.1e}",
                    self.name
                )
                .into());
            }
        }
        Ok(())
    }
}

const fn python(name: &'static str, script: &'static str, word: &'static str, bar: f64) -> Peer {
    Peer {
        name,
        way: Way::Python(script, word),
        bar,
    }
}

const fn rust(name: &'static str, run: fn() -> Result<Run, Failure>, bar: f64) -> Peer {
    Peer {
        name,
        way: Way::Rust(run),
        bar,
    }
}

pub(crate) const WORKS: [Work; 8] = [
    Work {
        name: "frf",
        what: "FRF of a 2x2 experiment with its covariance, 25 periods of 2^15",
        peers: &[python("scipy, numpy", "frf_scipy.py", "", 4.0)],
        export: frf_export,
        ours: frf_ours,
        error: frf_error,
        enough: 0.0,
        // Response, covariance of the outputs, factor of the inputs.
        same: 3,
    },
    Work {
        name: "poles",
        what: "pole fit, 401 lines, 12 poles, 2x2",
        peers: &[
            rust("dsmc", poles_dsmc, 1.5),
            python("scikit-rf", "poles_skrf.py", "", 8.0),
        ],
        export: poles_export,
        ours: poles_ours,
        error: poles_error,
        enough: 0.0,
        same: 0,
    },
    Work {
        name: "simulation",
        what: "simulation at constant p, 24 states, 65,536 samples",
        peers: &[
            python("python-control", "simulation_control.py", "", 50.0),
            python("scipy (dlsim)", "simulation_scipy.py", "", 50.0),
            python("numpy (64 samples a step)", "simulation_blocks.py", "", 50.0),
        ],
        export: simulation_export,
        ours: simulation_ours,
        error: simulation_error,
        enough: 0.0,
        same: 0,
    },
    Work {
        name: "response",
        what: "frequency response, 24 states, 2,000 lines",
        peers: &[python("python-control", "response_control.py", "", 30.0)],
        export: response_export,
        ours: response_ours,
        error: response_error,
        enough: 0.0,
        same: 0,
    },
    Work {
        name: "regression",
        what: "regression core, 21 positions, 16,383 lines, 16 functions, 2x2, weighted by the covariance",
        peers: &[
            python("numpy (lstsq)", "regression_numpy.py", "lstsq", 20.0),
            python("numpy (batched QR)", "regression_numpy.py", "qr", 4.0),
            python("numpy (normal equations)", "regression_numpy.py", "normal", 4.0),
        ],
        export: regression_export,
        ours: regression_ours,
        error: regression_error,
        enough: 0.0,
        same: 0,
    },
    Work {
        name: "moving",
        what: "moving-p simulation of the plant in its loop, 4,000 samples, error below 1e-10",
        peers: &[
            python("scipy (solve_ivp, DOP853)", "moving_scipy.py", "", 100.0),
            rust("differential-equations (DOP853)", moving::peer, 5.0),
        ],
        export: moving::export,
        ours: moving::ours,
        error: moving::error,
        enough: 1e-10,
        same: 0,
    },
    Work {
        name: "refinement",
        what: "LFR refinement to the same cost, 8 states, 5 deltas, 21 positions, 160 lines",
        peers: &[python(
            "scipy (least_squares, analytic Jacobian)",
            "refinement_scipy.py",
            "",
            15.0,
        )],
        export: refinement::export,
        ours: refinement::ours,
        error: refinement::error,
        enough: 0.0,
        same: 0,
    },
    Work {
        name: "positions",
        what: "LPV fit over 9 positions, 401 lines, judged between them",
        peers: &[python(
            "scikit-rf (VectorFittingParametric)",
            "positions_skrf.py",
            "",
            10.0,
        )],
        export: positions::export,
        ours: positions::ours,
        error: positions::error,
        enough: 0.0,
        same: 0,
    },
];

/// States of the larger models.
const STATES: usize = 24;

fn write(folder: &Path, name: &str, values: impl IntoIterator<Item = f64>) -> Result<(), Failure> {
    let bytes: Vec<u8> = values.into_iter().flat_map(f64::to_le_bytes).collect();
    Ok(std::fs::write(folder.join(format!("{name}.f64")), bytes)?)
}

fn parts(z: C64) -> [f64; 2] {
    [z.re, z.im]
}

/// As they stand, one list after the other.
fn numbers_of(lists: &[&[C64]]) -> Vec<f64> {
    let mut all = Vec::with_capacity(2 * lists.iter().map(|list| list.len()).sum::<usize>());
    for value in lists.iter().copied().flatten() {
        all.extend_from_slice(&parts(*value));
    }
    all
}

/// Line after line, row after row.
fn rows_of(frf: &Frf) -> Vec<f64> {
    let (ny, nu) = (frf.outputs(), frf.inputs());
    let mut all = Vec::with_capacity(2 * frf.values().len());
    for line in frf.values().chunks_exact(ny * nu) {
        for i in 0..ny {
            for value in line[i..].iter().step_by(ny) {
                all.extend_from_slice(&parts(*value));
            }
        }
    }
    all
}

/// Matrices of lines as their estimate gives them.
fn lines_of<'a>(count: usize, line: impl Fn(usize) -> lpv_core::nalgebra::DMatrixView<'a, C64>) -> Vec<f64> {
    (0..count)
        .flat_map(|k| {
            line(k)
                .transpose()
                .iter()
                .copied()
                .flat_map(parts)
                .collect::<Vec<_>>()
        })
        .collect()
}

fn distance(found: &[f64], truth: &[f64]) -> Result<f64, Failure> {
    if found.len() != truth.len() {
        return Err(format!(
            "a result of {} numbers where {} are true",
            found.len(),
            truth.len()
        )
        .into());
    }
    let error: f64 = found.iter().zip(truth).map(|(a, b)| (a - b).powi(2)).sum();
    let size: f64 = truth.iter().map(|b| b * b).sum();
    Ok((error / size).sqrt())
}

fn system_export(folder: &Path, model: &StateSpace<Discrete>) -> Result<(), Failure> {
    for (name, matrix) in [
        ("a", model.a()),
        ("b", model.b()),
        ("c", model.c()),
        ("d", model.d()),
    ] {
        write(folder, name, matrix.transpose().iter().copied())?;
    }
    Ok(())
}

// FRF of an experiment.

const PERIOD: usize = 1 << 15;
const PERIODS: usize = 25;

/// Signals of one period of one experiment: outputs, inputs, references.
type Period = [Vec<Vec<f64>>; 3];

fn periods(bench: &Bench) -> Result<Vec<Period>, Failure> {
    let multisine = MultisineSettings {
        period: PERIOD,
        crest_iterations: 2,
        ..MultisineSettings::default()
    };
    let settings = ExperimentSettings {
        periods: PERIODS,
        ..ExperimentSettings::default()
    };
    let multisine = multisine.check()?;
    let experiment = Experiment::new(&bench.machine, &bench.controller, &multisine, 0.2, settings)?;
    let mut periods = Vec::new();
    experiment.run(&mut |block| -> Result<(), xytable_plant::PlantError> {
        periods.push((
            block.experiment,
            block.period,
            [
                block.outputs.to_vec(),
                block.inputs.to_vec(),
                block.references.to_vec(),
            ],
        ));
        Ok(())
    })?;
    periods.sort_by_key(|(experiment, period, _)| (*experiment, *period));
    Ok(periods.into_iter().map(|(.., signals)| signals).collect())
}

fn frf_estimate(periods: &[Period]) -> Result<FrfEstimate, Failure> {
    let mut sums = accumulator(PERIOD, 2, Some(0.2.into()))?;
    for (i, [outputs, inputs, references]) in periods.iter().enumerate() {
        sums.push(&PeriodBlock {
            experiment: i / PERIODS,
            period: i % PERIODS,
            outputs,
            inputs,
            references,
        })?;
    }
    Ok(sums.finish()?.estimate)
}

fn frf_export(folder: &Path) -> Result<(), Failure> {
    let periods = periods(&Bench::new()?)?;
    write(
        folder,
        "signals",
        periods.iter().flatten().flatten().flatten().copied(),
    )?;
    let estimate = frf_estimate(&periods)?;
    let width = 20.0 / PERIOD as f64;
    let lines = estimate
        .frf()
        .frequencies_hz()
        .iter()
        .map(|f| (f / width).round());
    write(folder, "lines", lines)
}

fn frf_ours() -> Result<Run, Failure> {
    let periods = periods(&Bench::new()?)?;
    Ok(Box::new(move || {
        let found = frf_estimate(&periods)?;
        Ok(numbers_of(&[
            found.frf().values(),
            found.output_covariances(),
            found.input_factors(),
        ]))
    }))
}

fn frf_error(found: &[f64]) -> Result<f64, Failure> {
    let bench = Bench::new()?;
    let periods = periods(&bench)?;
    let lines = frf_estimate(&periods)?.frf().frequencies_hz().to_vec();
    let truth = bench
        .machine
        .sampled(0.2, bench.clock)?
        .frequency_response(&lines)?;
    let truth = numbers_of(&[truth.values()]);
    distance(&found[..truth.len().min(found.len())], &truth)
}

// Poles of an FRF.

fn poles_frf(bench: &Bench) -> Result<Frf, Failure> {
    Ok(bench.large_model(14)?.frequency_response(&bench.lines_hz(401))?)
}

fn poles_export(folder: &Path) -> Result<(), Failure> {
    let bench = Bench::new()?;
    let frf = poles_frf(&bench)?;
    write(folder, "rates", warped(&bench, frf.frequencies_hz()))?;
    write(folder, "frf", rows_of(&frf))
}

/// A sampled response is a rational function of `s = (2/T) (z - 1)/(z + 1)`, on the imaginary axis at these rates.
fn warped(bench: &Bench, lines: &[f64]) -> Vec<f64> {
    let t = bench.clock.sample_time();
    let rate = |f: &f64| 2.0 / t * (std::f64::consts::PI * f * t).tan();
    lines.iter().map(rate).collect()
}

/// It fits one channel at a time.
fn poles_dsmc() -> Result<Run, Failure> {
    use dsmc::system_identification::frequency_response::vector_fitting::{
        VectorFittingOptions, identify_relative,
    };
    let bench = Bench::new()?;
    let frf = poles_frf(&bench)?;
    let rates = warped(&bench, frf.frequencies_hz());
    // The double integrator is known: it is taken off before the fit and put back after it.
    let (a, b) = (20.0 * std::f64::consts::PI, 40.0 * std::f64::consts::PI);
    let rigid: Vec<C64> = rates
        .iter()
        .map(|omega| C64::new(a, *omega) * C64::new(b, *omega) / C64::new(0.0, *omega).powu(2))
        .collect();
    let channels: Vec<Vec<dsmc::FrequencyResponse<f64>>> = [(0, 0), (0, 1), (1, 0), (1, 1)]
        .map(|(i, j)| {
            let values = frf.channel(i, j).zip(&rigid).zip(&rates);
            values
                .map(|((value, rigid), omega)| dsmc::FrequencyResponse {
                    omega: *omega,
                    value: value / rigid,
                })
                .collect()
        })
        .to_vec();
    let options = VectorFittingOptions {
        fit_d: true,
        ..VectorFittingOptions::default()
    };
    Ok(Box::new(move || {
        let mut all = vec![C64::from(0.0); 4 * rates.len()];
        for (c, samples) in channels.iter().enumerate() {
            let found = identify_relative(samples, 12, &options)?;
            for (k, omega) in rates.iter().enumerate() {
                let s = C64::new(0.0, *omega);
                let terms = found.poles.iter().zip(&found.residues).map(|(p, r)| r / (s - p));
                all[4 * k + c] = (terms.sum::<C64>() + found.d) * rigid[k];
            }
        }
        Ok(all.into_iter().flat_map(parts).collect())
    }))
}

fn poles_ours() -> Result<Run, Failure> {
    let bench = Bench::new()?;
    let estimate = FrfEstimate::with_unit_covariance(poles_frf(&bench)?, None)?;
    let settings = twelve_poles();
    Ok(Box::new(move || {
        let found = fit(&estimate, bench.clock, &settings)?;
        Ok(rows_of(&found.response(estimate.frf().frequencies_hz())?))
    }))
}

fn poles_error(found: &[f64]) -> Result<f64, Failure> {
    distance(found, &rows_of(&poles_frf(&Bench::new()?)?))
}

// Simulation.

const SAMPLES: usize = 1 << 16;

/// The larger model without its double integrator's drift: a loop that is closed is stable.
fn stable_model(bench: &Bench) -> Result<StateSpace<Discrete>, Failure> {
    let model = bench.large_model(STATES)?;
    let a = model.a() * 0.999;
    Ok(StateSpace::new(
        a,
        model.b().clone(),
        model.c().clone(),
        model.d().clone(),
        bench.clock,
    )?)
}

fn simulation_inputs() -> DMatrix<f64> {
    DMatrix::from_fn(2, SAMPLES, |i, k| {
        ((0.37 + 0.11 * i as f64) * k as f64).sin() + 0.3 * (0.0123 * (k * k % 7919) as f64).cos()
    })
}

fn simulation_export(folder: &Path) -> Result<(), Failure> {
    system_export(folder, &stable_model(&Bench::new()?)?)?;
    write(folder, "inputs", simulation_inputs().iter().copied())
}

fn simulation_ours() -> Result<Run, Failure> {
    let model = stable_model(&Bench::new()?)?;
    let (inputs, rest) = (simulation_inputs(), DVector::zeros(STATES));
    Ok(Box::new(move || {
        Ok(model.simulate(&rest, &inputs)?.outputs.as_slice().to_vec())
    }))
}

/// A number and what rounding took from it.
#[derive(Clone, Copy, Default)]
struct Twofold(f64, f64);

impl Twofold {
    fn add_product(self, a: f64, b: Self) -> Self {
        let product = a * b.0;
        let low = a.mul_add(b.0, -product) + a * b.1;
        let sum = self.0 + product;
        let part = sum - self.0;
        let lost = (self.0 - (sum - part)) + (product - part);
        let low = self.1 + low + lost;
        let high = sum + low;
        Self(high, low - (high - sum))
    }
}

fn simulation_error(found: &[f64]) -> Result<f64, Failure> {
    let model = stable_model(&Bench::new()?)?;
    let inputs = simulation_inputs();
    let mut x = vec![Twofold::default(); STATES];
    let mut truth = Vec::with_capacity(2 * SAMPLES);
    for u in inputs.column_iter() {
        let row = |m: &DMatrix<f64>, n: &DMatrix<f64>, i: usize| {
            let state = x
                .iter()
                .enumerate()
                .fold(Twofold::default(), |s, (j, x)| s.add_product(m[(i, j)], *x));
            u.iter()
                .enumerate()
                .fold(state, |s, (j, u)| s.add_product(n[(i, j)], Twofold(*u, 0.0)))
        };
        truth.extend((0..2).map(|i| row(model.c(), model.d(), i).0));
        x = (0..STATES).map(|i| row(model.a(), model.b(), i)).collect();
    }
    distance(found, &truth)
}

// Frequency response.

fn response_export(folder: &Path) -> Result<(), Failure> {
    let bench = Bench::new()?;
    system_export(folder, &bench.large_model(STATES)?)?;
    write(folder, "lines", bench.lines_hz(2000))
}

fn response_ours() -> Result<Run, Failure> {
    let bench = Bench::new()?;
    let (model, lines) = (bench.large_model(STATES)?, bench.lines_hz(2000));
    Ok(Box::new(move || Ok(rows_of(&model.frequency_response(&lines)?))))
}

/// Against a dense solution a line, refined in twofold precision until it holds it.
fn response_error(found: &[f64]) -> Result<f64, Failure> {
    let bench = Bench::new()?;
    let model = bench.large_model(STATES)?;
    let (a, b, c, d) = (model.a(), model.b(), model.c(), model.d());
    let mut truth = Vec::new();
    for f in bench.lines_hz(2000) {
        let z = bench.clock.point(f);
        let shifted = DMatrix::identity(STATES, STATES) * z - a.map(C64::from);
        let lu = shifted.lu();
        let mut columns = Vec::new();
        for j in 0..2 {
            // Real and imaginary parts of the states.
            let mut x = vec![[Twofold::default(); 2]; STATES];
            for _ in 0..4 {
                // b - (z I - A) x
                let left = DVector::from_fn(STATES, |i, _| {
                    let start = [Twofold(b[(i, j)], 0.0), Twofold::default()];
                    let [re, im] = (0..STATES).fold(start, |sum, k| {
                        [0, 1].map(|part| sum[part].add_product(a[(i, k)], x[k][part]))
                    });
                    let [x, y] = x[i];
                    C64::new(
                        re.add_product(-z.re, x).add_product(z.im, y).0,
                        im.add_product(-z.re, y).add_product(-z.im, x).0,
                    )
                });
                let step = lu.solve(&left).ok_or("a line on a pole")?;
                for (x, step) in x.iter_mut().zip(step.iter()) {
                    *x = [(x[0], step.re), (x[1], step.im)].map(|(x, s)| x.add_product(s, Twofold(1.0, 0.0)));
                }
            }
            columns.push(x);
        }
        for i in 0..2 {
            for (j, x) in columns.iter().enumerate() {
                truth.extend([0, 1].map(|part| {
                    let direct = Twofold(if part == 0 { d[(i, j)] } else { 0.0 }, 0.0);
                    (0..STATES)
                        .fold(direct, |sum, k| sum.add_product(c[(i, k)], x[k][part]))
                        .0
                }));
            }
        }
    }
    distance(found, &truth)
}

// Regression.

const POSITIONS: usize = 21;
const LINES: usize = (1 << 14) - 1;
const FUNCTIONS: usize = 16;

/// Weight of a function in a channel: any, but known.
fn true_weight(p: usize, n: usize, i: usize, j: usize) -> f64 {
    1e-3 * (1.0 + 0.3 * p as f64 + 1.7 * n as f64 + 2.9 * i as f64 + 4.1 * j as f64).sin()
}

/// Responses of known weights with the noise of an experiment and its covariance; and the basis.
fn regression_inputs() -> Result<(Vec<FrfEstimate>, StateSpace<Discrete>), Failure> {
    let bench = Bench::new()?;
    let (basis, lines) = (bench.basis(FUNCTIONS)?, bench.lines_hz(LINES));
    let phi = basis.frequency_response(&lines)?;
    let estimates = bench
        .estimates(POSITIONS, LINES)?
        .into_iter()
        .enumerate()
        .map(|(p, estimate)| {
            let position = estimate.single_position().unwrap_or(0.0);
            let plant = bench
                .machine
                .sampled(position, bench.clock)?
                .frequency_response(&lines)?;
            let mut frf = estimate.frf().clone();
            for k in 0..LINES {
                let (functions, exact) = (phi.line(k), plant.line(k));
                for (at, value) in frf.line_slice_mut(k).iter_mut().enumerate() {
                    let (i, j) = (at % 2, at / 2);
                    let model: C64 = (0..FUNCTIONS)
                        .map(|n| functions[(n, 0)] * true_weight(p, n, i, j))
                        .sum();
                    *value += model - exact[(i, j)];
                }
            }
            let all = |line: &dyn Fn(usize) -> Vec<C64>| (0..LINES).flat_map(line).collect::<Vec<_>>();
            let noise = all(&|k| estimate.output_covariance(k).iter().copied().collect());
            let factor = all(&|k| estimate.input_factor(k).iter().copied().collect());
            let degrees = estimate.degrees_of_freedom();
            Ok(FrfEstimate::new(
                frf,
                noise,
                factor,
                degrees,
                Some(position.into()),
            )?)
        });
    Ok((estimates.collect::<Result<_, Failure>>()?, basis))
}

fn regression_export(folder: &Path) -> Result<(), Failure> {
    let (estimates, basis) = regression_inputs()?;
    write(folder, "frf", estimates.iter().flat_map(|e| rows_of(e.frf())))?;
    let noise = |e: &FrfEstimate| lines_of(LINES, |k| e.output_covariance(k));
    write(folder, "noise", estimates.iter().flat_map(noise))?;
    let factor = |e: &FrfEstimate| lines_of(LINES, |k| e.input_factor(k));
    write(folder, "factor", estimates.iter().flat_map(factor))?;
    let phi = basis.frequency_response(estimates[0].frf().frequencies_hz())?;
    write(folder, "basis", phi.values().iter().copied().flat_map(parts))
}

fn regression_ours() -> Result<Run, Failure> {
    let (estimates, basis) = regression_inputs()?;
    let settings = RegressionSettings::default();
    Ok(Box::new(move || {
        let fits = regress(&estimates, &basis, &settings)?;
        let mut all = Vec::new();
        for fit in fits.fits() {
            for n in 0..FUNCTIONS {
                all.extend(fit.weights.columns(2 * n, 2).transpose().iter());
            }
        }
        Ok(all)
    }))
}

/// Against the known weights: what the noise leaves.
fn regression_error(found: &[f64]) -> Result<f64, Failure> {
    let mut truth = Vec::new();
    for p in 0..POSITIONS {
        for n in 0..FUNCTIONS {
            truth.extend([(0, 0), (0, 1), (1, 0), (1, 1)].map(|(i, j)| true_weight(p, n, i, j)));
        }
    }
    distance(found, &truth)
}
