//! Parameters of the machine and of its effects together, from records in closed loop.

mod descent;
mod explained;
mod levenberg;
mod parts;
mod triangle;

use crate::base::{Motion, Pair};
use crate::simulate::{LANES, Run, side_by_side};
use crate::track::Track;
use crate::whiten::Whitening;
pub use explained::Explained;
pub(crate) use levenberg::{Minimum, minimum};
use lpv_core::ControllerState;
use nalgebra::{DMatrix, DMatrixView, DVector};
use parts::Part;
use rayon::prelude::*;
use triangle::in_coordinates;
pub(crate) use triangle::{deviations, squares};

/// What is known of the machine's coordinates before the moves: `|W (c - c0)|^2` joins the sum of squares.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// c0.
    pub mean: DVector<f64>,
    /// W.
    pub weight: DMatrix<f64>,
    /// Whether it holds for certain. One that does not may be far off, where an effect has bent what it was taken from: with d
    /// the departure and n the rows of W it counts as `n ln(1 + |d|^2 / n)`.
    pub firm: bool,
}

/// Records to explain.
pub(crate) struct Problem<'a> {
    pub(crate) tracks: &'a [Track],
    pub(crate) controller: &'a ControllerState,
    pub(crate) whitening: &'a Whitening,
    pub(crate) prior: Option<&'a Prior>,
    pub(crate) seen: Seen,
}

/// Signals of the loop whose errors count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Seen {
    Outputs,
    /// What the controller gives.
    Inputs,
}

/// How finely a simulation follows a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Grain {
    /// As a result needs it.
    Fine,
    /// As a difference needs it.
    Rough,
}

/// A fit with its account.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    pub(crate) model: Explained,
    /// See [`Problem::objective`].
    pub(crate) objective: f64,
    /// Sum of squares over what noise leaves, at least one.
    pub(crate) excess: f64,
    /// Factor of the prior in `residual`, `factor` and `jacobian`.
    pub(crate) scale: f64,
    /// Whitened errors, then what departs from the prior.
    pub(crate) residual: Vec<f64>,
    /// Upper triangle with `R^T R = J^T J` at the result; J in coordinates.
    pub(crate) factor: DMatrix<f64>,
    /// J, the machine's columns first.
    jacobian: DMatrix<f64>,
    /// Difference steps by coordinate.
    pub(crate) steps: Vec<f64>,
}

impl Fitted {
    /// Machine's columns of J.
    pub(crate) fn columns(&self) -> DMatrixView<'_, f64> {
        self.jacobian.columns(0, self.model.base.coordinates().len())
    }

    /// Length of the description of the records, up to a constant.
    pub(crate) fn length(&self) -> f64 {
        self.objective + self.factor.ncols() as f64 * (self.residual.len() as f64).ln()
    }
}

/// Parts of a record.
const PARTS: usize = 32;

/// Root-mean-square change of the whitened residual that a difference step makes.
const STEP: f64 = 0.03;

impl Problem<'_> {
    /// Errors in closed loop by record.
    pub(crate) fn errors(&self, model: &Explained) -> Option<Vec<Vec<Pair>>> {
        self.errors_in(Track::fine, std::slice::from_ref(model)).pop()?
    }

    /// The same of several models with these parts of a sample.
    fn errors_in(&self, parts: fn(&Track) -> usize, models: &[Explained]) -> Vec<Option<Vec<Vec<Pair>>>> {
        let blocks: Vec<_> = models.iter().map(Explained::blocks).collect();
        let runs: Vec<(&Track, Run<'_>)> = models
            .iter()
            .zip(&blocks)
            .flat_map(|(model, blocks)| {
                self.tracks.iter().map(|track| {
                    let run = Run::new(&model.base, blocks, track).in_loop(self.controller);
                    (track, run.in_parts(parts(track)))
                })
            })
            .collect();
        let gap = |(a, b): (&Pair, &Pair)| [a[0] - b[0], a[1] - b[1]];
        let errors: Vec<Option<Vec<Pair>>> = runs
            .par_chunks(LANES)
            .flat_map_iter(|some| {
                let (tracks, runs): (Vec<&Track>, Vec<&Run<'_>>) = some.iter().map(|(t, r)| (*t, r)).unzip();
                tracks.into_iter().zip(side_by_side(&runs)).map(|(track, found)| {
                    let found = found?;
                    Some(match self.seen {
                        Seen::Outputs => found.error(track),
                        Seen::Inputs => track.inputs.iter().zip(&found.inputs).map(gap).collect(),
                    })
                })
            })
            .collect();
        let mut errors = errors.into_iter();
        let mut of_one = || -> Vec<_> { errors.by_ref().take(self.tracks.len()).collect() };
        models.iter().map(|_| of_one().into_iter().collect()).collect()
    }

    /// Motions of the machine by record.
    pub(crate) fn motions(&self, model: &Explained) -> Option<Vec<Vec<Motion>>> {
        let motions = |track: &Track| model.motions(self.controller, track);
        self.tracks.par_iter().map(motions).collect()
    }

    /// Whitened errors, then what departs from the prior.
    pub(crate) fn residual(&self, model: &Explained) -> Option<Vec<f64>> {
        self.whitened(self.errors(model)?, model)
    }

    /// The same from a coarse integration, or a fine one where that diverges: for small differences only.
    pub(crate) fn rough(&self, model: &Explained) -> Option<Vec<f64>> {
        self.residuals(Grain::Rough, std::slice::from_ref(model)).pop()?
    }

    /// Residuals of several models.
    fn residuals(&self, grain: Grain, models: &[Explained]) -> Vec<Option<Vec<f64>>> {
        let errors = match grain {
            Grain::Fine => self.errors_in(Track::fine, models),
            Grain::Rough => self.errors_in(Track::coarse, models),
        };
        let whitened = |(errors, model): (Option<_>, &Explained)| {
            let finer = || match grain {
                Grain::Fine => None,
                Grain::Rough => self.errors(model),
            };
            self.whitened(errors.or_else(finer)?, model)
        };
        errors.into_par_iter().zip(models).map(whitened).collect()
    }

    fn whitened(&self, errors: Vec<Vec<Pair>>, model: &Explained) -> Option<Vec<f64>> {
        let mut all = Vec::new();
        for error in errors {
            self.whitening.apply(&error, &mut all);
        }
        if let Some(prior) = self.prior {
            let c = DVector::from_vec(model.base.coordinates());
            all.extend((&prior.weight * (c - &prior.mean)).iter());
        }
        all.iter().all(|r| r.is_finite()).then_some(all)
    }

    /// What the fit minimises: `N ln(S / N)` of the whitened errors with their sum of squares S, `S - N` below N, and the
    /// departure from the prior, see [`Prior::firm`]. As long as the errors are not noise, they do not outweigh what is known
    /// of the machine.
    pub(crate) fn objective(&self, residual: &[f64]) -> f64 {
        let (errors, known) = self.split(residual);
        let (n, s) = (errors.len() as f64, squares(errors));
        let (rows, departure) = (known.len().max(1) as f64, squares(known));
        let known = if self.firm() {
            departure
        } else {
            rows * (departure / rows).ln_1p()
        };
        known + if s > n { n * (s / n).ln() } else { s - n }
    }

    /// Sum of squares of the whitened errors over its expectation, at least one.
    fn excess(&self, residual: &[f64]) -> f64 {
        let (errors, _) = self.split(residual);
        (squares(errors) / errors.len() as f64).max(1.0)
    }

    /// Factor of the rows of the prior with which the squares of all rows have the gradient of the objective, up to its own
    /// factor.
    fn scale(&self, residual: &[f64]) -> f64 {
        let (_, known) = self.split(residual);
        let left = squares(known) / known.len().max(1) as f64;
        let doubt = if self.firm() { 1.0 } else { 1.0 + left };
        (self.excess(residual) / doubt).sqrt()
    }

    fn split<'a>(&self, residual: &'a [f64]) -> (&'a [f64], &'a [f64]) {
        residual.split_at(residual.len() - self.known())
    }

    /// Weighs the rows of the prior against the errors.
    pub(crate) fn weigh(&self, rows: &mut [f64], scale: f64) {
        let known = rows.len() - self.known();
        rows[known..].iter_mut().for_each(|r| *r *= scale);
    }

    pub(crate) fn weigh_columns(&self, matrix: &mut DMatrix<f64>, scale: f64) {
        let (rows, known) = (matrix.nrows(), self.known());
        let mut prior = matrix.rows_mut(rows - known, known);
        prior *= scale;
    }

    /// By how much the coordinates of a fit to these records would move if its residual were this one.
    pub(crate) fn moved(&self, fit: &Fitted, residual: &[f64]) -> Vec<f64> {
        // The model is the same, and so is what departs from the prior.
        let ((there, _), (here, _)) = (self.split(residual), self.split(&fit.residual));
        let change = DVector::from_iterator(here.len(), there.iter().zip(here).map(|(a, b)| a - b));
        parts::moved_by(&fit.factor, &fit.jacobian.rows(0, here.len()).tr_mul(&change))
    }

    /// Standard deviations of the coordinates of a fit to these records, see [`parts::deviations_without_parts`].
    pub(crate) fn deviations_without_parts(&self, fit: &Fitted) -> Vec<f64> {
        parts::deviations_without_parts(&fit.factor, &self.parts(fit))
    }

    /// What the parts of every record say, in their order.
    fn parts(&self, fit: &Fitted) -> Vec<Vec<Part>> {
        let (jacobian, residual) = (&fit.jacobian, &fit.residual);
        let mut first = 0;
        let mut of = |track: &Track| -> Vec<Part> {
            let bound = |b: usize| first + b * track.samples / PARTS;
            let rows = (0..PARTS).map(|b| bound(b)..bound(b + 1));
            let all = rows.map(|rows| Part::of(jacobian, residual, rows)).collect();
            first += track.samples;
            all
        };
        let mut all: Vec<Vec<Part>> = Vec::new();
        for track in self.tracks {
            // The outputs of a record have the same parts.
            let outputs: Vec<Vec<Part>> = (0..self.whitening.channels()).map(|_| of(track)).collect();
            let together = |mut a: Vec<Part>, b: Vec<Part>| {
                a.iter_mut().zip(b).for_each(|(a, b)| a.join(&b));
                a
            };
            all.extend(outputs.into_iter().reduce(together));
        }
        all
    }

    fn firm(&self) -> bool {
        self.prior.is_some_and(|p| p.firm)
    }

    fn known(&self) -> usize {
        self.prior.map_or(0, |p| p.weight.nrows())
    }

    /// Columns of the Jacobian for some coordinates, by forward differences whose steps change the residual by a small
    /// part of its noise. `residual` is that of the model, [rough](Self::rough) or not; so are then the differences.
    pub(crate) fn columns(
        &self,
        model: &Explained,
        (grain, residual): (Grain, &[f64]),
        which: std::ops::Range<usize>,
        steps: &mut Vec<f64>,
    ) -> Option<DMatrix<f64>> {
        let at = model.coordinates();
        if steps.len() < at.len() {
            steps.resize(at.len(), 0.0);
        }
        let bounded = model.bounded();
        let mut sought: Vec<Difference> = which
            .clone()
            .map(|j| {
                let step = if steps[j] == 0.0 {
                    first_step(model, j, at[j])
                } else {
                    steps[j]
                };
                Difference::new(j, step, at[j] == 0.0, bounded[j])
            })
            .collect();
        loop {
            let mut open: Vec<&mut Difference> = sought.iter_mut().filter(|d| !d.is_done).collect();
            if open.is_empty() {
                break;
            }
            let there = open.iter().map(|d| {
                let mut there = at.clone();
                there[d.coordinate] += d.step;
                model.with(&there)
            });
            let moved = self.residuals(grain, &there.collect::<Vec<_>>());
            let each = open.par_iter_mut().zip(moved);
            each.for_each(|(d, moved)| d.look(moved.as_deref(), residual));
        }
        let found: Option<Vec<_>> = sought.into_iter().map(|d| d.best).collect();
        let found = found?;
        let mut matrix = DMatrix::zeros(residual.len(), found.len());
        for (j, (h, column)) in found.into_iter().enumerate() {
            steps[which.start + j] = h;
            matrix.column_mut(j).copy_from_slice(&column);
        }
        Some(matrix)
    }
}

/// A column of the Jacobian on its way.
struct Difference {
    coordinate: usize,
    step: f64,
    /// Of a logarithm a longer step than a factor of e is no derivative: a speed that creeps, made so large that friction is gone, would
    /// look like the friction.
    longest: f64,
    is_from_nothing: bool,
    /// Steps that had a residual, and those that had none.
    sizes: usize,
    shrunk: usize,
    best: Option<(f64, Vec<f64>)>,
    is_done: bool,
}

impl Difference {
    fn new(coordinate: usize, step: f64, is_from_nothing: bool, is_logarithm: bool) -> Self {
        Self {
            coordinate,
            step,
            longest: if is_logarithm { 1.0 } else { f64::INFINITY },
            is_from_nothing,
            sizes: 0,
            shrunk: 0,
            best: None,
            is_done: false,
        }
    }

    /// Takes the residual after the step, and another step where that is too long or too short.
    fn look(&mut self, moved: Option<&[f64]>, residual: &[f64]) {
        const SIZES: usize = 8;
        const SHRUNK: usize = 24;
        let h = self.step;
        match moved {
            // From nothing, in any unit, the way down may be long.
            None => {
                self.step *= if self.is_from_nothing { 1e-3 } else { 0.01 };
                self.shrunk += 1;
            }
            Some(moved) => {
                self.sizes += 1;
                let column: Vec<f64> = moved.iter().zip(residual).map(|(a, b)| (a - b) / h).collect();
                let size = h * (column.iter().map(|c| c * c).sum::<f64>() / column.len() as f64).sqrt();
                self.best = Some((h, column));
                // What starts from nothing is nearly linear.
                let most = if self.is_from_nothing { 1e3 } else { 10.0 };
                let change = (STEP / size.max(1e-12)).clamp(1e-6, 1e6);
                self.is_done =
                    size > 0.01 * STEP && size < most * STEP || size < STEP && h.abs() >= self.longest;
                self.step = (h * change).clamp(-self.longest, self.longest);
            }
        }
        self.is_done |= self.sizes == SIZES || self.shrunk == SHRUNK;
    }
}

/// A small part of a coordinate: logarithms have no unit, the others their own. Of one that is nothing, no unit is known; the
/// step grows until it shows.
fn first_step(model: &Explained, j: usize, at: f64) -> f64 {
    const PART: f64 = 1e-4;
    match model.bounded().get(j) {
        Some(true) => PART,
        _ if at != 0.0 => PART * at.abs(),
        _ => 1e-6,
    }
}
