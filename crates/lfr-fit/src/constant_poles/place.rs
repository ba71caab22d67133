//! One frozen model a position, all with the same poles.

use super::C64;
use super::model::Modal;
use crate::local::{Beside, Residues, around};
use crate::{FitError, FrozenData, RefineSettings, ResidualUnit, refine};
use lpv_core::Continuous;
use lpv_core::linalg::svd;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// B and C of one position, in the coordinates of [`Modal`].
#[derive(Debug, Clone)]
pub(super) struct Place {
    /// `m x n_u`.
    pub(super) b: DMatrix<f64>,
    /// `n_y x m`.
    pub(super) c: DMatrix<f64>,
}

impl Place {
    /// B and C of one block of coordinates, given by its first one and its size.
    pub(super) fn block(&self, (first, size): (usize, usize)) -> [DMatrix<f64>; 2] {
        [
            self.b.rows(first, size).into_owned(),
            self.c.columns(first, size).into_owned(),
        ]
    }

    /// Puts these in its place.
    pub(super) fn set_block(&mut self, (first, size): (usize, usize), [b, c]: &[DMatrix<f64>; 2]) {
        self.b.rows_mut(first, size).copy_from(b);
        self.c.columns_mut(first, size).copy_from(c);
    }
}

/// The models of all positions.
pub(super) struct Places {
    pub(super) modal: Modal,
    pub(super) places: Vec<Place>,
    /// The data with lines merged about them.
    pub(super) few: FrozenData,
}

/// Lines of data without noise, and of the search for the rank.
const LINES: usize = 160;

/// A rank of the rigid body whose successor leaves less than this part of its residual is too small.
const BETTER: f64 = 0.97;

/// Models with these poles, of the smallest rank of the rigid body that does; none where one leaves more than `most`.
pub(super) fn places(
    data: &FrozenData,
    poles: &[C64],
    rigid: bool,
    most: f64,
) -> Result<Option<Places>, FitError> {
    // The rank shows in few lines, too.
    let middle = data.at(data.len() / 2).thinned(LINES);
    let full = data.outputs().min(data.inputs());
    let ranks = if rigid { 1..=full } else { 0..=0 };
    let mut best: Option<(f64, usize)> = None;
    for rank in ranks {
        let (_, _, rms) = place(&middle, poles, rank)?;
        if best.is_some_and(|(least, _)| least <= most && rms > BETTER * least) {
            break;
        }
        best = Some((rms, rank));
    }
    let Some((_, rank)) = best.filter(|(rms, _)| *rms <= most) else {
        return Ok(None);
    };
    let found: Vec<_> = (0..data.len())
        .into_par_iter()
        .map(|i| place(&data.at(i), poles, rank))
        .collect();
    let mut all = Vec::with_capacity(found.len());
    let mut few: Vec<FrozenData> = Vec::with_capacity(found.len());
    for found in found {
        let (own, lines, rms) = found?;
        if rms > most {
            return Ok(None);
        }
        all.push(own);
        few.push(lines);
    }
    Ok(Some(Places {
        modal: Modal::new(rank, poles, data.clock()),
        places: all,
        few: FrozenData::together(&few)?,
    }))
}

/// The model of one position, its data in few lines, and the rms residual there.
fn place(data: &FrozenData, poles: &[C64], rank: usize) -> Result<(Place, FrozenData, f64), FitError> {
    let modal = Modal::new(rank, poles, data.clock());
    let range = around(&data.positions()[0].p)?;
    let mut own = start(data, poles, rank)?;
    let settings = RefineSettings {
        max_iterations: 20,
        tolerance: 1e-2,
        ..RefineSettings::default()
    };
    let lines = |own: &Place| -> Result<FrozenData, FitError> {
        match data.unit() {
            ResidualUnit::Relative => Ok(data.thinned(LINES)),
            ResidualUnit::StandardDeviation => data.merged_lines(&[modal.held(own, data.clock())?]),
        }
    };
    let mut rms = f64::INFINITY;
    // Lines are merged about the data once the model is near them.
    for _ in 0..2 {
        let fitted = refine(&modal.local(&own, &range)?, &lines(&own)?, &settings)?;
        own = modal.place(fitted.candidate.matrix(), data.outputs(), data.inputs());
        rms = fitted.account.rms;
    }
    Ok((own.clone(), lines(&own)?, rms))
}

/// Residues by linear least squares, cut to the rank of the rigid body and to rank one of each mode.
fn start(data: &FrozenData, poles: &[C64], rank: usize) -> Result<Place, FitError> {
    let beside = if rank > 0 { Beside::Gain } else { Beside::Nothing };
    let residues = Residues::new(Continuous, data, poles, beside)?;
    let (modes, gamma) = residues.realise(Continuous, data)?;
    let (ny, nu, flexible) = (data.outputs(), data.inputs(), modes.states());
    let mut b = DMatrix::zeros(rank + flexible, nu);
    let mut c = DMatrix::zeros(ny, rank + flexible);
    b.rows_mut(rank, flexible).copy_from(modes.b());
    c.columns_mut(rank, flexible).copy_from(modes.c());
    if rank > 0 {
        // Outputs and inputs of size one: units are the user's.
        let size = |norm: f64| if norm > 0.0 { norm } else { 1.0 };
        let rows: Vec<f64> = gamma.row_iter().map(|r| size(r.norm())).collect();
        let columns: Vec<f64> = (0..nu)
            .map(|j| {
                size(
                    (0..ny)
                        .map(|i| (gamma[(i, j)] / rows[i]).powi(2))
                        .sum::<f64>()
                        .sqrt(),
                )
            })
            .collect();
        let even = DMatrix::from_fn(ny, nu, |i, j| gamma[(i, j)] / (rows[i] * columns[j]));
        let svd = svd(even)?;
        if let (Some(u), Some(v)) = (&svd.u, &svd.v_t) {
            for k in 0..rank {
                let root = svd.singular_values[k].sqrt();
                (0..nu).for_each(|j| b[(k, j)] = root * v[(k, j)] * columns[j]);
                (0..ny).for_each(|i| c[(i, k)] = root * u[(i, k)] * rows[i]);
            }
        }
    }
    Ok(Place { b, c })
}
