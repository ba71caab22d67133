//! What the poles of a model do over the length of a record.

use crate::verdict::Stability;
use lpv_core::num_complex::Complex;

/// Samples over which a model without records is judged.
pub(super) const WITHOUT_RECORDS: usize = 10_000;

/// What poles do over so many samples.
pub(crate) fn stability(poles: &[Complex<f64>], samples: usize) -> Stability {
    /// Growth, as a power of e, up to which a pole keeps or loses what it is given ...
    const DRIFTS: f64 = -1.0;
    /// ... and from which on it explodes: a factor of ten.
    const EXPLODES: f64 = 2.3;
    let radius = poles.iter().map(|z| z.norm()).fold(0.0, f64::max);
    let growth = samples as f64 * radius.ln();
    if growth > EXPLODES {
        Stability::Unstable { radius }
    } else if growth > DRIFTS {
        Stability::Integrating
    } else {
        Stability::Stable
    }
}
