//! The state transformation that records ask for.

use super::{Frozen, StateTransformation, Transformed, freeze};
use crate::moving::along::{rows, stacked};
use crate::moving::data::MovingData;
use crate::moving::flow::Want;
use crate::problem::{Cost, Linear};
use crate::search::{Limits, Objective, search};
use crate::{FitError, MechanicalForm, RefineSettings, StopReason};
use lpv_numerics::dense::triangle_beside;
use nalgebra::{DMatrix, DVector};

/// A [`StateTransformation`] fitted to records.
#[derive(Debug, Clone, PartialEq)]
pub struct TransformationFit {
    /// The rate.
    pub transformation: StateTransformation,
    /// Near it, the records cost `||residual + information dG||^2`, `dG` the change of the coefficients.
    pub(crate) information: DMatrix<f64>,
    pub(crate) residual: DVector<f64>,
    /// Samples times outputs over all records.
    pub(crate) equations: usize,
    /// How it went.
    pub account: TransformationAccount,
}

/// How the fit of a [`StateTransformation`] went.
#[derive(Debug, Clone, PartialEq)]
pub struct TransformationAccount {
    /// Why the search ended.
    pub stop: StopReason,
    /// Rms error over all records and outputs in units of the noise: with `G = 0`, with the G that the beginnings of the
    /// records ask for, and after one more step on all of them, as the linearisation has it.
    pub rms: [f64; 3],
}

/// Fits `G(p)`, polynomials of the given degree, of a model in mechanical coordinates to
/// records along a moving p. The frozen responses do not change.
///
/// # Errors
/// [`FitError::Core`] for records that leave the range; [`FitError::Moving`] if the model runs away from them even
/// in the loop, or has more than one scheduling parameter.
pub fn fit_transformation(
    form: &MechanicalForm,
    data: &MovingData,
    degree: usize,
    settings: &RefineSettings,
) -> Result<TransformationFit, FitError> {
    settings.check()?;
    if form.range().parameters() != 1 {
        return Err(FitError::Moving {
            problem: "a state transformation is fitted for one scheduling parameter only; measure along one at a time",
        });
    }
    let frozen = freeze(form, data)?;
    let on = |data| TransformationObjective {
        zero: StateTransformation::of_pairs(form.states(), degree),
        frozen: &frozen,
        data,
    };
    let whole = on(data);
    let zero = whole.zero.theta();
    let first = whole.cost(&zero).ok_or_else(|| whole.no_start())?;
    // The way is long at first, and short records show it.
    let beginnings = data.beginnings(BEGINNING);
    let set = settings;
    let limits = Limits {
        max_iterations: set.max_iterations,
        tolerance: set.tolerance,
        target: set.target.powi(2) * beginnings.equations() as f64,
        noise: None,
        damping: 1e-3,
    };
    let near = search(&on(&beginnings), zero, &limits)?;
    let mut theta = near.theta;
    let mut linear = Factored::new(&whole, &theta)?;
    // Whole records are nearly linear in what is left; where they are not, a few steps on them follow.
    for _ in 0..THEN {
        if linear.actual <= NEARLY * linear.least {
            break;
        }
        let next = &theta - &linear.step;
        match whole.cost(&next) {
            Some(cost) if cost.total < linear.actual => theta = next,
            _ => break,
        }
        linear = Factored::new(&whole, &theta)?;
    }
    let equations = data.equations() as f64;
    let mut residual = DVector::zeros(theta.len() + 1);
    residual[theta.len()] = linear.least.sqrt();
    Ok(TransformationFit {
        transformation: whole.zero.with(&(theta - linear.step)),
        account: TransformationAccount {
            stop: near.stop,
            rms: [first.total, linear.actual, linear.least].map(|cost| (cost / equations).sqrt()),
        },
        information: linear.information,
        residual,
        equations: data.equations(),
    })
}

/// Whole records near one point: they cost `least + ||R (theta - best)||^2`, with `best = theta_0 - step`.
struct Factored {
    /// R above a row of zeros.
    information: DMatrix<f64>,
    step: DVector<f64>,
    actual: f64,
    least: f64,
}

impl Factored {
    fn new(whole: &TransformationObjective<'_>, theta: &DVector<f64>) -> Result<Self, FitError> {
        let linear = whole.linearise(theta).ok_or_else(|| whole.no_start())?;
        let size = theta.len();
        let factor = triangle_beside(&linear.jacobian, &linear.residual);
        let step = factor
            .view((0, 0), (size, size))
            .solve_upper_triangular(&factor.view((0, size), (size, 1)).column(0))
            .ok_or_else(|| whole.no_start())?;
        Ok(Self {
            information: factor.columns(0, size).into_owned(),
            step,
            actual: linear.residual.norm_squared(),
            least: factor[(size, size)].powi(2),
        })
    }
}

/// Samples of each record that are fitted first.
const BEGINNING: usize = 1000;

/// Steps on whole records at most, and the sum of squares, over the least that the linearisation promises, that needs none.
const THEN: usize = 3;
const NEARLY: f64 = 2.0;

struct TransformationObjective<'a> {
    zero: StateTransformation,
    frozen: &'a [Frozen],
    data: &'a MovingData,
}

/// Deviation that a coefficient of the constant polynomial has before any data, in coordinates of size one, and how it
/// falls from polynomial to polynomial: a transformation of about the size of the identity over the range, and smooth. It decides
/// only where the records say nothing.
const PRIOR: (f64, f64) = (1.0, 0.4);

impl TransformationObjective<'_> {
    fn prior(&self) -> DVector<f64> {
        let directions = self.zero.directions.len();
        DVector::from_fn(self.size(), |i, _| {
            PRIOR.0 * PRIOR.1.powi((i / directions) as i32)
        })
    }

    fn at(&self, theta: &DVector<f64>) -> Transformed<'_> {
        Transformed {
            transformation: self.zero.with(theta),
            records: self.frozen,
        }
    }
}

impl Objective for TransformationObjective<'_> {
    fn size(&self) -> usize {
        self.zero.coefficients.len()
    }
    fn cost(&self, theta: &DVector<f64>) -> Option<Cost> {
        let rows = rows(&self.at(theta), self.data, Want::Value)?;
        let prior: f64 = theta
            .iter()
            .zip(self.prior().iter())
            .map(|(t, s)| (t / s).powi(2))
            .sum();
        Some(Cost {
            total: rows.iter().map(|r| r.cost).sum::<f64>() + prior,
            lines: Vec::new(),
        })
    }
    fn linearise(&self, theta: &DVector<f64>) -> Option<Linear> {
        let data = stacked(rows(&self.at(theta), self.data, Want::Derivative)?);
        let prior = self.prior();
        Some(data.above(Linear {
            jacobian: DMatrix::from_diagonal(&prior.map(f64::recip)),
            residual: theta.component_div(&prior),
            factorisations: 0,
            chains: Vec::new(),
        }))
    }
    fn indistinguishable(&self, _: &DVector<f64>) -> Result<DMatrix<f64>, FitError> {
        Ok(DMatrix::zeros(self.size(), 0))
    }
    fn rounding(&self) -> f64 {
        0.0
    }
    fn no_start(&self) -> FitError {
        FitError::Moving {
            problem: "the frozen model runs away from the moving records even in the loop; check the controller of the bundle",
        }
    }
}
