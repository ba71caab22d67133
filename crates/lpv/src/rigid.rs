//! What the lowest lines say of the rigid body: `F^-1` is `M (j w)^2 + D j w` there, with mass M and friction D to ground.

use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, FrfEstimate};
use lpv_numerics::statistics::range;

type C64 = Complex<f64>;

/// Lines up to this part of the first mode's frequency tell the rigid body from the modes.
const BELOW_MODES: f64 = 0.25;
/// Fewest lines that tell mass from friction.
const LINES: usize = 4;
/// Deviations that make a value one.
const SIGNIFICANT: f64 = 5.0;
/// Friction below this part of the inertial force at the lowest line is what modes and rounding leave.
const NOTABLE: f64 = 1e-3;
/// Change of the rigid gain along the stroke, relative to its size, that is worth a word.
const VARIES: f64 = 0.02;

/// Mass and viscous friction at one position.
struct Body {
    mass: DMatrix<f64>,
    friction: DMatrix<f64>,
    mass_deviation: DMatrix<f64>,
    friction_deviation: DMatrix<f64>,
    lowest: f64,
}

/// What the lowest lines show of the rigid body beside a constant mass on each axis.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidEvidence {
    /// Friction to ground of each axis with its deviation, in units of input x time over output; none where it is not significant.
    pub friction: Vec<Option<[f64; 2]>>,
    /// By how much the gain varies along the stroke, relative to its size; zero where it does not, as far as noise tells.
    pub varies: f64,
    /// Whether it varies between the axes: an input of one moves another.
    pub coupled: bool,
}

impl RigidEvidence {
    /// Of all positions together. None where the machine has not as many inputs as outputs, where too few lines lie below its modes, and
    /// where these show no mass, or friction that makes a pole as fast as the modes.
    ///
    /// `first_mode_hz`: the lowest natural frequency of a flexible mode, over all positions.
    pub(crate) fn of(estimates: &[FrfEstimate], clock: Discrete, first_mode_hz: f64) -> Option<Self> {
        let bodies: Vec<Body> = estimates
            .iter()
            .map(|e| body(e, clock, BELOW_MODES * first_mode_hz))
            .collect::<Option<_>>()?;
        let axes = bodies.first()?.mass.nrows();
        // A speed, or a lag, has no mass: what would be its friction is another quantity.
        let has_mass = |b: &Body| (0..axes).all(|i| b.mass[(i, i)] > SIGNIFICANT * b.mass_deviation[(i, i)]);
        let fast = std::f64::consts::TAU * BELOW_MODES * first_mode_hz;
        let is_slow = |b: &Body| (0..axes).all(|i| b.friction[(i, i)].abs() < fast * b.mass[(i, i)]);
        if !bodies.iter().all(|b| has_mass(b) && is_slow(b)) {
            return None;
        }
        let (own, between) = coupling(&bodies);
        Some(Self {
            friction: (0..axes).map(|i| friction(&bodies, i)).collect(),
            varies: own.max(between),
            coupled: between > VARIES,
        })
    }

    /// Whether some axis has friction to ground.
    pub fn has_friction(&self) -> bool {
        self.friction.iter().any(Option::is_some)
    }

    /// Whether the gain varies by what a model with a constant one would err.
    pub fn gain_varies(&self) -> bool {
        self.varies > VARIES
    }

    /// In words; a warning where the model has no friction, or a constant gain.
    pub(crate) fn lines(&self, model_has_friction: bool, model_varies: bool) -> Vec<String> {
        let axes = self.friction.len();
        let (warning, missing) = if model_has_friction {
            ("", "")
        } else {
            (
                "warning: ",
                "; the rigid body of the model has none, so that it errs at low frequency and along moves: leave `integrators` to the data, or let `lpv diagnose` fit it",
            )
        };
        let mut lines: Vec<String> = (0..axes)
            .filter_map(|axis| {
                let [value, deviation] = self.friction[axis]?;
                let of = if axes == 1 { String::new() } else { format!(" of axis {}", axis + 1) };
                Some(format!(
                    "{warning}viscous friction to ground{of}: {value:.4e} +- {deviation:.1e} (input x time over output, from the lowest lines){missing}"
                ))
            })
            .collect();
        if self.gain_varies() {
            let coupled = if self.coupled {
                "the axes are coupled: "
            } else {
                ""
            };
            let (warning, missing) = if model_varies {
                ("", "")
            } else {
                (
                    "warning: ",
                    "; the model has a constant one: leave `rigid-body` to the data",
                )
            };
            lines.push(format!(
                "{warning}{coupled}the gain of the rigid body varies by {:.0} % along the stroke{missing}",
                100.0 * self.varies
            ));
        }
        lines
    }
}

/// The gain `M^-1` of the rigid body and its rates `M^-1 D`, one over the unit of time, at one position.
pub(crate) fn gain_and_rate(
    estimate: &FrfEstimate,
    clock: Discrete,
    first_mode_hz: f64,
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let body = body(estimate, clock, BELOW_MODES * first_mode_hz)?;
    let gain = body.mass.try_inverse()?;
    let rate = &gain * body.friction;
    Some((gain, rate))
}

/// The friction of one axis: the mean over the positions, weighted by their variances.
fn friction(bodies: &[Body], axis: usize) -> Option<[f64; 2]> {
    let at = (axis, axis);
    let weights: Vec<f64> = bodies
        .iter()
        .map(|b| b.friction_deviation[at].max(f64::MIN_POSITIVE).powi(-2))
        .collect();
    let whole: f64 = weights.iter().sum();
    let mean = bodies
        .iter()
        .zip(&weights)
        .map(|(b, w)| b.friction[at] * w)
        .sum::<f64>()
        / whole;
    let scatter = bodies
        .iter()
        .zip(&weights)
        .map(|(b, w)| w * (b.friction[at] - mean).powi(2))
        .sum::<f64>();
    // Positions that disagree widen the deviation.
    let free = bodies.len().saturating_sub(1).max(1) as f64;
    let deviation = (1.0 / whole).sqrt() * (scatter / free).max(1.0).sqrt();
    let inertial = bodies
        .iter()
        .map(|b| b.mass[at].abs() * std::f64::consts::TAU * b.lowest)
        .fold(f64::INFINITY, f64::min);
    if mean <= SIGNIFICANT * deviation || mean <= NOTABLE * inertial {
        return None;
    }
    Some([mean, deviation])
}

/// How far the gain of the rigid body, `M^-1`, changes along the stroke relative to its size: on the axes, and between them.
fn coupling(bodies: &[Body]) -> (f64, f64) {
    let axes = bodies[0].mass.nrows();
    let gains: Option<Vec<DMatrix<f64>>> = bodies.iter().map(|b| b.mass.clone().try_inverse()).collect();
    let Some(gains) = gains else {
        return (0.0, 0.0);
    };
    // The largest change relative to the gain, on the axes and between them.
    let mut worst = [0.0f64; 2];
    for i in 0..axes {
        for j in 0..axes {
            let size = |g: &DMatrix<f64>| (g[(i, i)] * g[(j, j)]).abs().sqrt();
            let own: Vec<f64> = gains.iter().map(|g| g[(i, j)]).collect();
            let mean = gains.iter().map(&size).sum::<f64>() / gains.len() as f64;
            let (low, high) = range(&own);
            // The gain's own error, from that of the mass.
            let error = bodies
                .iter()
                .zip(&gains)
                .map(|(b, g)| (g.abs() * &b.mass_deviation * g.abs())[(i, j)])
                .fold(0.0, f64::max);
            if high - low > SIGNIFICANT * error {
                let of = usize::from(i != j);
                worst[of] = worst[of].max((high - low) / mean.max(f64::MIN_POSITIVE));
            }
        }
    }
    (worst[0], worst[1])
}

/// Least squares of `Re = k - m w^2 + m' w^4`, `Im = d w + d' w^3` on every entry of `F^-1` behind the hold.
fn body(estimate: &FrfEstimate, clock: Discrete, highest_hz: f64) -> Option<Body> {
    let frf = estimate.frf();
    let axes = frf.outputs();
    if axes != frf.inputs() || axes == 0 {
        return None;
    }
    let lines: Vec<usize> = (0..frf.len())
        .filter(|&k| (f64::MIN_POSITIVE..=highest_hz).contains(&frf.frequencies_hz()[k]))
        .collect();
    if lines.len() < LINES {
        return None;
    }
    let lowest = frf.frequencies_hz()[lines[0]];
    let mut inverses = Vec::with_capacity(lines.len());
    for &k in &lines {
        let half = 0.5 * std::f64::consts::TAU * frf.frequencies_hz()[k] * clock.sample_time();
        // What the hold does: half a sample of delay, and its gain.
        let hold = C64::from_polar(half.sin() / half, -half);
        let inverse = frf.line(k).into_owned().try_inverse()?;
        inverses.push(inverse * hold);
    }
    let mut found = Body {
        mass: DMatrix::zeros(axes, axes),
        friction: DMatrix::zeros(axes, axes),
        mass_deviation: DMatrix::zeros(axes, axes),
        friction_deviation: DMatrix::zeros(axes, axes),
        lowest,
    };
    for i in 0..axes {
        for j in 0..axes {
            let (mut real, mut imaginary) = (Rows::default(), Rows::default());
            for (&k, z) in lines.iter().zip(&inverses) {
                let w = std::f64::consts::TAU * frf.frequencies_hz()[k];
                // In units of the lowest line: powers of w would span decades.
                let x = frf.frequencies_hz()[k] / lowest;
                let variance = variance(estimate, k, z, (i, j));
                let root = (2.0 / variance.max(1e-18 * z[(i, j)].norm_sqr()).max(f64::MIN_POSITIVE)).sqrt();
                real.push(&[1.0, -w * w, x.powi(4)], z[(i, j)].re, root);
                imaginary.push(&[w, x.powi(3)], z[(i, j)].im, root);
            }
            let (re, re_deviation) = real.solve(1)?;
            let (im, im_deviation) = imaginary.solve(0)?;
            (found.mass[(i, j)], found.mass_deviation[(i, j)]) = (re, re_deviation);
            (found.friction[(i, j)], found.friction_deviation[(i, j)]) = (im, im_deviation);
        }
    }
    Some(found)
}

/// `E |dZ_ij|^2` of `dZ = -Z dF Z`, with the Kronecker covariance of dF.
fn variance(estimate: &FrfEstimate, k: usize, z: &DMatrix<C64>, (i, j): (usize, usize)) -> f64 {
    let left = z.row(i) * estimate.output_covariance(k) * z.row(i).adjoint();
    let right = z.column(j).adjoint() * estimate.input_factor(k) * z.column(j);
    (left[(0, 0)] * right[(0, 0)]).re.max(0.0)
}

/// Weighted rows of a small linear problem.
#[derive(Default)]
struct Rows {
    rows: Vec<Vec<f64>>,
    right: Vec<f64>,
}

impl Rows {
    fn push(&mut self, row: &[f64], right: f64, root: f64) {
        self.rows.push(row.iter().map(|v| v * root).collect());
        self.right.push(right * root);
    }

    /// One unknown with its deviation, widened where the rows are not explained.
    fn solve(&self, wanted: usize) -> Option<(f64, f64)> {
        let (m, n) = (self.rows.len(), self.rows.first()?.len());
        if m <= n {
            return None;
        }
        let mut a = DMatrix::from_fn(m, n, |i, j| self.rows[i][j]);
        let scale: Vec<f64> = (0..n)
            .map(|j| a.column(j).norm().max(f64::MIN_POSITIVE))
            .collect();
        for (j, s) in scale.iter().enumerate() {
            a.column_mut(j).scale_mut(1.0 / s);
        }
        let b = DVector::from_column_slice(&self.right);
        let qr = a.clone().qr();
        let r = qr.r();
        let x = r.solve_upper_triangular(&(qr.q().transpose() * &b))?;
        let inverse = r.solve_upper_triangular(&DMatrix::identity(n, n))?;
        let rest = (&b - &a * &x).norm_squared() / (m - n) as f64;
        let deviation = inverse.row(wanted).norm() * rest.max(1.0).sqrt();
        let found = (x[wanted] / scale[wanted], deviation / scale[wanted]);
        (found.0.is_finite() && found.1.is_finite()).then_some(found)
    }
}

#[cfg(test)]
mod tests;
