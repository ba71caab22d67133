//! The search and its result.

use crate::ModalFitError;
use crate::model::{Modal, Parameter, Rigid};
use crate::residues::{self, Ranks};
use crate::whiten::{Factors, factors};
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};
use lpv_core::num_complex::Complex;
use lpv_core::{Clock, CoreError, Discrete, Frf, FrfEstimate, StateSpace};
use lpv_numerics::least_squares::{AfterDescent, AfterRefusal, Damping, Search, StopReason, Trial, minimise};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use std::ops::ControlFlow;

type C64 = Complex<f64>;

/// How to fit.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `integrators` | 0 | poles at z = 1 of the rigid body; they are not among the poles given | 0 to 2 |
/// | `direct` | false | whether there is a direct term D | |
/// | `max_iterations` | 30 | steps of the search | |
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ModalSettings {
    /// Poles at z = 1 of the rigid body.
    pub integrators: usize,
    /// Whether there is a direct term.
    pub direct: bool,
    /// Steps of the search.
    pub max_iterations: usize,
}

impl Default for ModalSettings {
    fn default() -> Self {
        Self {
            integrators: 0,
            direct: false,
            max_iterations: 30,
        }
    }
}

/// A pole with the rank of its residue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModalMode {
    /// The pole in z; of a pair the one with positive imaginary part.
    pub pole: C64,
    /// Rank of its residue: one for a mode by itself.
    pub rank: usize,
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Its standard deviation.
    pub frequency_deviation_hz: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Its standard deviation.
    pub damping_deviation: f64,
}

/// How a fit went.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalAccount {
    /// Why the search ended.
    pub stop: StopReason,
    /// Steps that lowered the cost.
    pub iterations: usize,
    /// Sum of squares of the whitened residual: about one a real equation that is left, where noise alone is left.
    pub cost: f64,
    /// Its mean if noise alone is left.
    pub expected_cost: f64,
    /// Real equations: two a line and channel.
    pub equations: usize,
    /// Real unknowns.
    pub unknowns: usize,
}

/// A minimal modal model.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalFit {
    /// The state space: the rigid body first, then the modes in the order of [`ModalFit::modes`].
    pub model: StateSpace<Discrete>,
    /// The poles by natural frequency.
    pub modes: Vec<ModalMode>,
    /// Rank of the gain of the rigid body; zero without one.
    pub rigid_rank: usize,
    /// How it went.
    pub account: ModalAccount,
}

/// Fits a modal model that begins at these poles, of a pair one or both.
///
/// # Errors
/// [`ModalFitError`]: no lines, no poles, poles that stand twice or on a line, more unknowns than equations, a covariance that is
/// not positive definite.
pub fn modal_fit(
    estimate: &FrfEstimate,
    clock: Discrete,
    poles: &[C64],
    settings: &ModalSettings,
) -> Result<ModalFit, ModalFitError> {
    let rigid = match settings.integrators {
        0 => None,
        1 => Some(Rigid::One),
        2 => Some(Rigid::Two),
        found => return Err(ModalFitError::Integrators { found }),
    };
    let frf = estimate.frf();
    if frf.is_empty() || frf.outputs() * frf.inputs() == 0 {
        return Err(ModalFitError::Empty {
            what: "lines or channels",
        });
    }
    let estimate = if rigid.is_some() {
        estimate.select(|_, f| f > 0.0)
    } else {
        estimate.clone()
    };
    let mut poles = upper_half(poles, rigid.is_some())?;
    poles.sort_by(|x, y| x.ln().norm().total_cmp(&y.ln().norm()));
    let lines = estimate.frf().frequencies_hz();
    let mut descent = Descent {
        z: lines.iter().map(|&f| clock.point(f)).collect(),
        factors: factors(&estimate)?,
        frf: estimate.frf(),
        clock,
        most: settings.max_iterations,
    };
    let at = |poles: &[C64]| residues::Residues::new(&estimate, clock, poles, rigid, settings.direct);
    let mut found = descent.fit(at(&poles)?.model(Ranks::One)?, &estimate)?;
    // Poles that are off leave more directions in the residues than there are: ranks are those at the fitted poles.
    for _ in 0..PASSES {
        let fitted: Vec<C64> = found.modes.iter().map(|m| m.pole).collect();
        let account = &found.account;
        let missed = account.excess() > EXCESS && account.cost > MISSED * account.expected_cost;
        let several = found.modes.iter().any(|m| m.rank > 1 && m.pole.im > 0.0);
        let ranks = if missed || several {
            Ranks::AboveNoise
        } else {
            Ranks::One
        };
        let next = at(&fitted)?.model(ranks)?;
        if next.ranks() == found.ranks() {
            break;
        }
        match descent.fit(next, &estimate) {
            Ok(other) if other.account.excess() < EXCESS.max(found.account.excess()) => found = other,
            _ => break,
        }
    }
    Ok(found)
}

impl ModalFit {
    /// Ranks of the residues, that of the rigid body last.
    fn ranks(&self) -> Vec<usize> {
        self.modes
            .iter()
            .map(|m| m.rank)
            .chain([self.rigid_rank])
            .collect()
    }
}

impl ModalAccount {
    /// How far the cost is above what noise alone leaves, in standard deviations of that.
    #[must_use]
    pub fn excess(&self) -> f64 {
        let deviation = self.expected_cost * (2.0 / self.equations as f64).sqrt();
        (self.cost - self.expected_cost) / deviation
    }
}

impl Descent<'_> {
    fn equations(&self) -> usize {
        2 * self.z.len() * self.frf.outputs() * self.frf.inputs()
    }

    fn fit(&mut self, start: Modal, estimate: &FrfEstimate) -> Result<ModalFit, ModalFitError> {
        let (equations, unknowns) = (self.equations(), start.parameters().len());
        if equations <= unknowns {
            return Err(ModalFitError::TooFewEquations { equations, unknowns });
        }
        let start = self.point(start).ok_or(CoreError::NotFinite {
            what: "modal fit: the response at the poles given",
            row: 0,
            column: 0,
        })?;
        let found = minimise(self, start, &DAMPING)?;
        let modal = found.point.modal;
        // The last linearisation is a step away that no longer counts.
        let linear = match found.linear {
            Some(linear) => linear,
            None => self.normal(&modal, &modal.parameters()),
        };
        let inverse = linear.inverse()?;
        let nu = estimate.degrees_of_freedom();
        let left = nu - self.frf.outputs() as f64;
        // Weights from an estimated covariance scatter: moments of the complex inverse Wishart distribution.
        let (mean, spread) = if nu.is_finite() && left > 1.0 {
            (nu / left, nu * nu / (left * left - 1.0))
        } else {
            (1.0, 1.0)
        };
        let modes = modes(&modal, &linear.parameters, &(inverse * spread), self.clock);
        Ok(ModalFit {
            model: modal.state_space(self.clock)?,
            modes,
            rigid_rank: modal.rigid.as_ref().map_or(0, |(_, c, _)| c.ncols()),
            account: ModalAccount {
                stop: found.stop,
                iterations: found.history.len() - 1,
                cost: found.point.cost,
                expected_cost: (equations - unknowns) as f64 * mean,
                equations,
                unknowns,
            },
        })
    }
}

/// One pole of each pair.
fn upper_half(poles: &[C64], rigid: bool) -> Result<Vec<C64>, ModalFitError> {
    let mut upper: Vec<C64> = Vec::new();
    for (index, &pole) in poles.iter().enumerate() {
        let refused = |problem| {
            Err(ModalFitError::Pole {
                index,
                pole: pole.to_string(),
                problem,
            })
        };
        if !(pole.re.is_finite() && pole.im.is_finite()) {
            return refused("not a finite number");
        }
        if rigid && (pole - 1.0).norm() < 1e-9 {
            return refused("that of the rigid body; leave it out, or ask for no integrators");
        }
        if pole.im < 0.0 {
            continue;
        }
        if upper.iter().any(|other| (other - pole).norm() <= 1e-12) {
            return refused("given twice; residues of equal poles cannot be told apart");
        }
        upper.push(pole);
    }
    if upper.is_empty() && !rigid {
        return Err(ModalFitError::Empty { what: "poles" });
    }
    Ok(upper)
}

const DAMPING: Damping = Damping {
    start: 1e-4,
    least: 1e-12,
    most: 1e8,
    attempts: 12,
    after_descent: AfterDescent::Divide(10.0),
    after_refusal: AfterRefusal::Multiply(10.0),
};

/// A decrease of the sum of squares below this is none: a tenth of what one standard deviation of one parameter is worth.
const SETTLED: f64 = 0.1;

/// What rank one may leave beyond the expected cost, in standard deviations of it, before higher ranks are tried.
const EXCESS: f64 = 6.0;

/// And the part of the expected cost: with many equations a covariance that is a little too small is many deviations.
const MISSED: f64 = 1.1;

/// Changes of the ranks at most.
const PASSES: usize = 4;

/// Lines of one product.
const BLOCK: usize = 8;

/// Parts of the lines that threads take: fixed, so that their number changes no bit.
const PARTS: usize = 8;

struct Point {
    modal: Modal,
    cost: f64,
}

struct Descent<'a> {
    z: Vec<C64>,
    factors: Vec<Factors>,
    frf: &'a Frf,
    clock: Discrete,
    most: usize,
}

/// Normal equations `J^T J`, `J^T r`.
struct Normal {
    parameters: Vec<Parameter>,
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Descent<'_> {
    fn residual(&self, modal: &Modal, k: usize) -> DMatrix<C64> {
        let own = &self.factors[k];
        &own.left * (modal.response(self.z[k], self.clock) - self.frf.line(k)) * &own.right
    }

    /// None where it has no finite cost, or a pole has left the upper half.
    fn point(&self, modal: Modal) -> Option<Point> {
        let costs: Vec<f64> = (0..self.z.len())
            .into_par_iter()
            .map(|k| self.residual(&modal, k).norm_squared())
            .collect();
        let cost: f64 = costs.iter().sum();
        let whole = modal.sections.iter().all(|s| s.pole.im >= 0.0);
        (cost.is_finite() && whole).then_some(Point { modal, cost })
    }

    fn normal(&self, modal: &Modal, parameters: &[Parameter]) -> Normal {
        let part = self.z.len().div_ceil(PARTS).max(1);
        let starts: Vec<usize> = (0..self.z.len()).step_by(part).collect();
        let sums: Vec<DMatrix<f64>> = starts
            .into_par_iter()
            .map(|from| self.products(modal, parameters, from..(from + part).min(self.z.len())))
            .collect();
        let n = parameters.len();
        let mut sum = DMatrix::zeros(n + 1, n + 1);
        for part in sums {
            sum += part;
        }
        sum.fill_upper_triangle_with_lower_triangle();
        Normal {
            parameters: parameters.to_vec(),
            gradient: sum.view((0, n), (n, 1)).column(0).into_owned(),
            matrix: sum.view((0, 0), (n, n)).into_owned(),
        }
    }

    /// Lower triangle of `[J, r]^T [J, r]` over some lines.
    fn products(
        &self,
        modal: &Modal,
        parameters: &[Parameter],
        lines: std::ops::Range<usize>,
    ) -> DMatrix<f64> {
        let (n, size) = (parameters.len(), self.frf.outputs() * self.frf.inputs());
        let mut sum = DMatrix::zeros(n + 1, n + 1);
        let mut derivatives = vec![C64::from(0.0); n * size];
        let rows = 2 * size * BLOCK;
        let mut block = DMatrix::<f64>::zeros(rows, n + 1);
        for first in lines.clone().step_by(BLOCK) {
            let count = BLOCK.min(lines.end - first);
            if count < BLOCK {
                block.fill(0.0);
            }
            for (at, k) in (first..first + count).enumerate() {
                let own = &self.factors[k];
                modal.derivatives(
                    parameters,
                    self.z[k],
                    self.clock,
                    (&own.left, &own.right),
                    &mut derivatives,
                );
                let residual = self.residual(modal, k);
                let all = derivatives
                    .chunks_exact(size)
                    .chain(std::iter::once(residual.as_slice()));
                for (values, mut column) in all.zip(block.column_iter_mut()) {
                    for (i, v) in values.iter().enumerate() {
                        column[(at * size + i) * 2] = v.re;
                        column[(at * size + i) * 2 + 1] = v.im;
                    }
                }
            }
            let tall = MatRef::from_column_major_slice(block.as_slice(), rows, n + 1);
            matmul(
                MatMut::from_column_major_slice_mut(sum.as_mut_slice(), n + 1, n + 1),
                BlockStructure::TriangularLower,
                Accum::Add,
                tall.transpose(),
                BlockStructure::Rectangular,
                tall,
                BlockStructure::Rectangular,
                1.0,
                Par::Seq,
            );
        }
        sum
    }
}

impl Normal {
    fn scale(&self) -> DVector<f64> {
        self.matrix
            .diagonal()
            .map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 })
    }

    fn scaled(&self, damping: f64) -> (DMatrix<f64>, DVector<f64>) {
        let scale = self.scale();
        let mut m = DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
            self.matrix[(i, j)] * scale[i] * scale[j]
        });
        for i in 0..scale.len() {
            m[(i, i)] += damping;
        }
        (m, scale)
    }

    fn step(&self, damping: f64) -> Option<Vec<f64>> {
        let (m, scale) = self.scaled(damping);
        let right = -self.gradient.component_mul(&scale);
        let step = Cholesky::new(m)?.solve(&right).component_mul(&scale);
        step.iter()
            .all(|v| v.is_finite())
            .then(|| step.as_slice().to_vec())
    }

    /// Covariance of the parameters: the residual has variance one in real and imaginary parts.
    fn inverse(&self) -> Result<DMatrix<f64>, ModalFitError> {
        let (m, scale) = self.scaled(1e-13);
        let factor = Cholesky::new(m).ok_or(CoreError::Singular {
            operation: "the covariance of the modes",
        })?;
        let mut inverse = factor.inverse();
        for j in 0..scale.len() {
            for i in 0..scale.len() {
                inverse[(i, j)] *= scale[i] * scale[j];
            }
        }
        Ok(inverse)
    }
}

impl Search for Descent<'_> {
    type Point = Point;
    type Linear = Normal;
    type Error = ModalFitError;

    fn cost(&self, point: &Point) -> f64 {
        point.cost
    }

    fn ended(&mut self, point: &Point, history: &[f64], _damping: &mut f64) -> Option<StopReason> {
        let iterations = history.len() - 1;
        // Noise-free data end far below one deviation: there the relative decrease counts.
        let enough = |before: f64, after: f64| {
            let noise = after > 0.01 * self.equations() as f64;
            before - after < if noise { SETTLED } else { 1e-3 * after }
        };
        let last = iterations.checked_sub(1).map(|i| history[i]);
        if last.is_some_and(|before| enough(before, point.cost)) {
            return Some(StopReason::CostSettled);
        }
        (iterations >= self.most).then_some(StopReason::IterationLimit)
    }

    fn linearise(&mut self, point: &mut Point) -> Result<ControlFlow<StopReason, Normal>, ModalFitError> {
        let parameters = point.modal.parameters();
        Ok(ControlFlow::Continue(self.normal(&point.modal, &parameters)))
    }

    fn trial(&mut self, point: &Point, linear: &Normal, damping: f64) -> Trial<Point> {
        let Some(step) = linear.step(damping) else {
            return Trial::Refused;
        };
        match self.point(point.modal.moved(&linear.parameters, &step)) {
            Some(point) => Trial::To {
                point,
                predicted: 0.0,
            },
            None => Trial::Refused,
        }
    }
}

fn modes(
    modal: &Modal,
    parameters: &[Parameter],
    covariance: &DMatrix<f64>,
    clock: Discrete,
) -> Vec<ModalMode> {
    let to_hz = 1.0 / (std::f64::consts::TAU * clock.sample_time());
    let at = |wanted: usize, part: bool| {
        parameters.iter().position(
            |p| matches!(*p, Parameter::Pole { section, imaginary } if section == wanted && imaginary == part),
        )
    };
    let one = |(i, section): (usize, &crate::model::Section)| {
        let z = section.pole;
        let s = z.ln();
        let size = s.norm();
        // ds = dz / z; slopes of (|s|, -Re s / |s|).
        let slope = |d: C64| {
            let growth = (s.conj() * d).re / size;
            (growth, -d.re / size + s.re * growth / (size * size))
        };
        let slopes = [(at(i, false), slope(z.inv())), (at(i, true), slope(C64::i() / z))];
        let deviation = |of: fn((f64, f64)) -> f64| {
            let mut sum = 0.0;
            for (p, v) in slopes {
                for (q, w) in slopes {
                    if let (Some(p), Some(q)) = (p, q) {
                        sum += of(v) * of(w) * covariance[(p, q)];
                    }
                }
            }
            sum.max(0.0).sqrt()
        };
        ModalMode {
            pole: z,
            rank: section.c.ncols(),
            frequency_hz: size * to_hz,
            frequency_deviation_hz: deviation(|v| v.0) * to_hz,
            damping: -s.re / size,
            damping_deviation: deviation(|v| v.1),
        }
    };
    modal.sections.iter().enumerate().map(one).collect()
}
