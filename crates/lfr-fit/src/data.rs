//! Frequency responses at constant p, with the weight of each line.

use crate::FitError;
use crate::whiten::Whitening;
use lpv_core::{Clock, Discrete, Frf, FrfEstimate, StateSpace};
use nalgebra::DMatrix;
use num_complex::Complex;
use rayon::prelude::*;

/// What a residual of one means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResidualUnit {
    /// `||F - G||_F / ||G||_F` of a line.
    Relative,
    /// One standard deviation of the data, in every real equation.
    StandardDeviation,
}

/// The responses of a machine at a number of constant positions: what a frozen model is fitted to.
///
/// The residual of a line is `W_y (F - G) W_u`, F the model and G the data.
#[derive(Debug, Clone)]
pub struct FrozenData {
    clock: Discrete,
    unit: ResidualUnit,
    positions: Vec<Position>,
}

/// The lines of one position.
#[derive(Debug, Clone)]
pub(crate) struct Position {
    pub(crate) p: Vec<f64>,
    pub(crate) frf: Frf,
    pub(crate) z: Vec<Complex<f64>>,
    /// A factor a line, on top of the whitening.
    pub(crate) scale: Vec<f64>,
    /// `W_y` and `W_u` of each line; none where they are the identity.
    pub(crate) whitening: Option<Whitening>,
    /// Sampled poles, as far as they are known.
    pub(crate) poles: Vec<Complex<f64>>,
}

impl FrozenData {
    /// Every line is divided by its size `||G||_F`: what is minimised is the relative error. Each entry: the constant
    /// scheduling values and the response there.
    ///
    /// # Errors
    /// [`FitError::Empty`], [`FitError::Data`] for positions that do not fit together, [`FitError::Line`]
    /// for a line that is zero or above Nyquist.
    pub fn relative(clock: Discrete, responses: &[(Vec<f64>, Frf)]) -> Result<Self, FitError> {
        let positions = responses.iter().enumerate().map(|(index, (p, frf))| {
            let sizes = (0..frf.len()).map(|k| {
                let scale = 1.0 / frf.line(k).norm();
                scale.is_finite().then_some(scale).ok_or_else(|| {
                    line_error(
                        index,
                        frf,
                        k,
                        "the response is zero, so that nothing is relative to it",
                    )
                })
            });
            let scale = sizes.collect::<Result<Vec<_>, _>>()?;
            Position::new(index, clock, p, frf, scale, None)
        });
        Self::joined(
            clock,
            ResidualUnit::Relative,
            positions.collect::<Result<Vec<_>, _>>()?,
        )
    }

    /// Every line is whitened by the Kronecker covariance of its estimate: maximum likelihood for circular normal
    /// noise. `model_error`: what the model cannot represent, relative to the response; its square is added to the
    /// variance of each row of G, so that lines of a very good signal to noise ratio do not buy their fit with large
    /// errors elsewhere. The position is the one given here, not that of the estimate.
    ///
    /// # Errors
    /// As [`FrozenData::relative`]; [`FitError::Line`] for a covariance that is not positive definite;
    /// [`FitError::Setting`] for a model error that is negative or not finite.
    pub fn weighted(
        clock: Discrete,
        estimates: &[(Vec<f64>, FrfEstimate)],
        model_error: f64,
    ) -> Result<Self, FitError> {
        if !(model_error.is_finite() && model_error >= 0.0) {
            return Err(FitError::Setting {
                name: "model_error",
                value: model_error,
                allowed: "give a finite number, not negative",
            });
        }
        let positions = estimates.iter().enumerate().map(|(index, (p, estimate))| {
            let frf = estimate.frf();
            let whitening = Whitening::new(estimate, model_error).map_err(|line| {
                let problem = "the covariance is not positive definite; estimate it from more data or weight relatively";
                line_error(index, frf, line, problem)
            })?;
            Position::new(index, clock, p, frf, vec![1.0; frf.len()], Some(whitening))
        });
        let positions = positions.collect::<Result<Vec<_>, _>>()?;
        Self::joined(clock, ResidualUnit::StandardDeviation, positions)
    }

    /// The same data with the sampled poles of the machine at each position, in the order of the positions, as far as they are
    /// known: [`crate::grow`] tries them for its frozen models. It needs them where a resonance moves by more than its width
    /// from one position to the next.
    ///
    /// # Errors
    /// [`FitError::Data`] for another number of positions, [`FitError::Pole`] for one that is not a finite number.
    pub fn with_poles(mut self, poles: &[Vec<Complex<f64>>]) -> Result<Self, FitError> {
        if poles.len() != self.len() {
            return Err(FitError::Data {
                index: poles.len().min(self.len() - 1),
                what: "positions with poles",
                expected: self.len(),
                found: poles.len(),
            });
        }
        for (position, poles) in self.positions.iter_mut().zip(poles) {
            let finite = |z: &Complex<f64>| z.re.is_finite() && z.im.is_finite();
            if let Some(index) = poles.iter().position(|z| !finite(z)) {
                return Err(FitError::Pole {
                    index,
                    pole: poles[index].to_string(),
                    problem: "not a finite number",
                });
            }
            position.poles.clone_from(poles);
        }
        Ok(self)
    }

    fn joined(clock: Discrete, unit: ResidualUnit, positions: Vec<Position>) -> Result<Self, FitError> {
        let first = positions.first().ok_or(FitError::Empty { what: "positions" })?;
        for (index, position) in positions.iter().enumerate() {
            let (own, other) = (&position.frf, &first.frf);
            for (what, expected, found) in [
                ("scheduling parameters", first.p.len(), position.p.len()),
                ("outputs", other.outputs(), own.outputs()),
                ("inputs", other.inputs(), own.inputs()),
            ] {
                if expected != found {
                    return Err(FitError::Data {
                        index,
                        what,
                        expected,
                        found,
                    });
                }
            }
        }
        Ok(Self {
            clock,
            unit,
            positions,
        })
    }

    /// The positions whose scheduling values `keep` accepts.
    ///
    /// # Errors
    /// [`FitError::Empty`] if there is none.
    pub fn subset(&self, mut keep: impl FnMut(&[f64]) -> bool) -> Result<Self, FitError> {
        let kept = self.positions.iter().filter(|position| keep(&position.p));
        Self::joined(self.clock, self.unit, kept.cloned().collect())
    }

    /// One position.
    pub(crate) fn at(&self, index: usize) -> Self {
        Self {
            positions: vec![self.positions[index].clone()],
            ..*self
        }
    }

    /// All positions of several data of one clock and unit.
    pub(crate) fn together(all: &[Self]) -> Result<Self, FitError> {
        let first = all.first().ok_or(FitError::Empty { what: "positions" })?;
        let positions = all.iter().flat_map(|data| data.positions.clone()).collect();
        Self::joined(first.clock, first.unit, positions)
    }

    /// Midway between neighbours along the first parameter, on the lines and with the weights of one, the responses of a model.
    pub(crate) fn between(
        &self,
        model: impl Fn(&[f64]) -> Result<StateSpace<Discrete>, FitError>,
    ) -> Result<Self, FitError> {
        let mut order: Vec<&Position> = self.positions.iter().collect();
        order.sort_by(|a, b| a.p[0].total_cmp(&b.p[0]));
        let positions = order.windows(2).map(|pair| {
            let p: Vec<f64> = pair[0]
                .p
                .iter()
                .zip(&pair[1].p)
                .map(|(a, b)| 0.5 * (a + b))
                .collect();
            let frf = model(&p)?.frequency_response(pair[0].frf.frequencies_hz())?;
            Ok(Position {
                p,
                frf,
                ..pair[0].clone()
            })
        });
        Self::joined(self.clock, self.unit, positions.collect::<Result<_, FitError>>()?)
    }

    /// The positions whose index `keep` accepts.
    pub fn some(&self, keep: impl Fn(usize) -> bool) -> Result<Self, FitError> {
        let kept = self.positions.iter().enumerate().filter(|(i, _)| keep(*i));
        Self::joined(
            self.clock,
            self.unit,
            kept.map(|(_, position)| position.clone()).collect(),
        )
    }

    /// The same data, no line taken for more exact than this part of its response: tolerant weights, for a model that is
    /// not near yet.
    #[must_use]
    pub fn with_error_floor(&self, part: f64) -> Self {
        let positions = self.positions.iter().cloned().map(|p| p.with_error_floor(part));
        Self {
            positions: positions.collect(),
            ..*self
        }
    }

    /// At most `lines` lines at each position, closer together where the response changes: half of them follow the
    /// length of its path, `sum ||G_(k+1) - G_k|| / ||G_k||`, half the index.
    #[must_use]
    pub fn thinned(&self, lines: usize) -> Self {
        let positions = self.positions.iter().map(|position| position.thinned(lines));
        Self {
            positions: positions.collect(),
            ..self.clone()
        }
    }

    /// The same knowledge in few lines: neighbours that no model with poles like those of `models` (one a position, in the
    /// order of the data, near the responses there) can tell apart are merged, with their weights.
    pub(crate) fn merged_lines(&self, models: &[StateSpace<Discrete>]) -> Result<Self, FitError> {
        let positions = self.positions.par_iter().zip(models);
        let positions = positions.map(|(position, model)| position.merged_lines(self.clock, model));
        Ok(Self {
            positions: positions.collect::<Result<_, _>>()?,
            ..*self
        })
    }

    /// The clock of the data.
    pub fn clock(&self) -> Discrete {
        self.clock
    }
    /// What a residual of one means.
    pub fn unit(&self) -> ResidualUnit {
        self.unit
    }
    /// Number of positions, at least one.
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.positions.len()
    }
    /// The scheduling values of each position.
    pub fn scheduling(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.positions.iter().map(|position| position.p.as_slice())
    }
    /// The response at each position.
    pub fn responses(&self) -> impl ExactSizeIterator<Item = &Frf> {
        self.positions.iter().map(|position| &position.frf)
    }
    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.positions
            .first()
            .map_or(0, |position| position.frf.outputs())
    }
    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.positions.first().map_or(0, |position| position.frf.inputs())
    }
    /// Real equations: two a line and channel.
    pub fn equations(&self) -> usize {
        let lines: usize = self.positions.iter().map(|position| position.frf.len()).sum();
        2 * self.outputs() * self.inputs() * lines
    }
    pub(crate) fn positions(&self) -> &[Position] {
        &self.positions
    }
    /// The number that the sum of squares of `equations` equations is divided by before the root gives an rms.
    pub(crate) fn rms_count(&self, equations: usize) -> f64 {
        match self.unit {
            ResidualUnit::StandardDeviation => equations as f64,
            ResidualUnit::Relative => equations as f64 / (2 * self.outputs() * self.inputs()) as f64,
        }
    }
}

fn line_error(index: usize, frf: &Frf, line: usize, problem: &'static str) -> FitError {
    FitError::Line {
        index,
        line,
        frequency_hz: frf.frequencies_hz()[line],
        problem,
    }
}

impl Position {
    pub(crate) fn new(
        index: usize,
        clock: Discrete,
        p: &[f64],
        frf: &Frf,
        scale: Vec<f64>,
        whitening: Option<Whitening>,
    ) -> Result<Self, FitError> {
        if frf.is_empty() || frf.outputs() * frf.inputs() == 0 {
            return Err(FitError::Empty {
                what: "lines or channels at a position of the data",
            });
        }
        let limit = clock.nyquist_hz() * (1.0 + 1e-12);
        if let Some(line) = frf.frequencies_hz().iter().position(|&f| f > limit) {
            return Err(line_error(
                index,
                frf,
                line,
                "above the Nyquist frequency of the clock",
            ));
        }
        if let Some(row) = p.iter().position(|v| !v.is_finite()) {
            return Err(lpv_core::CoreError::NotFinite {
                what: "scheduling values of the data",
                row,
                column: index,
            }
            .into());
        }
        Ok(Self {
            p: p.to_vec(),
            z: frf.frequencies_hz().iter().map(|&f| clock.point(f)).collect(),
            frf: frf.clone(),
            scale,
            whitening,
            poles: Vec::new(),
        })
    }

    fn thinned(&self, most: usize) -> Self {
        let n = self.frf.len();
        if n <= most.max(1) {
            return self.clone();
        }
        let step = |k: usize| {
            let (here, next) = (self.frf.line(k), self.frf.line(k + 1));
            ((next - here).norm() / here.norm().max(f64::MIN_POSITIVE)).min(1.0)
        };
        let path: Vec<f64> = (0..n - 1).map(step).collect();
        let even = path.iter().sum::<f64>().max(f64::MIN_POSITIVE) / (n - 1) as f64;
        let whole = 2.0 * even * (n - 1) as f64;
        let (mut walked, mut wanted) = (0.0, 0);
        let mut keep = vec![false; n];
        for k in 0..n {
            // The first and the last line are always kept.
            if walked >= whole * wanted as f64 / (most.max(2) - 1) as f64 * (1.0 - 1e-12) {
                keep[k] = true;
                while wanted as f64 * whole <= walked * (most.max(2) - 1) as f64 * (1.0 + 1e-12) {
                    wanted += 1;
                }
            }
            walked += path.get(k).map_or(0.0, |s| s + even);
        }
        self.select(&(0..n).filter(|&k| keep[k]).collect::<Vec<_>>())
    }

    /// `W_y` and `W_u` of a line, its scale in the first.
    pub(crate) fn factors(&self, k: usize) -> (DMatrix<Complex<f64>>, DMatrix<Complex<f64>>) {
        let (ny, nu) = (self.frf.outputs(), self.frf.inputs());
        let scale = Complex::from(self.scale[k]);
        match &self.whitening {
            None => (DMatrix::identity(ny, ny) * scale, DMatrix::identity(nu, nu)),
            Some(w) => (
                DMatrix::from_column_slice(ny, ny, w.left(k)) * scale,
                DMatrix::from_column_slice(nu, nu, w.right(k)),
            ),
        }
    }

    /// Some of the lines, increasing.
    pub(crate) fn select(&self, lines: &[usize]) -> Self {
        Self {
            p: self.p.clone(),
            frf: self.frf.select(|k, _| lines.binary_search(&k).is_ok()),
            z: lines.iter().map(|&k| self.z[k]).collect(),
            scale: lines.iter().map(|&k| self.scale[k]).collect(),
            whitening: self.whitening.as_ref().map(|w| w.select(lines)),
            poles: self.poles.clone(),
        }
    }
}
