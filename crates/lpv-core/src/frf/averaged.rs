//! A covariance averaged over neighbouring lines.

use super::{C64, FrfEstimate};

impl FrfEstimate {
    /// The same response with the mean of `C_V` over so many lines to each side, and with the degrees of freedom of all of them: for
    /// many outputs after few periods, where the noise changes little from line to line.
    #[must_use]
    pub fn averaged_covariance(&self, half: usize) -> Self {
        let (size, count) = (self.frf.outputs.pow(2), self.frf.len());
        let mut mean = vec![C64::new(0.0, 0.0); self.output_covariance.len()];
        let mut terms = 0;
        for (k, to) in mean.chunks_exact_mut(size.max(1)).enumerate() {
            let window = k.saturating_sub(half)..(k + half + 1).min(count);
            terms += window.len();
            for (at, to) in to.iter_mut().enumerate() {
                let sum: C64 = window
                    .clone()
                    .map(|l| self.output_covariance[l * size + at])
                    .sum();
                *to = sum / window.len() as f64;
            }
        }
        Self {
            output_covariance: mean,
            degrees_of_freedom: self.degrees_of_freedom * terms as f64 / count.max(1) as f64,
            ..self.clone()
        }
    }
}
