//! The direct realisation of an LPV-OBF model, paper Sec. V-C.

use crate::RealizeError;
use crate::exact::exact_lfr;
use lfr_fit::FitError;
use lpv_core::{Discrete, Lfr, LpvStateSpace, SeriesExpansion, WellPosedness};
use nalgebra::{DMatrix, DVector};

/// An LFR with the account of its making.
#[derive(Debug, Clone, PartialEq)]
pub struct Realization {
    /// The LFR.
    pub lfr: Lfr<Discrete>,
    /// The state space that it realises.
    pub state_space: LpvStateSpace<Discrete>,
    /// Well-posedness over the whole range.
    pub well_posedness: WellPosedness,
}

/// Realises `y = R u + sum_i W_i(p) phi_i u` exactly.
///
/// The states are those of the rigid body and one copy of the filter bank for each input: `4 + 2 n_g` for (13) with two
/// inputs. All p-dependence sits at the output, `C(p)`, a polynomial of order N with `n_y` rows: Clenshaw's recurrence
/// needs `n_y N` deltas at most, fewer where the coefficients leave out directions. With `n_g = 16` and `N = 17` these are
/// the 36 states and 34 deltas of the paper.
///
/// # Errors
/// [`RealizeError::NotPolynomial`] for spline, tabulated or Gaussian-process coefficients.
pub fn realize(series: &SeriesExpansion) -> Result<Realization, RealizeError> {
    let state_space = series.to_state_space()?;
    let lfr = in_size(&state_space)?;
    let well_posedness = lfr.well_posedness()?;
    Ok(Realization {
        lfr,
        state_space,
        well_posedness,
    })
}

/// The exact LFR, made with outputs of the size of the states, by powers of two: what counts as rounding depends on no unit.
fn in_size(model: &LpvStateSpace<Discrete>) -> Result<Lfr<Discrete>, RealizeError> {
    let size = |i: usize| {
        let entries = model
            .c()
            .coefficients()
            .iter()
            .flat_map(|m| m.row(i).iter().copied().collect::<Vec<_>>());
        let largest = entries.map(f64::abs).fold(0.0, f64::max);
        if largest.is_normal() {
            largest.log2().floor().clamp(-1000.0, 1000.0).exp2()
        } else {
            1.0
        }
    };
    let units = DVector::from_fn(model.outputs(), |i, _| size(i));
    let (grow, shrink) = (
        DMatrix::from_diagonal(&units),
        DMatrix::from_diagonal(&units.map(f64::recip)),
    );
    let same = |n: usize| DMatrix::identity(n, n);
    let scaled = LpvStateSpace::new(
        model.a().clone(),
        model.b().clone(),
        model.c().multiplied(&shrink, &same(model.states()))?,
        model.d().multiplied(&shrink, &same(model.inputs()))?,
        model.range().clone(),
        model.clock(),
    )?;
    let lfr = exact_lfr(&scaled)?;
    let mut blocks = lfr.blocks().clone();
    for block in [&mut blocks.c2, &mut blocks.d21, &mut blocks.d22] {
        *block = &grow * &*block;
    }
    Ok(Lfr::new(
        blocks,
        lfr.deltas().to_vec(),
        lfr.range().clone(),
        lfr.clock(),
    )?)
}

impl Realization {
    /// Largest relative difference `||G_lfr - G||_F / ||G||_F` of the frozen responses over the given positions and
    /// frequencies.
    ///
    /// # Errors
    /// [`FitError::Empty`]; positions outside the range, frequencies on a pole or above Nyquist.
    pub fn largest_difference(&self, positions: &[f64], frequencies_hz: &[f64]) -> Result<f64, RealizeError> {
        if positions.is_empty() || frequencies_hz.is_empty() {
            return Err(FitError::Empty {
                what: if positions.is_empty() {
                    "positions"
                } else {
                    "frequencies"
                },
            }
            .into());
        }
        let mut largest = 0.0_f64;
        for &p in positions {
            let own = self.lfr.frozen(&[p])?.frequency_response(frequencies_hz)?;
            let truth = self
                .state_space
                .frozen(&[p])?
                .frequency_response(frequencies_hz)?;
            largest = own.relative_error(&truth)?.into_iter().fold(largest, f64::max);
        }
        Ok(largest)
    }
}
