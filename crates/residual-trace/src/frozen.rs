//! The xy-table from its frequency responses: parameters, and how well they are known.

mod scan;

use crate::TraceError;
use crate::base::{Base, XyTable, table_from_geometry};
use crate::fit::{Prior, squares, triangle};
use experiment_data::Geometry;
use lpv_core::{Continuous, Discrete, Frf, FrfEstimate, StateSpace};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use scan::scan;
use std::f64::consts::TAU;

/// The table that fits the responses best.
#[derive(Debug, Clone)]
pub struct FrozenFit {
    /// The machine.
    pub base: Base,
    /// What the responses tell of its coordinates, for the fit along moves.
    pub prior: Prior,
    /// Sum of squares of the residual in units of the noise, over its expectation: 1 where nothing but noise is left.
    pub misfit: f64,
    /// Standard deviations of the coordinates.
    pub deviations: Vec<f64>,
    /// Where `base` takes the masses of the geometry for true, the fit that does not, with the number of those masses.
    pub free: Option<(Base, Prior, usize)>,
}

/// Shares of the inertia that the carriage may have at the start.
const SHARES: [f64; 4] = [0.08, 0.2, 0.4, 0.6];

/// Relative errors that join the noise, one stage after the other: far from the resonances only a rough fit has a way.
const FLOORS: [f64; 4] = [0.5, 0.1, 0.01, 1e-6];

/// Fits masses, couplings and lever arm of an xy-table to responses at several positions.
///
/// `modes_hz` are guesses of frequencies of modes, cycles per unit of time; all pairs are tried, and a scan of the whole band.
///
/// # Errors
/// [`TraceError::NoBase`] without a geometry of a table.
pub fn fit_table(
    geometry: &Geometry,
    estimates: &[FrfEstimate],
    clock: Discrete,
    modes_hz: &[f64],
) -> Result<FrozenFit, TraceError> {
    let told = Told {
        values: Told::of(&Base::XyTable(table_from_geometry(geometry, [1.0, 1.0], 0.02)?)),
        deviation: 0.03,
    };
    let few: Vec<FrfEstimate> = estimates
        .iter()
        .map(|e| {
            let every = e.frf().len().div_ceil(120).max(1);
            e.select(|k, _| k % every == 0)
        })
        .collect();
    let mut starts = scan(geometry, &few, clock)?;
    for &one in modes_hz {
        for &other in modes_hz.iter().filter(|other| **other != one) {
            let table = table_from_geometry(geometry, [one, other], 0.02)?;
            starts.extend(SHARES.map(|share| table.with_carriage_share(share)));
        }
    }
    let best = |starts: &[XyTable], few: &[FrfEstimate], told: &Told| {
        starts
            .par_iter()
            .filter_map(|start| {
                let rough = fit(&Base::XyTable(start.clone()), few, clock, FLOORS[0], 12, told)?;
                fit(&rough.0, few, clock, FLOORS[1], 12, told)
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let none = TraceError::NoBase {
        why: "no start of the first-principles xy-table has a finite error against the responses",
    };
    let mut base = best(&starts, &few, &told).ok_or(none)?.0;
    let mut found = None;
    let mut distorted = false;
    for floor in FLOORS {
        let Some(next) = fit(&base, estimates, clock, floor, 20, &told) else {
            continue;
        };
        // Distortion is no noise.
        if floor < FLOORS[1] && next.1 > DISTORTED * next.3 as f64 {
            distorted = true;
            break;
        }
        base = next.0.clone();
        found = Some(next);
    }
    if distorted {
        let told = Told {
            deviation: 1e-5,
            ..told
        };
        // Friction and the like distort most where the machine is slow.
        let lowest = base_modes(&base);
        let upper: Vec<FrfEstimate> = few.iter().map(|e| e.select(|_, f| f > 0.6 * lowest)).collect();
        if let Some((base, cost, _, rows)) = best(&starts, &upper, &told) {
            return Ok(FrozenFit::distorted(base, cost / rows as f64));
        }
    }
    let found = found.ok_or(TraceError::NoBase {
        why: "the fit of the first-principles xy-table to the responses found no finite error",
    })?;
    // The masses that the geometry tells may be those of the machine, and what departs from them an effect that was there when
    // the responses were measured: which of the two, the moves decide.
    let exact = Told {
        deviation: EXACT,
        ..told
    };
    let strict = fit(&exact.put(&found.0), estimates, clock, FLOORS[3], 20, &exact);
    let free = FrozenFit::new(found, 10.0);
    let Some(strict) = strict else {
        return Ok(free);
    };
    // Of the responses alone; what the geometry tells is kept apart.
    let silent = Told {
        deviation: 1.0 / EXACT,
        ..told
    };
    let n = strict.2.ncols();
    let factor = residual(&strict.0, estimates, clock, FLOORS[3], &silent)
        .and_then(|error| curvature(&strict.0, &error, estimates, clock, FLOORS[3], &silent))
        .map_or(strict.2.clone(), |r| r.view((0, 0), (n, n)).into_owned());
    let mut fit = FrozenFit::new((strict.0, strict.1, factor, strict.3), 100.0);
    fit.prior.hold(&exact, &fit.base);
    fit.free = Some((free.base, free.prior, TOLD));
    Ok(fit)
}

/// Masses that the geometry tells.
const TOLD: usize = 4;

/// Relative deviation of what is taken for true.
const EXACT: f64 = 1e-8;

/// Lowest frequency of the uncoupled modes.
fn base_modes(base: &Base) -> f64 {
    let v: Vec<f64> = base.parameters().iter().map(|p| p.value).collect();
    let reduced = |a: f64, b: f64| a * b / (a + b);
    let modes = [v[4] / reduced(v[0], v[2]), v[5] / reduced(v[1], v[3])];
    modes[0].min(modes[1]).sqrt() / TAU
}

fn response(table: &XyTable, p: f64, lines: &[f64], clock: Discrete) -> Option<Frf> {
    let [a, b, c] = table.frozen(p);
    let direct = DMatrix::zeros(c.nrows(), b.ncols());
    let system = StateSpace::new(a, b, c, direct, Continuous).ok()?;
    system.zero_order_hold(clock).ok()?.frequency_response(lines).ok()
}

/// Weighted residual of all lines, real and imaginary parts; one where nothing but noise is left.
fn residual(
    base: &Base,
    estimates: &[FrfEstimate],
    clock: Discrete,
    floor: f64,
    told: &Told,
) -> Option<Vec<f64>> {
    let Base::XyTable(table) = base else { return None };
    let parts: Option<Vec<Vec<f64>>> = estimates
        .par_iter()
        .map(|e| {
            let lines = e.frf().frequencies_hz();
            let model = response(table, e.position().unwrap_or(0.0), lines, clock)?;
            let mut out = Vec::with_capacity(8 * lines.len());
            for k in 0..lines.len() {
                let (measured, model) = (e.frf().line(k), model.line(k));
                let size = measured.norm();
                for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let deviation = (0.5 * e.variance(k, i, j)).sqrt().hypot(floor * size);
                    let error = (measured[(i, j)] - model[(i, j)]) / deviation;
                    out.extend([error.re, error.im]);
                }
            }
            Some(out)
        })
        .collect();
    let mut all = parts?.concat();
    all.extend(told.departure(base));
    all.iter().all(|r| r.is_finite()).then_some(all)
}

/// Misfit beyond which a relative error was too small.
const DISTORTED: f64 = 4.0;

/// What the geometry says: masses of carriage and beam, sum of the inertias, lever arm; and how well.
#[derive(Clone, Copy)]
struct Told {
    values: [f64; 4],
    deviation: f64,
}

impl Told {
    fn of(base: &Base) -> [f64; 4] {
        let v: Vec<f64> = base.parameters().iter().map(|p| p.value).collect();
        [v[0], v[2], v[1] + v[3], v[8]]
    }

    /// The machine with these masses, and the same share of the inertia on the carriage.
    fn put(&self, base: &Base) -> Base {
        let mut v: Vec<f64> = base.parameters().iter().map(|p| p.value).collect();
        let share = v[1] / (v[1] + v[3]);
        let [carriage, beam, inertia, lever] = self.values;
        (v[0], v[2], v[8]) = (carriage, beam, lever);
        (v[1], v[3]) = (share * inertia, (1.0 - share) * inertia);
        base.with_coordinates(&v.iter().map(|v| v.ln()).collect::<Vec<_>>())
    }

    /// Departure from it, in units of its deviation.
    fn departure(&self, base: &Base) -> [f64; 4] {
        let now = Self::of(base);
        std::array::from_fn(|i| (now[i] / self.values[i]).ln() / self.deviation)
    }
}

impl Prior {
    /// Takes what the geometry tells for certain.
    fn hold(&mut self, told: &Told, base: &Base) {
        const STEP: f64 = 1e-6;
        let (rows, at, still) = (self.weight.nrows(), base.coordinates(), told.departure(base));
        self.weight.resize_vertically_mut(rows + TOLD, 0.0);
        self.firm = TOLD;
        for j in 0..at.len() {
            let mut there = at.clone();
            there[j] += STEP;
            let moved = told.departure(&base.with_coordinates(&there));
            for i in 0..TOLD {
                self.weight[(rows + i, j)] = (moved[i] - still[i]) / STEP;
            }
        }
    }
}

impl FrozenFit {
    /// `doubt` divides the information of the responses: an effect that was there when they were measured has bent them.
    fn new((base, cost, factor, rows): Found, doubt: f64) -> Self {
        let misfit = cost / (rows as f64 - factor.ncols() as f64);
        // Where more than noise is left, what is left is no noise.
        let doubt = doubt * misfit.max(1.0);
        let weight = &factor / doubt.sqrt();
        let deviations = crate::fit::deviations(&weight);
        let prior = Prior {
            mean: DVector::from_vec(base.coordinates()),
            weight,
            firm: 0,
        };
        Self {
            base,
            prior,
            misfit,
            deviations,
            free: None,
        }
    }

    /// From responses that are distorted: the geometry tells the masses, the responses where the modes are, both roughly.
    fn distorted(base: Base, misfit: f64) -> Self {
        let deviations = vec![0.03, 0.2, 0.03, 0.1, 0.1, 0.1, 0.5, 0.5, 0.01];
        Self {
            prior: Prior {
                mean: DVector::from_vec(base.coordinates()),
                weight: DMatrix::from_diagonal(&DVector::from_vec(deviations.clone()).map(f64::recip)),
                firm: deviations.len(),
            },
            base,
            misfit,
            deviations,
            free: None,
        }
    }
}

type Found = (Base, f64, DMatrix<f64>, usize);

fn fit(
    start: &Base,
    estimates: &[FrfEstimate],
    clock: Discrete,
    floor: f64,
    iterations: usize,
    told: &Told,
) -> Option<Found> {
    let mut base = start.clone();
    let mut error = residual(&base, estimates, clock, floor, told)?;
    let mut cost = squares(&error);
    let mut damping = 1e-3;
    for iteration in 0.. {
        let at = base.coordinates();
        let r = curvature(&base, &error, estimates, clock, floor, told)?;
        let before = cost;
        let mut stuck = true;
        for _ in 0..8 {
            let step = crate::fit::damped(&r, at.len(), damping);
            let there: Vec<f64> = at
                .iter()
                .zip(step.iter())
                .map(|(a, b)| a + b.clamp(-1.0, 1.0))
                .collect();
            let next = base.with_coordinates(&there);
            if let Some(found) = residual(&next, estimates, clock, floor, told)
                && squares(&found) < cost
            {
                cost = squares(&found);
                (base, error) = (next, found);
                damping = f64::max(0.1 * damping, 1e-9);
                stuck = false;
                break;
            }
            damping *= 10.0;
        }
        if stuck || before - cost < 1e-5 * cost || iteration >= iterations {
            let n = at.len();
            return Some((base, cost, r.view((0, 0), (n, n)).into_owned(), error.len()));
        }
    }
    None
}

/// Triangular factor of `[J r]` at a machine, r its residual.
fn curvature(
    base: &Base,
    error: &[f64],
    estimates: &[FrfEstimate],
    clock: Discrete,
    floor: f64,
    told: &Told,
) -> Option<DMatrix<f64>> {
    const STEP: f64 = 1e-6;
    let at = base.coordinates();
    let mut jacobian = DMatrix::zeros(error.len(), at.len());
    for j in 0..at.len() {
        let mut there = at.clone();
        there[j] += STEP;
        let moved = residual(&base.with_coordinates(&there), estimates, clock, floor, told)?;
        let column: Vec<f64> = moved.iter().zip(error).map(|(a, b)| (a - b) / STEP).collect();
        jacobian.column_mut(j).copy_from_slice(&column);
    }
    Some(triangle(&jacobian, error))
}

impl XyTable {
    /// The same with this share of the inertia on the carriage, and the same mode of rotation.
    fn with_carriage_share(&self, share: f64) -> Self {
        let base = Base::XyTable(self.clone());
        let mut v: Vec<f64> = base.parameters().iter().map(|p| p.value).collect();
        let total = v[1] + v[3];
        let before = v[1] * v[3] / total;
        (v[1], v[3]) = (share * total, (1.0 - share) * total);
        let change = v[1] * v[3] / total / before;
        v[5] *= change;
        v[7] *= change;
        let logarithms: Vec<f64> = v.iter().map(|v| v.ln()).collect();
        match base.with_coordinates(&logarithms) {
            Base::XyTable(table) => table,
            Base::Axis(_) => self.clone(),
        }
    }
}
