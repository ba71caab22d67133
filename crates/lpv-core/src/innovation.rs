//! State space in innovation form: a model of the plant with the predictor that its noise asks for.

use crate::linalg::{dimension, eigenvalues, finite, finite_vector};
use crate::{Clock, CoreError, Discrete, StateSpace, Trajectory};
use nalgebra::{DMatrix, DVector};

/// `x+ = A x + B (u - u_0) + K e`, `y = y_0 + C x + D (u - u_0) + e`, with white innovations `e` of covariance
/// `Lambda` \[ljung1999\], (4.91).
///
/// Shapes: the model as in [`StateSpace`], K `n x n_y`, Lambda `n_y x n_y`, `u_0` of length `n_u`, `y_0` of length
/// `n_y`. The predictor is stable: every eigenvalue of `A - K C` is inside the unit circle. A itself may have poles
/// anywhere.
#[derive(Debug, Clone, PartialEq)]
pub struct InnovationModel {
    model: StateSpace<Discrete>,
    gain: DMatrix<f64>,
    innovation_covariance: DMatrix<f64>,
    input_offset: DVector<f64>,
    output_offset: DVector<f64>,
}

impl InnovationModel {
    /// Checks and keeps the parts; of the covariance the symmetric part.
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`]; [`CoreError::Unstable`] if `A - K C` is not stable.
    pub fn new(
        model: StateSpace<Discrete>,
        gain: DMatrix<f64>,
        innovation_covariance: DMatrix<f64>,
        input_offset: DVector<f64>,
        output_offset: DVector<f64>,
    ) -> Result<Self, CoreError> {
        let (n, nu, ny) = (model.states(), model.inputs(), model.outputs());
        dimension("innovation model: rows of K", n, gain.nrows())?;
        dimension("innovation model: columns of K", ny, gain.ncols())?;
        let lambda = &innovation_covariance;
        dimension("innovation model: rows of the covariance", ny, lambda.nrows())?;
        dimension("innovation model: columns of the covariance", ny, lambda.ncols())?;
        dimension("innovation model: input offset", nu, input_offset.len())?;
        dimension("innovation model: output offset", ny, output_offset.len())?;
        finite("innovation model: K", &gain)?;
        finite("innovation model: covariance", lambda)?;
        finite_vector("innovation model: input offset", &input_offset)?;
        finite_vector("innovation model: output offset", &output_offset)?;
        let poles = eigenvalues(&(model.a() - &gain * model.c()))?;
        if let Some(pole) = poles.into_iter().find(|&z| !model.clock().is_stable_pole(z)) {
            return Err(CoreError::Unstable {
                operation: "the predictor of an innovation model (A - K C)",
                pole: pole.to_string(),
            });
        }
        let innovation_covariance = (lambda + lambda.transpose()) * 0.5;
        Ok(Self {
            model,
            gain,
            innovation_covariance,
            input_offset,
            output_offset,
        })
    }

    /// The model from the input to the output, offsets left out.
    pub fn model(&self) -> &StateSpace<Discrete> {
        &self.model
    }
    /// Innovation gain K, `n x n_y`.
    pub fn gain(&self) -> &DMatrix<f64> {
        &self.gain
    }
    /// Covariance of the innovations, `n_y x n_y`, in squared units of the outputs.
    pub fn innovation_covariance(&self) -> &DMatrix<f64> {
        &self.innovation_covariance
    }
    /// The input that counts as zero.
    pub fn input_offset(&self) -> &DVector<f64> {
        &self.input_offset
    }
    /// The output at rest under that input.
    pub fn output_offset(&self) -> &DVector<f64> {
        &self.output_offset
    }

    /// Response to `inputs` (`n_u x N`, one column a sample) without innovations: no measured output is used.
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`].
    pub fn simulate(
        &self,
        initial_state: &DVector<f64>,
        inputs: &DMatrix<f64>,
    ) -> Result<Trajectory, CoreError> {
        let inputs = without(inputs, &self.input_offset, "innovation model: rows of the input")?;
        let trajectory = self.model.simulate(initial_state, &inputs)?;
        Ok(self.lifted(trajectory))
    }

    /// Predictions of `y(k)` from `u(0) ... u(k)` and `y(0) ... y(k-1)`: the trajectory of the predictor
    /// `x+ = (A - K C) x + (B - K D) (u - u_0) + K (y - y_0)`. Inputs are `n_u x N`, measured outputs and predictions
    /// `n_y x N`, one column a sample.
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`].
    pub fn predict_one_step(
        &self,
        initial_state: &DVector<f64>,
        inputs: &DMatrix<f64>,
        outputs: &DMatrix<f64>,
    ) -> Result<Trajectory, CoreError> {
        dimension(
            "prediction: samples of the output",
            inputs.ncols(),
            outputs.ncols(),
        )?;
        let inputs = without(inputs, &self.input_offset, "prediction: rows of the input")?;
        let outputs = without(outputs, &self.output_offset, "prediction: rows of the output")?;
        let trajectory = self
            .predictor()?
            .simulate(initial_state, &stacked(&inputs, &outputs))?;
        Ok(self.lifted(trajectory))
    }

    /// The predictor as a system from `[u - u_0; y - y_0]` to the prediction of `y - y_0`.
    ///
    /// # Errors
    /// [`CoreError::NotFinite`] if it overflows.
    pub fn predictor(&self) -> Result<StateSpace<Discrete>, CoreError> {
        let (m, k) = (&self.model, &self.gain);
        let none = DMatrix::zeros(m.outputs(), m.outputs());
        let b = crate::linalg::from_blocks(&[&[&(m.b() - k * m.d()), k]])?;
        let d = crate::linalg::from_blocks(&[&[m.d(), &none]])?;
        StateSpace::new(m.a() - k * m.c(), b, m.c().clone(), d, m.clock())
    }

    fn lifted(&self, mut trajectory: Trajectory) -> Trajectory {
        for mut y in trajectory.outputs.column_iter_mut() {
            y += &self.output_offset;
        }
        trajectory
    }
}

fn without(
    signal: &DMatrix<f64>,
    offset: &DVector<f64>,
    what: &'static str,
) -> Result<DMatrix<f64>, CoreError> {
    dimension(what, offset.len(), signal.nrows())?;
    let mut rest = signal.clone();
    for mut sample in rest.column_iter_mut() {
        sample -= offset;
    }
    Ok(rest)
}

fn stacked(top: &DMatrix<f64>, bottom: &DMatrix<f64>) -> DMatrix<f64> {
    let mut m = DMatrix::zeros(top.nrows() + bottom.nrows(), top.ncols());
    m.rows_mut(0, top.nrows()).copy_from(top);
    m.rows_mut(top.nrows(), bottom.nrows()).copy_from(bottom);
    m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Model;
    use nalgebra::{dmatrix, dvector};

    /// `x+ = 0.5 x + (u - 1) + 0.4 e`, `y = 3 + 2 x + (u - 1) + e`.
    fn model(gain: f64) -> Result<InnovationModel, CoreError> {
        let one = |v: f64| dmatrix![v];
        let clock = Discrete::new(0.1)?;
        let plant = StateSpace::new(one(0.5), one(1.0), one(2.0), one(1.0), clock)?;
        InnovationModel::new(plant, one(gain), one(0.25), dvector![1.0], dvector![3.0])
    }

    #[test]
    fn simulation_and_prediction_by_hand() {
        let model = model(0.4).unwrap();
        let (x, u) = (dvector![1.0], dmatrix![2.0, 1.0, 0.0]);
        // x: 1, 1.5, 0.75; y: 3 + 2 + 1, 3 + 3 + 0, 3 + 1.5 - 1.
        let simulated = model.simulate(&x, &u).unwrap();
        assert!((simulated.outputs - dmatrix![6.0, 6.0, 3.5]).amax() < 1e-15);
        // Measured 7: e = 1, so x becomes 1.5 + 0.4 and the prediction 3 + 3.8.
        let y = dmatrix![7.0, 6.8, 0.0];
        let predicted = model.predict_one_step(&x, &u, &y).unwrap().outputs;
        assert!((predicted.columns(0, 2) - dmatrix![6.0, 6.8]).amax() < 1e-14);
        // The second innovation is zero: x becomes 0.95.
        assert!((predicted[2] - (3.0 + 1.9 - 1.0)).abs() < 1e-14);
    }

    #[test]
    fn outputs_of_the_model_itself_are_predicted_without_error() {
        let model = model(0.4).unwrap();
        let u = DMatrix::from_fn(1, 50, |_, k| (k as f64).sin());
        let y = model.simulate(&dvector![0.3], &u).unwrap();
        let predicted = model.predict_one_step(&dvector![0.3], &u, &y.outputs).unwrap();
        assert!((predicted.outputs - y.outputs).amax() < 1e-12);
        assert!((predicted.final_state - y.final_state).amax() < 1e-12);
    }

    #[test]
    fn json_round_trip_is_exact() {
        let kept = Model::InnovationStateSpace(model(0.4).unwrap());
        let text = kept.to_json().unwrap();
        assert!(text.contains("innovation-state-space"));
        assert_eq!(Model::from_json(&text).unwrap(), kept);
        let unstable = text.replace("0.4", "-0.4");
        assert!(Model::from_json(&unstable).is_err());
    }

    #[test]
    fn wrong_parts_are_refused_by_name() {
        // A - K C = 0.5 - 2 (-0.4) = 1.3.
        assert!(matches!(model(-0.4), Err(CoreError::Unstable { .. })));
        assert!(matches!(model(f64::NAN), Err(CoreError::NotFinite { .. })));
        let good = model(0.4).unwrap();
        let short = good.predict_one_step(&dvector![0.0], &dmatrix![1.0, 1.0], &dmatrix![1.0]);
        assert!(matches!(short, Err(CoreError::Dimension { .. })));
        let two = good.simulate(&dvector![0.0], &dmatrix![1.0; 1.0]);
        assert!(matches!(two, Err(CoreError::Dimension { .. })));
    }
}
