//! Frozen responses and moving records together.

use super::along::{errors, rows, stacked};
use super::data::MovingData;
use super::fixed::Fixed;
use super::flow::Want;
use crate::problem::{Cost, Linear, Problem};
use crate::search::{Limits, Objective, search};
use crate::{Candidate, FitError, FrozenData, RefineSettings};
use lpv_core::Continuous;
use lpv_numerics::least_squares::StopReason;
use nalgebra::{DMatrix, DVector};

/// A model refined on frozen responses and moving records.
#[derive(Debug, Clone, PartialEq)]
pub struct Jointly {
    /// The model.
    pub candidate: Candidate<Continuous>,
    /// How it went.
    pub account: JointAccount,
}

/// How a joint refinement went.
#[derive(Debug, Clone, PartialEq)]
pub struct JointAccount {
    /// Why the search ended.
    pub stop: StopReason,
    /// Sum of squares before the first iteration and after every one.
    pub costs: Vec<f64>,
    /// Rms residual of the frozen responses, in their unit, before and after.
    pub frozen_rms: [f64; 2],
    /// Rms error along the records in units of the noise, before and after.
    pub moving_rms: [f64; 2],
}

/// Refines on both, weighted by their covariances: maximum likelihood over the free entries, by orthogonal factorisations
/// with exact sensitivities of the simulated closed loop. The free entries must leave the direct term zero.
///
/// # Errors
/// Those of [`crate::refine`]; [`FitError::Moving`] if the start runs away from the records.
pub fn refine_with_moves(
    candidate: &Candidate<Continuous>,
    frozen: &FrozenData,
    moving: &MovingData,
    settings: &RefineSettings,
) -> Result<Jointly, FitError> {
    settings.check()?;
    let problem = Problem::new(candidate, frozen)?;
    if problem.free.len() != candidate.free_entries().len() {
        return Err(FitError::Moving {
            problem: "every state must be joined to a free entry; use the mechanical structure",
        });
    }
    let joint = Joint { problem, moving };
    let set = settings;
    let limits = Limits {
        max_iterations: set.max_iterations,
        tolerance: set.tolerance,
        target: 0.0,
        noise: None,
        damping: 1e-6,
    };
    let theta = joint.problem.theta(candidate);
    let found = search(&joint, theta.clone(), &limits)?;
    let frozen_cost = |theta: &DVector<f64>| {
        let cost = joint.problem.cost(theta).ok_or_else(|| joint.no_start())?;
        Ok::<f64, FitError>(cost.total)
    };
    let of_frozen = [frozen_cost(&theta)?, frozen_cost(&found.theta)?];
    let of_moves = [found.history[0] - of_frozen[0], found.cost.total - of_frozen[1]];
    let frozen_rms = |cost: f64| (cost / frozen.rms_count(frozen.equations())).sqrt();
    let moving_rms = |cost: f64| (cost / moving.equations() as f64).sqrt();
    Ok(Jointly {
        candidate: joint.problem.candidate(&found.theta),
        account: JointAccount {
            stop: found.stop,
            costs: found.history,
            frozen_rms: of_frozen.map(frozen_rms),
            moving_rms: of_moves.map(moving_rms),
        },
    })
}

/// `y_rec - y` along every record, `n_y x N`, in the loop of the records.
///
/// # Errors
/// [`FitError::Moving`] if the model runs away or is not well-posed somewhere along them.
pub fn simulate_errors(
    candidate: &Candidate<Continuous>,
    moving: &MovingData,
) -> Result<Vec<DMatrix<f64>>, FitError> {
    errors(&Fixed::new(candidate, moving.clock()), moving).ok_or_else(runs_away)
}

fn runs_away() -> FitError {
    FitError::Moving {
        problem: "the model runs away from them even in the loop; start closer, or check the controller",
    }
}

struct Joint<'a> {
    problem: Problem<'a, Continuous>,
    moving: &'a MovingData,
}

impl Joint<'_> {
    fn moving_cost(&self, theta: &DVector<f64>) -> Option<f64> {
        let candidate = self.problem.candidate(theta);
        let rows = rows(
            &Fixed::new(&candidate, self.moving.clock()),
            self.moving,
            Want::Value,
        )?;
        Some(rows.iter().map(|r| r.cost).sum())
    }
}

impl Objective for Joint<'_> {
    fn size(&self) -> usize {
        self.problem.free.len()
    }
    fn cost(&self, theta: &DVector<f64>) -> Option<Cost> {
        let mut cost = self.problem.cost(theta)?;
        cost.total += self.moving_cost(theta)?;
        Some(cost)
    }
    fn linearise(&self, theta: &DVector<f64>) -> Option<Linear> {
        let frozen = self.problem.linearise(theta)?;
        let candidate = self.problem.candidate(theta);
        let fixed = Fixed::new(&candidate, self.moving.clock());
        let moving = stacked(rows(&fixed, self.moving, Want::Derivative)?);
        Some(frozen.above(moving))
    }
    fn indistinguishable(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, FitError> {
        self.problem.indistinguishable(theta)
    }
    fn rounding(&self) -> f64 {
        0.0
    }
    fn no_start(&self) -> FitError {
        runs_away()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::moving::transformation::{StateTransformation, Transformed, freeze};
    use crate::{DeltaSplit, MechanicalForm, RandomChannels};
    use lpv_core::{DeltaBlock, Discrete, Purpose, Record, RecordKind, SchedulingRange, Signals, StateSpace};
    use nalgebra::dmatrix;

    const SAMPLES: usize = 60;

    fn form() -> MechanicalForm {
        let a = dmatrix![0.0, 3.0; -3.0, -0.2];
        let local = StateSpace::new(
            a,
            dmatrix![0.0; 0.8],
            dmatrix![-0.7, 0.0],
            dmatrix![0.0],
            Continuous,
        )
        .unwrap();
        let range = SchedulingRange::interval(-0.3, 0.3).unwrap();
        let block = [DeltaBlock {
            parameter: 0,
            repetitions: 1,
        }];
        let random = RandomChannels { seed: 4, size: 0.1 };
        let made = Candidate::flexible(&local, Some(&dmatrix![1.0]), &block, range, random).unwrap();
        MechanicalForm::in_sizes(&made, &[1.0]).unwrap()
    }

    /// A record that does not begin at rest, so that its first state is fitted too.
    fn data(first: f64) -> MovingData {
        let column =
            |f: &dyn Fn(f64) -> f64| vec![(0..SAMPLES).map(|k| f(0.1 * k as f64)).collect::<Vec<f64>>()];
        let record = Record {
            name: "move".to_owned(),
            outputs: Signals::new(&["y"], column(&|t| first + 0.1 * t * t + 0.03 * (2.0 * t).sin())),
            inputs: Signals::new(&["u"], column(&|t| (1.3 * t).cos())),
            references: Signals::default(),
            scheduling: Signals::new(&["p"], column(&|t| 0.25 * (0.9 * t).sin())),
            auxiliary: Signals::default(),
            injection: Signals::default(),
            kind: RecordKind::Transient,
            purpose: Purpose::Estimation,
            position: None,
        };
        let clock = Discrete::new(0.1).unwrap();
        let feedback =
            StateSpace::new(dmatrix![0.8], dmatrix![0.5], dmatrix![-0.6], dmatrix![1.5], clock).unwrap();
        MovingData::new(clock, &[record], &[0.01], Some(&feedback)).unwrap()
    }

    /// `2 J^T r` against central differences of the cost.
    fn check_gradient(gradient: &DVector<f64>, theta: &DVector<f64>, cost: impl Fn(&DVector<f64>) -> f64) {
        let scale = gradient.amax();
        for i in 0..theta.len() {
            let h = 1e-5 * theta[i].abs().max(0.1);
            let at = |sign: f64| {
                let mut moved = theta.clone();
                moved[i] += sign * h;
                cost(&moved)
            };
            let slope = (at(1.0) - at(-1.0)) / (2.0 * h);
            assert!(
                (slope - gradient[i]).abs() < 1e-5 * scale,
                "{i}: {slope} {}",
                gradient[i]
            );
        }
    }

    #[test]
    fn sensitivities_of_the_lfr_meet_finite_differences() {
        let split = DeltaSplit {
            forces: 1,
            outputs: 1,
            accelerations: 1,
        };
        let candidate = form()
            .candidate(split, RandomChannels { seed: 2, size: 0.2 })
            .unwrap();
        for first in [0.0, 0.2] {
            let data = data(first);
            let free = candidate.free_entries();
            let theta = DVector::from_iterator(free.len(), free.iter().map(|&at| candidate.matrix()[at]));
            let at = |theta: &DVector<f64>| {
                let mut m = candidate.matrix().clone();
                free.iter().zip(theta.iter()).for_each(|(&at, v)| m[at] = *v);
                candidate.with_matrix(m)
            };
            let linear =
                stacked(rows(&Fixed::new(&candidate, data.clock()), &data, Want::Derivative).unwrap());
            let gradient = linear.jacobian.transpose() * &linear.residual * 2.0;
            check_gradient(&gradient, &theta, |theta| {
                rows(&Fixed::new(&at(theta), data.clock()), &data, Want::Value).unwrap()[0].cost
            });
        }
    }

    #[test]
    fn sensitivities_of_the_turning_basis_meet_finite_differences() {
        let (form, data) = (form(), data(0.0));
        let records = freeze(&form, &data).unwrap();
        let zero = StateTransformation::of_pairs(form.states(), 2);
        let theta = zero.theta().map_with_location(|i, _, _| 0.3 * (i as f64).sin());
        let at = |theta: &DVector<f64>| Transformed {
            transformation: zero.with(theta),
            records: &records,
        };
        let linear = stacked(rows(&at(&theta), &data, Want::Derivative).unwrap());
        let gradient = linear.jacobian.transpose() * &linear.residual * 2.0;
        check_gradient(&gradient, &theta, |theta| {
            rows(&at(theta), &data, Want::Value).unwrap()[0].cost
        });
    }
}
