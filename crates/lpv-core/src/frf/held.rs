//! A response of continuous time, taken to the samples of an input that is held.
//!
//! Samples of `G` behind a hold of zero order `H` have the response `sum_k H(s + j k w_s) G(s + j k w_s)`, `w_s` the sample rate. Where G
//! rolls off, the terms that fold back are negligible and `H G` is left. Not so for a constant: the samples of a held input times `c` are
//! `c` times the input, without the half sample by which H is late. So `G = c + G_0` with `G_0` strictly proper has the samples
//! `c + H G_0 = H G + (1 - H) c`.

use super::FrfEstimate;
use crate::Discrete;
use nalgebra::DMatrix;

impl FrfEstimate {
    /// The same, its values known to be a response of continuous time times that of the hold of this clock
    /// ([`Discrete::hold_response`]).
    #[must_use]
    pub fn of_held_input(self, clock: Discrete) -> Self {
        Self {
            held: Some(clock),
            ..self
        }
    }

    /// Whether it is one of continuous time times that of a hold, whose direct term is not known yet.
    pub fn is_of_held_input(&self) -> bool {
        self.held.is_some()
    }

    /// What the samples of a machine with this direct term (outputs x inputs) have responded: `H G + (1 - H) c`. Of a response that was
    /// not multiplied by a hold, the same.
    ///
    /// # Panics
    /// If the direct term has another shape than the response.
    #[must_use]
    pub fn beside_direct(&self, direct: &DMatrix<f64>) -> Self {
        let Some(clock) = self.held else {
            return self.clone();
        };
        let mut frf = self.frf.clone();
        assert_eq!(
            direct.shape(),
            (frf.outputs, frf.inputs),
            "shape of the direct term"
        );
        for k in 0..frf.len() {
            let rest = -(clock.hold_response(frf.frequencies_hz[k]) - 1.0);
            for (value, c) in frf.line_slice_mut(k).iter_mut().zip(direct.iter()) {
                *value += rest * *c;
            }
        }
        Self {
            frf,
            held: None,
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Discrete, Frf, FrfEstimate};
    use nalgebra::dmatrix;
    use num_complex::Complex;

    /// A lag beside a constant: `c + (1 - a) / (z - a)`, `a = e^(-wT)`, from `G = c + w / (s + w)`.
    #[test]
    fn a_constant_beside_a_lag_is_not_late() {
        let (rate, w, c) = (1000.0, 20.0, 3.0);
        let clock = Discrete::from_rate(rate).unwrap();
        let lines: Vec<f64> = (1..=50).map(f64::from).collect();
        let s = |f: f64| Complex::new(0.0, std::f64::consts::TAU * f);
        let held = lines
            .iter()
            .map(|f| (c + w / (s(*f) + w)) * clock.hold_response(*f))
            .collect();
        let frf = Frf::new(lines.clone(), 1, 1, held).unwrap();
        let estimate = FrfEstimate::with_unit_covariance(frf, None).unwrap();
        assert_eq!(estimate.beside_direct(&dmatrix![c]), estimate);
        let sampled = estimate.of_held_input(clock).beside_direct(&dmatrix![c]);
        let a = (-w / rate).exp();
        for (k, f) in lines.iter().enumerate() {
            let z = (s(*f) / rate).exp();
            let exact = c + (1.0 - a) / (z - a);
            let off = (sampled.frf().line(k)[(0, 0)] / exact - 1.0).norm();
            // What folds back of the lag is w T f T / 6 or so.
            assert!(off < 2e-4, "{f} Hz: {off:e}");
        }
        assert!(!sampled.is_of_held_input());
    }
}
