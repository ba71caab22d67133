//! A start from data alone: rigid body and flexible modes at one position.

mod body;
mod residues;
mod settings;

use crate::data::Position;
use crate::sampling::Sampling;
use crate::{Candidate, FitError, FrozenData, RandomChannels, RefineAccount, RefineSettings, refine};
pub use body::{LocalBody, local_body};
use lpv_core::{SchedulingRange, StateSpace};
use nalgebra::DMatrix;
use num_complex::Complex;
pub(crate) use residues::{Beside, Residues};
pub use settings::{LocalSettings, RigidGain};

type C64 = Complex<f64>;

/// A model at one position: `F = gamma (T^2/2) (z + 1) / (z - 1)^2 + flexible`.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalModel<K: Sampling> {
    /// The flexible part, of rank one in each mode when the fit began.
    pub flexible: StateSpace<K>,
    /// Gain of the rigid body, `n_y x n_u`.
    pub gamma: Option<DMatrix<f64>>,
    /// The poles given, one of each pair, in their order.
    pub modes: Vec<LocalMode>,
    /// How the last fit went.
    pub account: RefineAccount,
}

/// A pole and what it does to the response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalMode {
    /// The sampled pole, with its conjugate if it is complex.
    pub pole: C64,
    /// Rms over the lines of its share of the response, relative to the response.
    pub share: f64,
    /// Second over first singular value of its residue: small for a single mode.
    pub second_rank: f64,
    /// Whether it was kept.
    pub kept: bool,
}

/// Residues of known poles by linear least squares, the strongest modes in modal form, then a fit of all their entries
/// and of the gain of the rigid body.
///
/// `data`: one position. `poles`: values of z without those of the rigid body at `z = 1`; of a conjugate pair one is
/// enough.
///
/// # Errors
/// [`FitError::Data`] for several positions, [`FitError::Pole`], [`FitError::Empty`] without poles,
/// [`FitError::TooFewEquations`], and those of [`refine`].
pub fn local_model<K: Sampling>(
    clock: K,
    data: &FrozenData,
    poles: &[C64],
    settings: &LocalSettings,
) -> Result<LocalModel<K>, FitError> {
    settings.check()?;
    let frf = &only_position(data)?.frf;
    clock.agrees(data.clock())?;
    let set = settings;
    let sampled = upper_half(clock, poles, set.rigid)?;
    let beside = match set.rigid {
        RigidGain::Absent => Beside::Nothing,
        _ => Beside::Gain,
    };
    let all = Residues::new(clock, data, &sampled, beside)?;
    let mut modes: Vec<LocalMode> = (0..sampled.len()).map(|i| all.mode(i, frf)).collect();
    keep_strongest(&mut modes, set.states);
    let kept: Vec<C64> = modes.iter().filter(|m| m.kept).map(|m| m.pole).collect();
    let residues = if kept.len() == sampled.len() {
        all
    } else {
        Residues::new(clock, data, &kept, beside)?
    };
    let (flexible, gamma) = residues.realise(clock, data)?;
    let fit = |gamma: Option<&DMatrix<f64>>, diagonal: Diagonal| {
        Fit::new(clock, &flexible, gamma, diagonal, data, &settings.refine)
    };
    let fitted = match set.rigid {
        RigidGain::Absent => fit(None, Diagonal::All)?,
        RigidGain::Full => fit(Some(&gamma), Diagonal::All)?,
        RigidGain::Diagonal => fit(Some(&gamma), Diagonal::Only)?,
        RigidGain::Decide => {
            let full = fit(Some(&gamma), Diagonal::All)?;
            if gamma.is_square() && full.is_diagonal() {
                fit(Some(&gamma), Diagonal::Only)?
            } else {
                full
            }
        }
    };
    Ok(LocalModel {
        flexible: fitted.flexible,
        gamma: fitted.gamma,
        modes,
        account: fitted.account,
    })
}

/// The position of a local model.
fn only_position(data: &FrozenData) -> Result<&Position, FitError> {
    match data.positions() {
        [only] => Ok(only),
        several => Err(FitError::Data {
            index: 1,
            what: "positions of a local model",
            expected: 1,
            found: several.len(),
        }),
    }
}

/// A range about one position, which a candidate needs whatever it is.
pub(crate) fn around(p: &[f64]) -> Result<SchedulingRange, FitError> {
    let of = |p: &f64| [p - p.abs().max(1.0), p + p.abs().max(1.0)];
    Ok(SchedulingRange::new(p.iter().map(of).collect())?)
}

/// One pole of each pair, refused where the clock has no such pole.
fn upper_half<K: Sampling>(clock: K, poles: &[C64], rigid: RigidGain) -> Result<Vec<C64>, FitError> {
    let mut upper = Vec::new();
    for (index, &pole) in poles.iter().enumerate() {
        let refused = |problem| {
            Err(FitError::Pole {
                index,
                pole: pole.to_string(),
                problem,
            })
        };
        if !(pole.re.is_finite() && pole.im.is_finite()) {
            return refused("not a finite number");
        }
        if rigid != RigidGain::Absent && (pole - 1.0).norm() < 1e-9 {
            return refused("a pole of the rigid body; leave it out, or let the rigid body be absent");
        }
        if clock.nyquist_hz().is_infinite() && pole.im == 0.0 && pole.re <= 0.0 {
            return refused(
                "no continuous-time model has this sampled pole; use a discrete one, or leave it out",
            );
        }
        let twin = |others: &[C64], of: C64| others.iter().any(|other| (other - of).norm() <= 1e-9);
        if twin(&poles[..index], pole) {
            return refused("given twice; residues of equal poles cannot be told apart");
        }
        if pole.im >= 0.0 {
            upper.push(pole);
        } else if !twin(poles, pole.conj()) {
            upper.push(pole.conj());
        }
    }
    if upper.is_empty() {
        return Err(FitError::Empty { what: "poles" });
    }
    Ok(upper)
}

fn keep_strongest(modes: &mut [LocalMode], states: Option<usize>) {
    let mut order: Vec<usize> = (0..modes.len()).collect();
    order.sort_by(|&i, &j| modes[j].share.total_cmp(&modes[i].share).then(i.cmp(&j)));
    let mut left = states.unwrap_or(usize::MAX);
    for i in order {
        let size = if modes[i].pole.im > 0.0 { 2 } else { 1 };
        modes[i].kept = size <= left;
        if modes[i].kept {
            left -= size;
        }
    }
}

/// Which entries of the gain are free.
#[derive(Clone, Copy, PartialEq)]
enum Diagonal {
    Only,
    All,
}

/// The fit of a local model with its rigid body.
struct Fit<K: Sampling> {
    flexible: StateSpace<K>,
    gamma: Option<DMatrix<f64>>,
    /// Standard deviations of the gain.
    deviation: DMatrix<f64>,
    account: RefineAccount,
}

impl<K: Sampling> Fit<K> {
    fn new(
        clock: K,
        flexible: &StateSpace<K>,
        gamma: Option<&DMatrix<f64>>,
        diagonal: Diagonal,
        data: &FrozenData,
        settings: &RefineSettings,
    ) -> Result<Self, FitError> {
        let around = around(&data.positions()[0].p)?;
        let started = gamma.map(|gamma| match diagonal {
            Diagonal::All => gamma.clone(),
            Diagonal::Only => DMatrix::from_fn(gamma.nrows(), gamma.ncols(), |i, j| {
                if i == j { gamma[(i, j)] } else { 0.0 }
            }),
        });
        let random = RandomChannels::default();
        let mut candidate = Candidate::flexible(flexible, started.as_ref(), &[], around, random)?;
        if gamma.is_some() {
            candidate = candidate.with_free_gain()?;
        }
        let (ny, nu, n) = (candidate.outputs(), candidate.inputs(), candidate.states());
        let nr = gamma.map_or(0, |_| 2 * ny);
        let nf = n - nr;
        let fitted = refine(&candidate, data, settings)?;
        let mut deviation = DMatrix::zeros(ny, nu);
        for (row, (i, j)) in candidate.free_entries().into_iter().enumerate() {
            if i < nr {
                deviation[(i - ny, j - n)] = fitted.factor.row(row).norm();
            }
        }
        let m = fitted.candidate.matrix();
        let part = |at, size| m.view(at, size).into_owned();
        Ok(Self {
            flexible: StateSpace::new(
                part((nr, nr), (nf, nf)),
                part((nr, n), (nf, nu)),
                part((n, nr), (ny, nf)),
                DMatrix::zeros(ny, nu),
                clock,
            )?,
            gamma: gamma.map(|_| part((ny, n), (ny, nu))),
            deviation,
            account: fitted.account,
        })
    }

    /// Whether the gain's off-diagonal entries are zero as far as the data tell.
    fn is_diagonal(&self) -> bool {
        let Some(gamma) = &self.gamma else {
            return true;
        };
        let small = |i: usize, j: usize| {
            let size = gamma[(i, j)].abs();
            size <= 3.0 * self.deviation[(i, j)]
                || size.powi(2) <= 1e-12 * (gamma[(i, i)] * gamma[(j, j)]).abs()
        };
        (0..gamma.nrows()).all(|i| (0..gamma.ncols()).all(|j| i == j || small(i, j)))
    }
}
