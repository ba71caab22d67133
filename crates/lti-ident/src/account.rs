//! What a fit says about itself.

use crate::LtiIdentError;
use lpv_core::InnovationModel;
use lpv_numerics::least_squares::StopReason;
use nalgebra::{DMatrix, DVector};

/// Models of all orders tried, and the choice between them.
#[derive(Debug, Clone, PartialEq)]
pub struct InnovationFit {
    /// The orders that could be fitted, lowest first.
    pub entries: Vec<OrderEntry>,
    /// The orders that could not, and why.
    pub failures: Vec<(usize, LtiIdentError)>,
    /// Index in `entries` of the order chosen.
    pub chosen: usize,
    /// Samples on which the starts of all orders were searched, of all segments together. Fewer than there are for a
    /// long record; then the winner of each order has been searched on, from there, over all samples.
    pub scanned_samples: usize,
}

impl InnovationFit {
    /// The model of the chosen order with its account.
    #[must_use]
    pub fn chosen(&self) -> &OrderEntry {
        &self.entries[self.chosen]
    }
}

/// One order of an [`InnovationFit`].
#[derive(Debug, Clone, PartialEq)]
pub struct OrderEntry {
    /// Number of states.
    pub order: usize,
    /// The model.
    pub model: InnovationModel,
    /// State at the first sample of each segment when the model is simulated. The one-step predictor starts there too.
    pub initial_states: Vec<DVector<f64>>,
    /// `ln det` of the covariance of what was minimised, for signals of unit deviation: the simulation error with
    /// [`crate::Focus::Simulation`], the one-step error with [`crate::Focus::Prediction`]. It does not increase with
    /// the order where all samples were scanned.
    pub cost: f64,
    /// Starts tried, in the order tried.
    pub starts: Vec<StartEntry>,
    /// Index in `starts` of the one that the model is from: the one that ended lowest, or the last if not all samples
    /// were scanned.
    pub winner: usize,
    /// Free parameters of the plant and the output offset (and of K with [`crate::Focus::Prediction`]), initial states
    /// not counted.
    pub parameters: usize,
    /// `100 (1 - |y - y_hat| / |y - mean|)` of each output over all segments, simulated. NaN or negative numbers of any
    /// size are possible for unstable models.
    pub simulated_fit_percent: Vec<f64>,
    /// The same for one-step predictions.
    pub one_step_fit_percent: Vec<f64>,
    /// Covariance of the simulation error, `n_y x n_y`, in squared units of the outputs.
    pub simulation_covariance: DMatrix<f64>,
    /// `ln det` of the covariance of the innovations with the price `ln N / N` of each parameter and `2 / N` of each
    /// initial state \[ljung1999\], section 16.4. The innovations are the one-step error with
    /// [`crate::Focus::Prediction`], and what an autoregression leaves of the simulation error with
    /// [`crate::Focus::Simulation`]. The order with the least is chosen, unless it cannot be simulated (a pole outside
    /// 1.001) and another is nearly as good (0.02 an output). Infinite where it could not be computed.
    pub expected_cost: f64,
}

/// Where a start came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StartKind {
    /// Handed in, with its index in the list.
    Given(usize),
    /// Realisation of an estimated impulse response.
    Realisation,
    /// The optimum of a lower order with states added that are fitted to its residual.
    Grown {
        /// The lower order.
        from: usize,
    },
    /// What the scan over a part of the samples found best.
    Scan,
}

/// One start of one order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartEntry {
    /// Where it came from.
    pub kind: StartKind,
    /// Cost of the start, B, D, the offset and the initial states already polished; on the samples searched, as `cost`.
    pub first_cost: f64,
    /// Cost at the end.
    pub cost: f64,
    /// Levenberg-Marquardt iterations.
    pub iterations: usize,
    /// Why the search ended.
    pub stop: StopReason,
}
