//! The choice of the order.

use crate::Focus;
use crate::account::OrderEntry;
use crate::problem::{Point, covariance};
use crate::start::lagged;
use nalgebra::DMatrix;

/// Most lags of the autoregression that whitens a simulation error.
const LAGS: usize = 20;

/// Cost an output below which errors count as equal: one percent of their size.
const NEARLY: f64 = 0.02;

/// How far outside the unit circle an integrator may be estimated.
const INTEGRATOR: f64 = 1e-3;

/// `ln det` of the covariance of the innovations, and the price of the parameters: `ln N / N` each \[ljung1999\], section
/// 16.4. An initial state, about which a longer record says nothing more, has the price `2 / N`.
///
/// The price must grow with N: states that are fitted to noise select their frequency among about N candidates. And
/// it holds for white errors only. A coloured simulation error would pay for modes wherever its spectrum is large, so
/// that it is whitened first.
pub(crate) fn expected_cost(point: &Point, focus: Focus, parameters: usize) -> f64 {
    let cost = match focus {
        Focus::Simulation => whitened_cost(&point.residuals).unwrap_or(f64::INFINITY),
        Focus::Prediction => point.cost,
    };
    let samples: usize = point.residuals.iter().map(DMatrix::ncols).sum();
    let n = samples as f64;
    let states: usize = point.initial.iter().map(|x| x.len()).sum();
    cost + (n.ln() * parameters as f64 + 2.0 * states as f64) / n
}

/// `ln det` of the covariance of what an autoregression leaves of residuals.
fn whitened_cost(residuals: &[DMatrix<f64>]) -> Option<f64> {
    let ny = residuals.first()?.nrows();
    let shortest = residuals.iter().map(DMatrix::ncols).min()?;
    let lags = LAGS.min(shortest / (20 * ny));
    let rows: Vec<_> = residuals.iter().map(|r| lagged(r, lags)).collect();
    let both = covariance(&rows);
    let past = both.view((ny, ny), (ny * lags, ny * lags)).into_owned();
    let cross = both.view((ny, 0), (ny * lags, ny)).into_owned();
    let left = both.view((0, 0), (ny, ny)) - cross.tr_mul(&past.cholesky()?.solve(&cross));
    let cost = 2.0 * left.cholesky()?.l().diagonal().map(f64::ln).sum();
    cost.is_finite().then_some(cost)
}

/// The order with the least expected cost. With the focus on prediction a model that cannot be simulated has to be worth
/// it: it loses against one that can be and is nearly as good.
pub(crate) fn chosen(entries: &[OrderEntry], focus: Focus) -> Option<usize> {
    let expected = |i: &usize| entries[*i].expected_cost;
    let least =
        |among: &mut dyn Iterator<Item = usize>| among.min_by(|i, j| expected(i).total_cmp(&expected(j)));
    let best = least(&mut (0..entries.len()))?;
    if focus == Focus::Simulation || can_be_simulated(&entries[best]) {
        return Some(best);
    }
    let margin = NEARLY * entries[best].simulation_covariance.nrows() as f64;
    let other = least(&mut (0..entries.len()).filter(|&i| can_be_simulated(&entries[i])));
    other
        .filter(|i| expected(i) <= expected(&best) + margin)
        .or(Some(best))
}

fn can_be_simulated(entry: &OrderEntry) -> bool {
    let poles = entry.model.model().poles();
    poles.is_ok_and(|p| p.iter().all(|z| z.norm() <= 1.0 + INTEGRATOR))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::{Discrete, InnovationModel, StateSpace};
    use nalgebra::{DVector, dmatrix};

    fn entry(pole: f64, expected_cost: f64) -> OrderEntry {
        let clock = Discrete::new(1.0).unwrap();
        let one = dmatrix![1.0];
        let model = StateSpace::new(dmatrix![pole], one.clone(), one.clone(), dmatrix![0.0], clock).unwrap();
        let zero = DVector::zeros(1);
        OrderEntry {
            order: 1,
            model: InnovationModel::new(model, dmatrix![pole], one.clone(), zero.clone(), zero.clone())
                .unwrap(),
            initial_states: vec![zero],
            cost: expected_cost,
            starts: Vec::new(),
            winner: 0,
            parameters: 3,
            simulated_fit_percent: vec![0.0],
            one_step_fit_percent: vec![0.0],
            simulation_covariance: one,
            expected_cost,
        }
    }

    #[test]
    fn a_model_that_cannot_be_simulated_has_to_be_worth_it() {
        let nearly = [entry(0.9, -5.0), entry(1.1, -5.01)];
        assert_eq!(chosen(&nearly, Focus::Prediction), Some(0));
        let clearly = [entry(0.9, -5.0), entry(1.1, -5.1)];
        assert_eq!(chosen(&clearly, Focus::Prediction), Some(1));
        // An integrator may be estimated a little outside.
        let integrator = [entry(0.9, -5.0), entry(1.0005, -5.01)];
        assert_eq!(chosen(&integrator, Focus::Prediction), Some(1));
        assert_eq!(chosen(&[], Focus::Prediction), None);
    }
}
