//! What is known between the positions of the data: two models bounded against each other at every p, and what the data
//! support.

mod between;
mod cells;
mod settings;

use crate::RealizeError;
pub use between::{Between, BetweenWarning, Interval, bound_between, largest_shift_of};
use cells::{Cell, Line};
use lfr_fit::FitError;
use lpv_core::{Clock, Lfr};
pub use settings::BoundSettings;

/// The relative difference of two LFRs over all p of a set and all lines given.
#[derive(Debug, Clone, PartialEq)]
pub struct DifferenceBound {
    /// The largest `||F - G||_F / ||G||_F` that was met.
    pub largest: f64,
    /// No p of the set has a larger one on these lines, up to rounding; infinite where no bound was found.
    pub bound: f64,
    /// Where the largest was met: scheduling values.
    pub at: Vec<f64>,
    /// And on which line.
    pub frequency_hz: f64,
    /// Cells looked at, over all lines.
    pub cells: usize,
}

/// Bounds `||F(p) - G(p)||_F / ||G(p)||_F` over the whole range and all lines, F the response of `model` and G that of
/// `reference`: not at samples only, but at every p.
///
/// Both are rational in p. On a cell around `p_0` the response is a power series whose first terms are known, and a rest
/// that the matrices of the LFR bound; cells are halved until the bound is near the largest value met. The responses are
/// those of the LFRs themselves, for continuous time those at `s = 2 pi i f` and not behind a hold.
///
/// # Errors
/// [`FitError::Empty`] without lines, [`FitError::Core`] for models whose sizes, clocks or ranges differ, or a line
/// on a pole.
pub fn difference_bound<K: Clock>(
    model: &Lfr<K>,
    reference: &Lfr<K>,
    frequencies_hz: &[f64],
    settings: &BoundSettings,
) -> Result<DifferenceBound, RealizeError> {
    let parameters = model.range().parameters();
    let unit = |j: usize| (0..parameters).map(|i| f64::from(u8::from(i == j))).collect();
    let whole = Cell {
        centre: vec![0.0; parameters],
        directions: (0..parameters).map(unit).collect(),
    };
    over_cell(model, reference, frequencies_hz, whole, settings)
}

/// The bound over one cell.
fn over_cell<K: Clock>(
    model: &Lfr<K>,
    reference: &Lfr<K>,
    frequencies_hz: &[f64],
    whole: Cell,
    settings: &BoundSettings,
) -> Result<DifferenceBound, RealizeError> {
    settings.check()?;
    check(model, reference)?;
    let set = settings;
    let mut found = DifferenceBound {
        largest: 0.0,
        bound: 0.0,
        at: model.range().centre(),
        frequency_hz: *frequencies_hz.first().ok_or(FitError::Empty { what: "lines" })?,
        cells: 0,
    };
    let place = |delta: &[f64]| -> Vec<f64> {
        let (centre, half) = (model.range().centre(), model.range().half_width());
        delta
            .iter()
            .zip(centre.iter().zip(&half))
            .map(|(d, (c, h))| c + d * h)
            .collect()
    };
    let mut lines = Vec::new();
    for &f in frequencies_hz {
        let on_pole = || lpv_core::CoreError::Singular {
            operation: "the response on a line that is a pole",
        };
        let own = Line::new(model, f).ok_or_else(on_pole)?;
        lines.push((own, Line::new(reference, f).ok_or_else(on_pole)?, f));
    }
    // What is largest at the centre tells which cells of other lines need no halving.
    for (own, other, f) in &lines {
        if let Some(value) = judge(own, other, &whole)
            .map(|(value, _)| value)
            .filter(|v| *v > found.largest)
        {
            (found.largest, found.at, found.frequency_hz) = (value, place(&whole.centre), *f);
        }
    }
    for (own, other, f) in &lines {
        let mut waiting = vec![whole.clone()];
        let mut left = set.max_cells;
        while let Some(cell) = waiting.pop() {
            found.cells += 1;
            // A model that does not exist at the centre has no bound, whatever the cell.
            let Some((value, bound)) = judge(own, other, &cell) else {
                found.bound = f64::INFINITY;
                break;
            };
            if value > found.largest {
                (found.largest, found.at, found.frequency_hz) = (value, place(&cell.centre), *f);
            }
            let enough = (found.largest * (1.0 + set.tolerance)).max(set.floor);
            if bound <= enough || left == 0 {
                found.bound = found.bound.max(bound);
            } else {
                left -= 1;
                waiting.extend(cell.split());
            }
        }
    }
    Ok(found)
}

/// The relative difference at the centre of a cell, and a bound on it over the cell.
fn judge(own: &Line, other: &Line, cell: &Cell) -> Option<(f64, f64)> {
    let (f, g) = (own.expand(cell)?, other.expand(cell)?);
    let size = g.value.norm();
    let difference = (&f.value - &g.value).norm();
    let terms: f64 = f.terms.iter().zip(&g.terms).map(|(f, g)| (f - g).norm()).sum();
    let least = size - g.terms.iter().map(|s| s.norm()).sum::<f64>() - g.rest;
    let most = difference + terms + f.rest + g.rest;
    let value = difference / size;
    let bound = if most == 0.0 {
        0.0
    } else if least > 0.0 {
        most / least
    } else {
        f64::INFINITY
    };
    value.is_finite().then_some((value, bound))
}

fn check<K: Clock>(model: &Lfr<K>, reference: &Lfr<K>) -> Result<(), RealizeError> {
    let (first_nyquist_hz, second_nyquist_hz) = (model.clock().nyquist_hz(), reference.clock().nyquist_hz());
    // Two continuous clocks have none, which is the same infinity.
    if first_nyquist_hz != second_nyquist_hz {
        return Err(lpv_core::CoreError::DifferentClocks {
            first_nyquist_hz,
            second_nyquist_hz,
        }
        .into());
    }
    let sizes = [
        ("bound: outputs", model.outputs(), reference.outputs()),
        ("bound: inputs", model.inputs(), reference.inputs()),
        (
            "bound: scheduling parameters",
            model.range().parameters(),
            reference.range().parameters(),
        ),
    ];
    for (what, expected, found) in sizes {
        lpv_core::linalg::dimension(what, expected, found)?;
    }
    for corner in [0, 1] {
        let p: Vec<f64> = reference.range().bounds().iter().map(|b| b[corner]).collect();
        model.range().check(&p)?;
        let p: Vec<f64> = model.range().bounds().iter().map(|b| b[corner]).collect();
        reference.range().check(&p)?;
    }
    Ok(())
}
