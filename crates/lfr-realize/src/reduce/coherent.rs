//! Local models in one state basis, and the LFR of few deltas that is nearest to how they move with p.

use super::hankel::Expansion;
use super::select::{FactorAccount, FactorStart, Selection};
use super::settings::CheckedCoherentSettings;
use super::weights::Weights;
use crate::sampling::Sampling;
use crate::{
    Candidate, DeltaReach, FrozenData, GainFit, RandomChannels, RealizeError, RefineSettings, Refined,
    ResidualUnit, refine,
};
use lpv_core::{DeltaBlock, SchedulingRange, StateSpace};
use nalgebra::DMatrix;

/// An LFR from coherent local models, with the account of its making.
#[derive(Debug, Clone, PartialEq)]
pub struct Coherent<K: Sampling> {
    /// The model.
    pub refined: Refined<K>,
    /// Rms residual of the local model of each position, in the order of the data: what the deltas could reach at best.
    pub local_rms: Vec<f64>,
    /// One entry a start, in their order.
    pub starts: Vec<FactorAccount>,
    /// Index of the start that won.
    pub winner: usize,
    /// Whether the target was reached.
    pub reached: bool,
}

/// Fits an LFR with the given deltas to responses over the whole range, from local models at all positions.
///
/// `local` and `gamma` are the flexible part and the gain of the rigid body at the position nearest to the centre, as
/// [`crate::local_model`] gives them. From there each position begins at the model of the nearest one that is done, with
/// C held and steps that turn no basis, so that all share one state basis. (With fewer states than outputs C can be held
/// at all positions only if it does not depend on p.) A polynomial through their matrices, its
/// Hankel matrix weighted by what a change does to the relative response and cut to rank, gives the deltas. Polynomials of
/// several degrees are tried; random channels as those of [`crate::grow`] only if none of them reaches the target.
///
/// # Errors
/// [`RealizeError::Empty`] without deltas, [`RealizeError::Start`] if no start has a response at all positions, and those
/// of [`refine`]. A target that is not reached is a result.
pub fn coherent<K: Sampling>(
    local: &StateSpace<K>,
    gamma: Option<&DMatrix<f64>>,
    data: &FrozenData,
    deltas: &[DeltaBlock],
    scheduling: &SchedulingRange,
    settings: &CheckedCoherentSettings,
) -> Result<Coherent<K>, RealizeError> {
    if deltas.iter().all(|d| d.repetitions == 0) {
        return Err(RealizeError::Empty { what: "deltas" });
    }
    let set = settings.get();
    let models = LocalModels::new(local, gamma, set.reach, data, scheduling)?;
    let mut starts = models.starts(data, deltas, scheduling)?;
    for (_, candidate) in &mut starts {
        if set.reach == DeltaReach::Outputs {
            *candidate = candidate.clone().with_free_outputs()?;
        }
        if set.gain == GainFit::Free && gamma.is_some() {
            *candidate = candidate.clone().with_free_gain()?;
        }
    }
    let selection = Selection {
        lines: set.lines,
        iterations: set.start_iterations,
        target: settings.target(data.unit()),
        refine: settings.refine,
    };
    let (refined, starts, winner) = selection.best(starts, data, scheduling)?;
    Ok(Coherent {
        reached: refined.account.rms <= selection.target,
        refined,
        local_rms: models.rms,
        starts,
        winner,
    })
}

/// Starts from random channels, for when the polynomials lead to local minima.
const RANDOM: u64 = 4;

/// Degrees of the polynomials through the local models, in the order in which they are tried.
const DEGREES: [usize; 6] = [4, 2, 6, 3, 5, 1];

/// Rms residual at which a local fit is good enough to align the others by.
const LOCAL_TARGET: f64 = 1e-7;

/// Local models of all positions in one state basis.
///
/// C is that of the first model. From there each position begins at the model of the nearest one that is done, and is
/// fitted with steps that turn no basis, so that neighbours share theirs.
pub(crate) struct LocalModels<K: Sampling> {
    /// `[A B]` of the flexible states, with `[C D]` below if the deltas reach the outputs, in the order of the data.
    matrices: Vec<DMatrix<f64>>,
    /// Rms residual of each position.
    pub(crate) rms: Vec<f64>,
    local: StateSpace<K>,
    gamma: Option<DMatrix<f64>>,
    /// Rows of each matrix.
    rows: usize,
}

/// Lines of a position that a local fit uses, of exact responses and of noisy ones.
const LINES: [usize; 2] = [60, 400];

impl<K: Sampling> LocalModels<K> {
    /// `local` and `gamma` are the flexible part and the gain of the rigid body at the position nearest to the centre.
    pub(crate) fn new(
        local: &StateSpace<K>,
        gamma: Option<&DMatrix<f64>>,
        reach: DeltaReach,
        data: &FrozenData,
        scheduling: &SchedulingRange,
    ) -> Result<Self, RealizeError> {
        let deltas: Vec<Vec<f64>> = data.scheduling().map(|p| scheduling.normalise(p)).collect();
        let distance = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum::<f64>();
        let centre = vec![0.0; scheduling.parameters()];
        let mut order: Vec<usize> = (0..deltas.len()).collect();
        order.sort_by(|&i, &j| distance(&deltas[i], &centre).total_cmp(&distance(&deltas[j], &centre)));
        let settings = RefineSettings::new()
            .max_iterations(40)
            .tolerance(1e-3)
            .target(LOCAL_TARGET)
            .check()?;
        let thinned = data.thinned(LINES[usize::from(data.unit() == ResidualUnit::StandardDeviation)]);
        let mut all = Self {
            matrices: vec![DMatrix::zeros(0, 0); deltas.len()],
            rms: vec![f64::INFINITY; deltas.len()],
            local: local.clone(),
            gamma: gamma.cloned(),
            rows: match reach {
                DeltaReach::States => local.states(),
                DeltaReach::Outputs => local.states() + local.outputs(),
            },
        };
        for (done, &i) in order.iter().enumerate() {
            let nearest = order[..done]
                .iter()
                .min_by(|&&j, &&k| {
                    distance(&deltas[i], &deltas[j]).total_cmp(&distance(&deltas[i], &deltas[k]))
                })
                .copied();
            let start = match nearest {
                Some(j) => all.with_matrix(&all.matrices[j])?,
                None => local.clone(),
            };
            let candidate = all.candidate(&start, scheduling)?;
            let fitted = refine(&candidate, &thinned.at(i), &settings)?;
            let (rigid, nf) = (candidate.states() - local.states(), local.states());
            let m = fitted.candidate.matrix();
            all.matrices[i] = m
                .view((rigid, rigid), (all.rows, nf + local.inputs()))
                .into_owned();
            all.rms[i] = fitted.account.rms;
        }
        Ok(all)
    }

    /// A candidate without deltas and with fixed C.
    fn candidate(
        &self,
        local: &StateSpace<K>,
        scheduling: &SchedulingRange,
    ) -> Result<Candidate<K>, RealizeError> {
        let none = RandomChannels::default();
        let all = Candidate::flexible(local, self.gamma.as_ref(), &[], scheduling.clone(), none)?;
        let (n, nu, ny) = (all.states(), all.inputs(), all.outputs());
        let mut free = all.free().clone();
        free.rows_mut(n, ny).fill(false);
        free.view_mut((n, n), (ny, nu)).fill(self.rows > local.states());
        all.with_free(free)
    }

    fn with_matrix(&self, s: &DMatrix<f64>) -> Result<StateSpace<K>, RealizeError> {
        let (n, nu, ny) = (self.local.states(), self.local.inputs(), self.local.outputs());
        let (a, b) = (s.view((0, 0), (n, n)), s.view((0, n), (n, nu)));
        let (c, d) = if self.rows > n {
            (
                s.view((n, 0), (ny, n)).into_owned(),
                s.view((n, n), (ny, nu)).into_owned(),
            )
        } else {
            (self.local.c().clone(), self.local.d().clone())
        };
        Ok(StateSpace::new(
            a.into_owned(),
            b.into_owned(),
            c,
            d,
            self.local.clock(),
        )?)
    }

    /// The LFR with these deltas whose frozen matrices are nearest to that of the local models, in the weights of their
    /// responses: a polynomial of this degree through them, the Hankel matrix of its coefficients cut to rank.
    fn factorised(
        &self,
        data: &FrozenData,
        deltas: &[DeltaBlock],
        scheduling: &SchedulingRange,
        degree: usize,
    ) -> Result<Candidate<K>, RealizeError> {
        let (nf, nu) = (self.local.states(), self.local.inputs());
        let places: Vec<Vec<f64>> = data.scheduling().map(|p| scheduling.normalise(p)).collect();
        let mut weights = Weights::new(self.local.states(), self.local.inputs(), self.rows);
        for (ab, frf) in self.matrices.iter().zip(data.responses()) {
            weights.add(&self.with_matrix(ab)?, frf);
        }
        let expansion = Expansion::new(&places, &self.matrices, degree)?;
        // D at the centre stays as given: a refinement does not move it.
        let mut constant = expansion.constant().clone();
        if self.rows > nf {
            constant
                .view_mut((nf, nf), self.local.d().shape())
                .copy_from(self.local.d());
        }
        let centre = self.with_matrix(&constant)?;
        let random = RandomChannels { seed: 0, size: 1e-3 };
        let whole = Candidate::flexible(&centre, self.gamma.as_ref(), deltas, scheduling.clone(), random)?;
        let channels = expansion.channels(&weights, whole.channels())?;
        let n = whole.states();
        let (rigid, first_w, first_z) = (n - nf, n + nu, n + whole.outputs());
        let mut m = whole.matrix().clone();
        for (j, found) in channels.found.iter().enumerate() {
            if *found {
                m.view_mut((rigid, first_w + j), (self.rows, 1))
                    .copy_from(&channels.left.column(j));
                m.view_mut((first_z + j, rigid), (1, nf + nu))
                    .copy_from(&channels.right.row(j));
            }
        }
        m.view_mut((first_z, first_w), channels.inner.shape())
            .copy_from(&channels.inner);
        Ok(whole.with_matrix(m))
    }

    /// One candidate for each degree that the positions determine, then random ones.
    pub(crate) fn starts(
        &self,
        data: &FrozenData,
        deltas: &[DeltaBlock],
        scheduling: &SchedulingRange,
    ) -> Result<Vec<(FactorStart, Candidate<K>)>, RealizeError> {
        let most = Expansion::largest_degree(scheduling.parameters(), data.len());
        let mut starts = Vec::new();
        for degree in DEGREES.into_iter().filter(|d| *d <= most.max(1)) {
            let candidate = self.factorised(data, deltas, scheduling, degree)?;
            starts.push((FactorStart::Coherent { degree }, candidate));
        }
        for seed in 0..RANDOM {
            let random = RandomChannels { seed, size: 1e-3 };
            let gamma = self.gamma.as_ref();
            let candidate = Candidate::flexible(&self.local, gamma, deltas, scheduling.clone(), random)?;
            starts.push((FactorStart::Random { seed }, candidate));
        }
        Ok(starts)
    }
}
