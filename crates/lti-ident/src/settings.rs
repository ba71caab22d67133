//! Settings of the prediction-error fit.

use crate::LtiIdentError;

/// Highest order that [`InnovationSettings::check`] accepts.
pub const ORDER_LIMIT: usize = 60;

/// What the model is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Focus {
    /// To simulate from inputs alone: output error first, then K with the plant held.
    #[default]
    Simulation,
    /// To predict the next sample: plant and K together. A may have poles outside the unit circle.
    Prediction,
}

/// The offsets of the model, one for all segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Offset {
    /// The mean of the input is the working point, and the output under it is estimated with the other parameters: the
    /// mean of the output of a lightly damped machine is not that. A plant with integrators has no output at rest;
    /// there the input that lets it rest is estimated.
    #[default]
    Estimated,
    /// Offsets are zero.
    Zero,
}

/// Whether the input acts on the output of the same sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DirectTerm {
    /// D is estimated.
    #[default]
    Estimated,
    /// D is zero. Right for a sampled plant behind a zero-order hold.
    Zero,
}

/// How to fit. What takes them checks every field against this table.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `orders` | none | numbers of states to try; the search climbs through all orders up to the highest | 1 to 60 each, at least one |
/// | `focus` | `Simulation` | what the model is made for | |
/// | `offset` | `Estimated` | whether offsets are estimated | |
/// | `direct` | `Estimated` | whether D is estimated | |
/// | `response_samples` | `None` | length of the impulse response of the own start; `None`: from the samples there are | 4 to 1000 |
/// | `max_iterations` | 60 | Levenberg-Marquardt iterations a start | 1 to 10000 |
/// | `tolerance` | 1e-5 | relative decrease of the cost at which the search ends | 0 to 0.1, 0 excluded |
#[derive(Debug, Clone, PartialEq)]
pub struct InnovationSettings {
    /// Numbers of states to try.
    pub orders: Vec<usize>,
    /// What the model is made for.
    pub focus: Focus,
    /// Whether offsets are estimated.
    pub offset: Offset,
    /// Whether D is estimated.
    pub direct: DirectTerm,
    /// Length of the impulse response of the own start, in samples.
    pub response_samples: Option<usize>,
    /// Most iterations a start.
    pub max_iterations: usize,
    /// Relative decrease of the cost at which the search ends.
    pub tolerance: f64,
}

impl InnovationSettings {
    /// The defaults for some orders.
    #[must_use]
    pub fn new(orders: impl IntoIterator<Item = usize>) -> Self {
        Self {
            orders: orders.into_iter().collect(),
            focus: Focus::default(),
            offset: Offset::default(),
            direct: DirectTerm::default(),
            response_samples: None,
            max_iterations: 60,
            tolerance: 1e-5,
        }
    }
    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`LtiIdentError::Setting`] with the field and what is allowed; [`LtiIdentError::Empty`] without orders.
    pub fn check(&self) -> Result<(), LtiIdentError> {
        let bad = |name, value, allowed| Err(LtiIdentError::Setting { name, value, allowed });
        let (Some(&least), Some(&most)) = (self.orders.iter().min(), self.orders.iter().max()) else {
            return Err(LtiIdentError::Empty { what: "orders" });
        };
        for order in [least, most] {
            if !(1..=ORDER_LIMIT).contains(&order) {
                return bad("orders", order as f64, "each from 1 to 60");
            }
        }
        if let Some(samples) = self.response_samples.filter(|s| !(4..=1000).contains(s)) {
            return bad("response_samples", samples as f64, "from 4 to 1000");
        }
        if !(1..=10_000).contains(&self.max_iterations) {
            return bad("max_iterations", self.max_iterations as f64, "from 1 to 10000");
        }
        if !(self.tolerance > 0.0 && self.tolerance <= 0.1) {
            return bad("tolerance", self.tolerance, "above 0, at most 0.1");
        }
        Ok(())
    }
}
