//! What the lines of one position leave open: fits that explain them as well as the model does, and act otherwise.
//!
//! Below the lowest line a free mass, friction and a soft spring differ, and above the highest a direct term and a stiff mode. Where two
//! of them describe the lines about as shortly, the lines do not tell which one the machine is. How much that matters is measured on the
//! response to a unit step over a period of the lowest line: slower than that, nothing was measured. What chance leaves open of
//! the fit itself is measured alike, on fits to resampled noise.

use super::PoleStage;
use super::contest::FEW_LINES;
use super::search::{Search, Structure, alternates, upper_half};
use lpv_core::linalg::from_blocks;
use lpv_core::nalgebra::DMatrix;
use lpv_core::num_complex::Complex;
use lpv_core::{CoreError, Discrete, FrfEstimate, StateSpace};
use pole_fit::{PoleFit, PoleFitSettings, fit_from};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// One fit of one position.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    pub(super) structure: Structure,
    pub(super) fit: PoleFit,
    /// Whether the contest has gone on from it.
    pub(super) is_descended: bool,
}

/// What the lines of one position do not determine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Undetermined {
    /// Lowest line that is not zero, Hz.
    pub lowest_hz: f64,
    /// Highest line, Hz.
    pub highest_hz: f64,
    /// Integrators of the model, and of another fit that describes the lines about as shortly.
    pub integrators: [usize; 2],
    /// Largest difference of their responses to a step of each input, over a period of the lowest line, percent of the largest response of
    /// the model.
    pub difference_percent: f64,
}

impl Undetermined {
    /// Whether the difference is one that a user would call another machine.
    pub(crate) fn matters(&self) -> bool {
        /// Percent.
        const ANOTHER_MACHINE: f64 = 20.0;
        self.difference_percent > ANOTHER_MACHINE
    }
}

/// Description lengths within this are as likely as twenty to one, `2 ln 20`: the shorter one is not sure.
const AS_SHORT: f64 = 6.0;

/// Fits to what chance might have given.
const RESAMPLES: usize = 8;

impl Search<'_> {
    /// Of the candidates with stable poles those that describe the lines about as shortly as `taken`, or more so; of fits with the same
    /// integrators and order the best.
    pub(super) fn about_as_short(&self, taken: &PoleFit) -> Vec<PoleFit> {
        let most = self.length(taken) + AS_SHORT;
        let held = self.held().is_some();
        let mut near: Vec<&PoleFit> = Vec::new();
        for Candidate { fit, .. } in &self.candidates {
            let sound =
                fit.account.unstable_poles.is_empty() && fit.account.equations == taken.account.equations;
            if !sound || held && alternates(fit) || self.length(fit) > most {
                continue;
            }
            let alike = |o: &&mut &PoleFit| {
                o.fixed_integrators == fit.fixed_integrators && o.account.unknowns == fit.account.unknowns
            };
            match near.iter_mut().find(alike) {
                Some(other) if other.account.cost <= fit.account.cost => {}
                Some(other) => *other = fit,
                None => near.push(fit),
            }
        }
        near.into_iter().cloned().collect()
    }

    /// Fits of the structure of `taken` to what chance might have given of few lines: its response, and its residual turned by another phase
    /// at each line and enlarged to the noise that its unknowns have taken away.
    pub(super) fn resampled(&self, taken: &PoleFit) -> Vec<PoleFit> {
        let few = self.estimates.iter().filter(|e| e.frf().len() <= FEW_LINES);
        let again = few.flat_map(|e| (0..RESAMPLES).filter_map(|turn| self.once_more(e, taken, turn)));
        again.filter(|f| f.account.unstable_poles.is_empty()).collect()
    }

    fn once_more(&self, estimate: &FrfEstimate, taken: &PoleFit, turn: usize) -> Option<PoleFit> {
        let estimate = match taken.state_space() {
            Ok(model) => estimate.beside_direct(model.d()),
            Err(_) => return None,
        };
        let own = estimate.frf();
        let mut frf = taken.response(own.frequencies_hz()).ok()?;
        let left = (taken.account.equations - taken.account.unknowns).max(1);
        let size = (taken.account.equations as f64 / left as f64).sqrt();
        for k in 0..frf.len() {
            // Multiples of the golden ratio leave no pattern over the lines.
            const GOLDEN: f64 = 0.618_033_988_749_894_9;
            let phase = (GOLDEN * ((turn + 1) * (k + 1) * (k + turn + 2)) as f64).fract();
            let factor = Complex::from_polar(size, TAU * phase);
            for (value, measured) in frf.line_slice_mut(k).iter_mut().zip(own.line_slice(k)) {
                *value += factor * (measured - *value);
            }
        }
        let (c_v, s) = (estimate.output_covariances(), estimate.input_factors());
        let freedom = estimate.degrees_of_freedom();
        let again = FrfEstimate::new(frf, c_v.to_vec(), s.to_vec(), freedom, None).ok()?;
        let settings = PoleFitSettings {
            order: taken.account.order,
            several_starts: false,
            ..self.settings
        };
        fit_from(&again, self.clock, &settings, &upper_half(taken)).ok()
    }
}

impl PoleStage {
    /// The candidate whose response to a step departs most from that of the model; none where there is no other.
    ///
    /// # Errors
    /// [`CoreError`] of a model whose response overflows.
    pub(crate) fn undetermined(
        &self,
        model: &StateSpace<Discrete>,
        lines_hz: &[f64],
    ) -> Result<Option<Undetermined>, CoreError> {
        let lowest = lines_hz.iter().copied().find(|f| *f > 0.0);
        let (Some(lowest_hz), Some(highest_hz)) = (lowest, lines_hz.last().copied()) else {
            return Ok(None);
        };
        let own = Steps::of(model, lowest_hz)?;
        let mut most: Option<Undetermined> = None;
        for fit in &self.candidates {
            let Ok(other) = fit.state_space().and_then(|s| Steps::of(&s, lowest_hz)) else {
                continue;
            };
            let difference_percent = 100.0 * own.difference(&other);
            if most
                .as_ref()
                .is_none_or(|m| difference_percent > m.difference_percent)
            {
                most = Some(Undetermined {
                    lowest_hz,
                    highest_hz,
                    integrators: [self.integrators, fit.fixed_integrators],
                    difference_percent,
                });
            }
        }
        Ok(most)
    }
}

/// Responses to a unit step of each input at equidistant times over a period of a frequency.
struct Steps(Vec<DMatrix<f64>>);

impl Steps {
    /// Times, at most.
    const TIMES: usize = 128;

    fn of(model: &StateSpace<Discrete>, frequency_hz: f64) -> Result<Self, CoreError> {
        let samples = (1.0 / (frequency_hz * model.clock().sample_time())).ceil() as usize;
        let stride = samples.div_ceil(Self::TIMES).max(1);
        let (n, m) = (model.b().nrows(), model.b().ncols());
        // [x; u] over a stride, u held at one.
        let one = from_blocks(&[
            &[model.a(), model.b()],
            &[&DMatrix::zeros(m, n), &DMatrix::identity(m, m)],
        ])?;
        let stride = power(&one, stride);
        let mut state = DMatrix::zeros(n + m, m);
        state.rows_mut(n, m).fill_with_identity();
        let read = from_blocks(&[&[model.c(), model.d()]])?;
        let mut values = Vec::with_capacity(Self::TIMES);
        for _ in 0..Self::TIMES.min(samples) {
            state = &stride * state;
            values.push(&read * &state);
        }
        Ok(Self(values))
    }

    /// Largest departure of the other over the largest of the own, of all channels together.
    fn difference(&self, other: &Self) -> f64 {
        let largest = |sizes: &mut dyn Iterator<Item = f64>| sizes.fold(0.0, f64::max);
        let size = largest(&mut self.0.iter().map(DMatrix::norm));
        let off = largest(&mut self.0.iter().zip(&other.0).map(|(a, b)| (a - b).norm()));
        if off == 0.0 { 0.0 } else { off / size }
    }
}

/// By squaring.
fn power(matrix: &DMatrix<f64>, mut exponent: usize) -> DMatrix<f64> {
    let mut square = matrix.clone();
    let mut product = DMatrix::identity(matrix.nrows(), matrix.ncols());
    while exponent > 0 {
        if exponent % 2 == 1 {
            product = &product * &square;
        }
        exponent /= 2;
        if exponent > 0 {
            square = &square * &square;
        }
    }
    product
}
