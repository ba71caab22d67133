//! Where a fitted filter rests: from its one constant to the offsets of input, output and state.

use crate::LtiIdentError;
use crate::predictor::Predictor;
use lpv_core::linalg::{least_squares, svd};
use nalgebra::{DMatrix, DVector};

/// Least singular value of the response from a constant output offset to the prediction at which that offset is
/// what d stands for. Below it the plant has (nearly) integrators, which hold any output.
const LEAST_RESPONSE: f64 = 1e-3;

/// Offsets of input, output and state, scaled, and counted from the means.
pub(crate) struct Rest {
    pub(crate) input: DVector<f64>,
    pub(crate) output: DVector<f64>,
    /// What the fitted filter has as its state where the model has zero.
    pub(crate) state: DVector<f64>,
}

impl Rest {
    /// Of a filter that simulates: d is the offset.
    pub(crate) fn of_plant(plant: &Predictor) -> Self {
        Self {
            input: DVector::zeros(plant.inputs()),
            output: plant.offset(),
            state: DVector::zeros(plant.states),
        }
    }

    /// Of a one-step predictor, with F for `A - K C`: the model has `x+ = F x + (B - K D) (u - u_0) + K (y - y_0)` and
    /// `y_hat = y_0 + C x + D (u - u_0)`. At the constant state s that `u = u_0`, `y = y_0` leave in the fitted filter,
    /// `y_0 = C s + D u_0 + d`, so that `d = (1 - C (1 - F)^-1 K) y_0 - (D + C (1 - F)^-1 (B - K D)) u_0`.
    pub(crate) fn of_predictor(predictor: &Predictor, inputs: usize) -> Result<Self, LtiIdentError> {
        let (n, ny) = (predictor.states, predictor.outputs());
        let singular = || LtiIdentError::Singular {
            what: "output offset",
        };
        let decay = DMatrix::identity(n, n) - predictor.a();
        let states = decay
            .lu()
            .solve(&predictor.b().into_owned())
            .ok_or_else(singular)?;
        let response = predictor.d() + predictor.c() * &states;
        let (u, y) = (response.columns(0, inputs), response.columns(inputs, ny));
        let from_output = DMatrix::identity(ny, ny) - y;
        let svd = svd(from_output.clone())?;
        let mut rest = DVector::zeros(inputs + ny);
        if svd.singular_values.min() > LEAST_RESPONSE {
            let output = svd.solve(&predictor.offset(), 0.0).map_err(|_| singular())?;
            rest.rows_mut(inputs, ny).copy_from(&output);
        } else {
            let mut both = DMatrix::zeros(ny, inputs + ny);
            both.columns_mut(0, inputs).copy_from(&-u);
            both.columns_mut(inputs, ny).copy_from(&from_output);
            let least = least_squares(both, &predictor.offset(), 1e-12);
            rest.copy_from(&least.map_err(|_| singular())?);
        }
        Ok(Self {
            state: states * &rest,
            input: rest.rows(0, inputs).into_owned(),
            output: rest.rows(inputs, ny).into_owned(),
        })
    }
}
