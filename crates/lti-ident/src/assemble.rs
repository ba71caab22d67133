//! From records to scaled signals, and from a scaled predictor back to a model.

use crate::predictor::{Predictor, Region};
use crate::problem::{Point, Problem, Run, covariance, longest};
use crate::rest::Rest;
use crate::search::{Coordinates, Limits, search};
use crate::{DirectTerm, Focus, InnovationSettings, LtiIdentError, Offset, Segment};
use lpv_core::{Discrete, InnovationModel, StateSpace};
use nalgebra::{DMatrix, DVector};

/// Largest modulus of a pole of the predictor: what rounding leaves of the unit circle.
const STABLE: f64 = 1.0 - 1e-9;

/// Signals without their means, each divided by its deviation, and the way back.
pub(crate) struct Scaled {
    pub(crate) problem: Problem,
    focus: Focus,
    clock: Discrete,
    inputs: Channels,
    outputs: Channels,
    /// Inputs and outputs of each segment as they were.
    measured: Vec<(DMatrix<f64>, DMatrix<f64>)>,
}

/// Offset and deviation of each channel.
struct Channels {
    offset: DVector<f64>,
    deviation: DVector<f64>,
}

impl Channels {
    fn new(what: &'static str, offset: Offset, signals: &[&DMatrix<f64>]) -> Result<Self, LtiIdentError> {
        let channels = signals.first().map_or(0, |s| s.nrows());
        let samples: usize = signals.iter().map(|s| s.ncols()).sum();
        let average = |f: &dyn Fn(usize, f64) -> f64| {
            DVector::from_fn(channels, |i, _| {
                signals
                    .iter()
                    .flat_map(|s| s.row(i).iter().map(|&v| f(i, v)).collect::<Vec<_>>())
                    .sum::<f64>()
                    / samples as f64
            })
        };
        let means = average(&|_, v| v);
        let deviation = average(&|i, v| (v - means[i]).powi(2)).map(f64::sqrt);
        for channel in 0..channels {
            let least = 1e-12 * means[channel].abs();
            if !(deviation[channel] > least && deviation[channel].is_normal()) {
                return Err(LtiIdentError::Constant { what, channel });
            }
        }
        let offset = match offset {
            Offset::Estimated => means,
            Offset::Zero => DVector::zeros(channels),
        };
        Ok(Self { offset, deviation })
    }

    fn scaled(&self, signals: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(signals.nrows(), signals.ncols(), |i, k| {
            (signals[(i, k)] - self.offset[i]) / self.deviation[i]
        })
    }

    /// In units of the records.
    fn raised(&self, scaled: &DVector<f64>) -> DVector<f64> {
        &self.offset + scaled.component_mul(&self.deviation)
    }
}

/// A model with its state at the first sample of each segment.
pub(crate) struct Assembled {
    pub(crate) model: InnovationModel,
    pub(crate) initial: Vec<DVector<f64>>,
}

/// What a model does with the data it was fitted to.
pub(crate) struct Judged {
    pub(crate) simulated: Vec<f64>,
    pub(crate) one_step: Vec<f64>,
    pub(crate) covariance: DMatrix<f64>,
}

impl Scaled {
    pub(crate) fn new(
        segments: &[Segment],
        clock: Discrete,
        settings: &InnovationSettings,
    ) -> Result<Self, LtiIdentError> {
        settings.check()?;
        crate::segment::check(segments)?;
        let measured: Vec<_> = segments.iter().map(|s| (s.inputs(), s.outputs())).collect();
        let u: Vec<_> = measured.iter().map(|(u, _)| u).collect();
        let y: Vec<_> = measured.iter().map(|(_, y)| y).collect();
        let inputs = Channels::new("input", settings.offset, &u)?;
        let outputs = Channels::new("output", settings.offset, &y)?;
        let run = |(u, y): &(DMatrix<f64>, DMatrix<f64>)| {
            let (u, y) = (inputs.scaled(u), outputs.scaled(y));
            let known = match settings.focus {
                Focus::Simulation => u,
                Focus::Prediction => above(&u, &y),
            };
            Run { known, outputs: y }
        };
        let direct = match settings.direct {
            DirectTerm::Estimated => inputs.offset.len(),
            DirectTerm::Zero => 0,
        };
        let runs: Vec<Run> = measured.iter().map(run).collect();
        let region = Region::for_samples(longest(&runs), settings.offset);
        let problem = Problem {
            runs,
            direct,
            offset: settings.offset,
            region,
        };
        Ok(Self {
            problem,
            focus: settings.focus,
            clock,
            inputs,
            outputs,
            measured,
        })
    }

    fn channels(&self) -> (usize, usize) {
        (self.inputs.offset.len(), self.outputs.offset.len())
    }

    /// Free parameters of an order, initial states not counted.
    pub(crate) fn parameters(&self, order: usize) -> usize {
        let feedthrough: usize = self
            .problem
            .feedthrough(order)
            .iter()
            .map(|(_, (r, c))| r * c)
            .sum();
        order * (self.problem.known() + self.problem.outputs()) + feedthrough
    }

    pub(crate) fn enough_samples(&self, order: usize) -> Result<(), LtiIdentError> {
        let unknowns = self.parameters(order) + order * self.problem.runs.len();
        let equations = self.problem.samples() * self.problem.outputs();
        if equations > unknowns {
            return Ok(());
        }
        let what = "state-space model";
        Err(LtiIdentError::TooFewSamples {
            what,
            equations,
            unknowns,
        })
    }

    /// Rows for scaled outputs.
    pub(crate) fn scaled_rows(&self, c: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(c.nrows(), c.ncols(), |i, j| c[(i, j)] / self.outputs.deviation[i])
    }

    /// The model in the units of the records.
    pub(crate) fn model(&self, point: &Point, limits: Limits) -> Result<Assembled, LtiIdentError> {
        let (nu, ny) = self.channels();
        let (predictor, rest) = match self.focus {
            Focus::Prediction => (point.predictor.clone(), Rest::of_predictor(&point.predictor, nu)?),
            Focus::Simulation => (self.with_gain(point, limits)?, Rest::of_plant(&point.predictor)),
        };
        let (b, d) = (predictor.b().into_owned(), predictor.d().into_owned());
        let gain = b.columns(nu, ny).into_owned();
        let (c, d) = (predictor.c().into_owned(), d.columns(0, nu).into_owned());
        let a = predictor.a() + &gain * &c;
        let b = b.columns(0, nu) + &gain * &d;
        let up = |m: DMatrix<f64>| DMatrix::from_diagonal(&self.outputs.deviation) * m;
        let down = |m: DMatrix<f64>, by: &DVector<f64>| m * DMatrix::from_diagonal(&by.map(|s| 1.0 / s));
        let plant = StateSpace::new(
            a,
            down(b, &self.inputs.deviation),
            up(c),
            up(down(d, &self.inputs.deviation)),
            self.clock,
        )?;
        let gain = down(gain, &self.outputs.deviation);
        let (u_0, y_0) = (self.inputs.raised(&rest.input), self.outputs.raised(&rest.output));
        let build = |covariance: DMatrix<f64>| {
            InnovationModel::new(plant.clone(), gain.clone(), covariance, u_0.clone(), y_0.clone())
        };
        let initial: Vec<_> = point.initial.iter().map(|x| x - &rest.state).collect();
        let bare = build(DMatrix::zeros(ny, ny))?;
        let errors: Result<Vec<_>, LtiIdentError> = self
            .measured
            .iter()
            .zip(&initial)
            .map(|((u, y), x)| Ok(y - bare.predict_one_step(x, u, y)?.outputs))
            .collect();
        let model = build(covariance(&errors?))?;
        Ok(Assembled { model, initial })
    }

    /// The predictor of the plant with the K that predicts best; the response from u is not changed.
    fn with_gain(&self, point: &Point, limits: Limits) -> Result<Predictor, LtiIdentError> {
        let plant = &point.predictor;
        let (n, ny, nu) = (plant.states, plant.outputs(), plant.inputs());
        let (c, d) = (plant.c().into_owned(), plant.d().into_owned());
        let none = DMatrix::zeros(n, ny);
        let zero = DMatrix::zeros(ny, ny);
        let b = above(&plant.b().transpose(), &none.transpose()).transpose();
        let feed = above(&d.transpose(), &zero).transpose();
        let start = Predictor::new(&plant.a().into_owned(), &b, &c, &feed)?;
        let run = |r: &Run| {
            let mut outputs = r.outputs.clone();
            outputs.column_iter_mut().for_each(|mut y| y -= plant.offset());
            Run {
                known: above(&r.known, &outputs),
                outputs,
            }
        };
        let problem = Problem {
            runs: self.problem.runs.iter().map(run).collect(),
            direct: nu,
            offset: Offset::Zero,
            region: Region::circle(STABLE),
        };
        // dK changes A by -dK C, B by [-dK D, dK].
        let shape = start.matrix.shape();
        let mut directions = DMatrix::zeros(shape.0 * shape.1, n * ny);
        for j in 0..ny {
            for i in 0..n {
                let mut change = DMatrix::zeros(shape.0, shape.1);
                change.view_mut((i, 0), (1, n)).copy_from(&-c.row(j));
                change.view_mut((i, n), (1, nu)).copy_from(&-d.row(j));
                change[(i, n + nu + j)] = 1.0;
                directions
                    .column_mut(j * n + i)
                    .copy_from_slice(change.as_slice());
            }
        }
        let Some(point) = problem.point(start, point.initial.clone()) else {
            return Err(LtiIdentError::NoStart { order: n });
        };
        Ok(search(&problem, point, &Coordinates::Fixed(directions), limits)
            .point
            .predictor)
    }

    pub(crate) fn judge(&self, Assembled { model, initial }: &Assembled) -> Result<Judged, LtiIdentError> {
        let (mut simulated, mut one_step) = (Vec::new(), Vec::new());
        for ((u, y), x) in self.measured.iter().zip(initial) {
            simulated.push(y - model.simulate(x, u)?.outputs);
            one_step.push(y - model.predict_one_step(x, u, y)?.outputs);
        }
        let y: Vec<_> = self.measured.iter().map(|(_, y)| y).collect();
        Ok(Judged {
            simulated: fit_percent(&y, &simulated),
            one_step: fit_percent(&y, &one_step),
            covariance: covariance(&simulated),
        })
    }
}

/// `100 (1 - |e| / |y - mean|)` of each output over all segments.
fn fit_percent(outputs: &[&DMatrix<f64>], errors: &[DMatrix<f64>]) -> Vec<f64> {
    let channels = outputs.first().map_or(0, |y| y.nrows());
    (0..channels)
        .map(|i| {
            let all: Vec<f64> = outputs
                .iter()
                .flat_map(|y| y.row(i).iter().copied().collect::<Vec<_>>())
                .collect();
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            let spread: f64 = all.iter().map(|v| (v - mean).powi(2)).sum();
            let error: f64 = errors.iter().map(|e| e.row(i).norm_squared()).sum();
            100.0 * (1.0 - (error / spread).sqrt())
        })
        .collect()
}

fn above(top: &DMatrix<f64>, bottom: &DMatrix<f64>) -> DMatrix<f64> {
    let mut m = DMatrix::zeros(top.nrows() + bottom.nrows(), top.ncols());
    m.rows_mut(0, top.nrows()).copy_from(top);
    m.rows_mut(top.nrows(), bottom.nrows()).copy_from(bottom);
    m
}
