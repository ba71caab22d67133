//! The xy-table from its frequency responses: parameters, and how well they are known.

mod scan;

use crate::TraceError;
use crate::base::{Base, XyTable, table_from_geometry};
use crate::fit::{Prior, minimum};
use lpv_core::{Continuous, Discrete, Frf, FrfEstimate, Geometry, StateSpace};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use scan::scan;

/// The table that fits the responses best.
#[derive(Debug, Clone)]
pub struct FrozenFit {
    /// The machine.
    pub base: Base,
    /// What the responses tell of its coordinates, for the fit along moves.
    pub prior: Prior,
    /// Sum of squares of the residual in units of the noise, over its expectation: 1 where nothing but noise is left.
    pub misfit: f64,
    /// Standard deviations of the coordinates, as the responses tell them.
    pub deviations: Vec<f64>,
    /// Where `base` holds the masses of the geometry, the fit that does not.
    pub free: Option<Box<Self>>,
}

/// Shares of the inertia that the carriage may have at the start.
const SHARES: [f64; 4] = [0.08, 0.2, 0.4, 0.6];

/// Relative errors that join the noise, one stage after the other: far from the resonances only a rough fit has a way.
const FLOORS: [f64; 4] = [0.5, 0.1, 0.01, 1e-6];

/// Fits masses, couplings and lever arm of an xy-table to responses at several positions.
///
/// `modes_hz` are guesses of frequencies of modes, Hz; all pairs are tried, and a scan of the whole band.
///
/// # Errors
/// [`TraceError::NoBase`] without a geometry of a table.
pub fn fit_table(
    geometry: &Geometry,
    estimates: &[FrfEstimate],
    clock: Discrete,
    modes_hz: &[f64],
) -> Result<FrozenFit, TraceError> {
    let found = fit_weighing(1.0, geometry, estimates, clock, modes_hz);
    let error = |f: &Result<FrozenFit, TraceError>| {
        let fit = f.as_ref().ok();
        fit.and_then(|f| missed(&f.base, estimates, clock))
            .unwrap_or(f64::INFINITY)
    };
    let times = weight(geometry, estimates, clock)?;
    if times == 1.0 || error(&found) <= FITS {
        return found;
    }
    let other = fit_weighing(times, geometry, estimates, clock, modes_hz);
    if error(&other) < error(&found) {
        other
    } else {
        found
    }
}

/// Part of the response that a table with the masses of the geometry may miss at most lines: friction bends the lowest ones.
const FITS: f64 = 0.1;

/// Part of the response that a table misses, the median of all lines.
fn missed(base: &Base, estimates: &[FrfEstimate], clock: Discrete) -> Option<f64> {
    let Base::XyTable(table) = base else { return None };
    let mut parts = Vec::new();
    for e in estimates {
        let lines = e.frf().frequencies_hz();
        let model = response(table, e.single_position().unwrap_or(0.0), lines, clock)?;
        parts.extend((0..lines.len()).map(|k| {
            let measured = e.frf().line(k);
            (measured - model.line(k)).norm() / measured.norm()
        }));
    }
    parts.sort_by(f64::total_cmp);
    parts.get(parts.len() / 2).copied().filter(|m| m.is_finite())
}

/// The fit with masses so many times those of the geometry.
fn fit_weighing(
    times: f64,
    geometry: &Geometry,
    estimates: &[FrfEstimate],
    clock: Discrete,
    modes_hz: &[f64],
) -> Result<FrozenFit, TraceError> {
    let make = |modes, damping| Ok(table_from_geometry(geometry, modes, damping)?.weighing(times));
    let geometrical: XyTable = make([1.0, 1.0], 0.02)?;
    let told = Told {
        values: Told::of(&Base::XyTable(geometrical.clone())),
        deviation: 0.03,
    };
    let few: Vec<FrfEstimate> = estimates
        .iter()
        .map(|e| {
            let every = e.frf().len().div_ceil(120).max(1);
            e.select(|k, _| k % every == 0)
        })
        .collect();
    let mut starts = scan(&make, &few, clock)?;
    for &one in modes_hz {
        for &other in modes_hz.iter().filter(|other| **other != one) {
            let table = make([one, other], 0.02)?;
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
        let lowest = match &base {
            Base::XyTable(table) => table.lowest_mode(),
            Base::Axis(_) | Base::Lpv(_) => 0.0,
        };
        let upper: Vec<FrfEstimate> = few.iter().map(|e| e.select(|_, f| f > 0.6 * lowest)).collect();
        if let Some((base, cost, _, rows)) = best(&starts, &upper, &told) {
            let misfit = cost / rows as f64;
            let free = FrozenFit::distorted(base.clone(), misfit);
            return Ok(match &base {
                Base::XyTable(table) => FrozenFit {
                    free: Some(Box::new(free)),
                    ..FrozenFit::distorted(Base::XyTable(table.holding(&geometrical)), misfit)
                },
                Base::Axis(_) | Base::Lpv(_) => free,
            });
        }
    }
    let found = found.ok_or(TraceError::NoBase {
        why: "the fit of the first-principles xy-table to the responses found no finite error",
    })?;
    // The masses that the geometry tells may be those of the machine, and what departs from them an effect that was there when
    // the responses were measured: which of the two, the moves decide.
    let Base::XyTable(table) = &found.0 else {
        return Ok(FrozenFit::new(found, 10.0));
    };
    let held = Base::XyTable(table.holding(&geometrical));
    let strict = fit(&held, estimates, clock, FLOORS[3], 20, &told);
    let free = FrozenFit::new(found, 10.0);
    Ok(match strict {
        None => free,
        Some(strict) => FrozenFit {
            free: Some(Box::new(free)),
            ..FrozenFit::new(strict, 1e4)
        },
    })
}

/// Masses over those of the geometry, by the gain at the lowest lines: a geometry tells the masses in the unit of the inputs, and
/// these may be logged in another. One where they agree.
fn weight(geometry: &Geometry, estimates: &[FrfEstimate], clock: Discrete) -> Result<f64, TraceError> {
    /// Lines at which the machine is rigid.
    const LINES: usize = 3;
    /// A factor that masses may have.
    const ALIKE: f64 = 2.0;
    let mut ratios = Vec::new();
    for e in estimates {
        let lines = e.frf().frequencies_hz();
        let Some(highest) = lines.last() else { continue };
        let stiff = table_from_geometry(geometry, [3.0 * highest; 2], 0.02)?;
        let low = &lines[..LINES.min(lines.len())];
        let Some(model) = response(&stiff, e.single_position().unwrap_or(0.0), low, clock) else {
            continue;
        };
        ratios.extend((0..low.len()).map(|k| model.line(k).norm() / e.frf().line(k).norm()));
    }
    ratios.retain(|r| r.is_finite() && *r > 0.0);
    ratios.sort_by(f64::total_cmp);
    let middle = ratios.get(ratios.len() / 2).copied().unwrap_or(1.0);
    let agrees = middle < ALIKE && middle > 1.0 / ALIKE;
    Ok(if agrees { 1.0 } else { middle })
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
            let model = response(table, e.single_position().unwrap_or(0.0), lines, clock)?;
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
    values: [f64; XyTable::TOLD],
    deviation: f64,
}

impl Told {
    fn of(base: &Base) -> [f64; XyTable::TOLD] {
        let parameters = base.parameters();
        std::array::from_fn(|i| parameters[i].value)
    }

    /// Departure from it, in units of its deviation.
    fn departure(&self, base: &Base) -> [f64; XyTable::TOLD] {
        let now = Self::of(base);
        std::array::from_fn(|i| (now[i] / self.values[i]).ln() / self.deviation)
    }
}

impl FrozenFit {
    /// Standard deviations of the parameters of the base; infinite where they are held.
    pub fn parameter_deviations(&self) -> Vec<f64> {
        let mut deviations = self.deviations.iter();
        let parameters = self.base.parameters().into_iter();
        parameters
            .map(|p| match (p.held, p.positive) {
                (true, _) => f64::INFINITY,
                (false, positive) => {
                    let scale = if positive { p.value } else { 1.0 };
                    deviations.next().map_or(f64::INFINITY, |d| d * scale)
                }
            })
            .collect()
    }

    /// `doubt` divides the information of the responses: an effect that was there when they were measured has bent them.
    fn new((base, cost, factor, rows): Found, doubt: f64) -> Self {
        let misfit = cost / (rows as f64 - factor.ncols() as f64);
        // Where more than noise is left, what is left is no noise.
        let told = &factor / misfit.max(1.0).sqrt();
        let deviations = crate::fit::deviations(&told);
        let weight = told / doubt.sqrt();
        let prior = Prior {
            mean: DVector::from_vec(base.coordinates()),
            weight,
            firm: false,
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
        const ALL: [f64; 9] = [0.03, 0.03, 0.1, 0.01, 0.2, 0.1, 0.1, 0.5, 0.5];
        let held = base.parameters().into_iter().map(|p| p.held);
        let deviations: Vec<f64> = ALL
            .into_iter()
            .zip(held)
            .filter_map(|(d, held)| (!held).then_some(d))
            .collect();
        Self {
            prior: Prior {
                mean: DVector::from_vec(base.coordinates()),
                weight: DMatrix::from_diagonal(&DVector::from_vec(deviations.clone()).map(f64::recip)),
                firm: true,
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
    let logarithms: Vec<bool> = start.fitted().map(|p| p.positive).collect();
    let found = minimum(start.coordinates(), &logarithms, iterations, |c| {
        residual(&start.with_coordinates(c), estimates, clock, floor, told)
    })?;
    Some((
        start.with_coordinates(&found.at),
        found.cost,
        found.factor,
        found.rows,
    ))
}
