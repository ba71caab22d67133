//! A candidate from a local model: exact rigid body, flexible part, small random channels.

use crate::sampling::Sampling;
use crate::{Candidate, Channel, FitError};
use lpv_core::linalg::dimension;
use lpv_core::{CoreError, DeltaBlock, LfrBlocks, SchedulingRange, StateSpace};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Random channels: from which seed, and how large.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomChannels {
    /// Same seed, same channels.
    pub seed: u64,
    /// Size of B1 relative to A: how far the start lets a delta of one move the model.
    pub size: f64,
}

impl Default for RandomChannels {
    fn default() -> Self {
        Self { seed: 0, size: 0.02 }
    }
}

/// What a model has for a rigid body, beside modes.
///
/// Its positions are exact integrals of its speeds in every kind, whatever the numbers are: `n_y` coordinates q with `y = q + ...`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Rigid<'a> {
    /// Nothing.
    #[default]
    Absent,
    /// `dv/dt = gamma u` with this gain (`n_y x n_u`), the same at every p and beside the local model.
    Gain(&'a DMatrix<f64>),
    /// `dv/dt = Gamma(p) u`: the local model begins with the `n_y` positions q and the `n_y` speeds v.
    Varying,
    /// `dv/dt = -R(p) v + Gamma(p) u + ...`: the same with friction to ground.
    Friction,
}

impl<'a> From<Option<&'a DMatrix<f64>>> for Rigid<'a> {
    fn from(gamma: Option<&'a DMatrix<f64>>) -> Self {
        gamma.map_or(Self::Absent, Self::Gain)
    }
}

impl<'a> Rigid<'a> {
    /// The gain of a rigid body beside the local model.
    pub(crate) fn gain(self) -> Option<&'a DMatrix<f64>> {
        match self {
            Self::Gain(gamma) => Some(gamma),
            Self::Absent | Self::Varying | Self::Friction => None,
        }
    }

    /// What of it the local model holds.
    pub(crate) fn within(self) -> Self {
        match self {
            Self::Gain(_) => Self::Absent,
            other => other,
        }
    }

    /// Whether an entry of `[A B; C D]` of a local model, widened by the channels, is held: the integrals always, and without
    /// friction all that would move the speeds beside the inputs.
    fn holds(self, (i, j): (usize, usize), axes: usize, states: usize) -> bool {
        match self {
            Self::Absent | Self::Gain(_) => false,
            Self::Friction => i < axes || j < axes,
            Self::Varying => i < axes || j < 2 * axes || (i < 2 * axes && j < states),
        }
    }
}

impl<K: Sampling> Candidate<K> {
    /// `F = gamma phi + (local model)` at the centre of the range, with small random channels for the deltas.
    ///
    /// `gamma` (`n_y x n_u`) is the gain of the rigid body: double integrators from each input to each output. Their
    /// `2 n_y` states come first, with `gamma` in rows `n_y` to `2 n_y` of B2. Their entries are fixed and the deltas do
    /// not touch them, so that they stay exact; [`Candidate::with_free_gain`] frees the gain. A rigid body that depends on p, or has
    /// friction, is part of the local model ([`Rigid`]): there only the integrals are fixed.
    ///
    /// All entries of the flexible part are free but D22 and D21: the outputs see states only, so that C does not depend
    /// on p and no response has a direct term, as that of a plant behind a hold; [`Candidate::with_free_outputs`] frees
    /// D21. The scale of the channels follows that of the model, whatever its units.
    ///
    /// # Errors
    /// [`FitError::Core`]: sizes that do not fit, a delta of a parameter that the range does not have.
    /// [`FitError::Setting`]: a size that is negative or not finite.
    pub fn flexible<'a>(
        local: &StateSpace<K>,
        rigid: impl Into<Rigid<'a>>,
        deltas: &[DeltaBlock],
        range: SchedulingRange,
        random: RandomChannels,
    ) -> Result<Self, FitError> {
        let good = random.size.is_finite() && random.size >= 0.0;
        FitError::unless(good, "size", random.size, "give a finite number, not negative")?;
        let rigid = rigid.into();
        let gamma = rigid.gain();
        let (nf, nu, ny) = (local.states(), local.inputs(), local.outputs());
        if gamma.is_none() && rigid != Rigid::Absent && nf < 2 * ny {
            return Err(CoreError::Dimension {
                what: "rigid body within the local model: states, at least",
                expected: 2 * ny,
                found: nf,
            }
            .into());
        }
        let axes = gamma.map_or(0, |_| ny);
        if let Some(gamma) = gamma {
            dimension("rigid body: rows of its gain", ny, gamma.nrows())?;
            dimension("rigid body: columns of its gain", nu, gamma.ncols())?;
        }
        let (rigid_a, rigid_c) = local.clock().double_integrators(axes);
        let nr = rigid_a.nrows();
        let n = nr + nf;
        let channels: Vec<Channel> = deltas
            .iter()
            .flat_map(|d| std::iter::repeat_n(Channel::Parameter(d.parameter), d.repetitions))
            .collect();
        let nc = channels.len();

        let mut a = DMatrix::zeros(n, n);
        a.view_mut((0, 0), (nr, nr)).copy_from(&rigid_a);
        a.view_mut((nr, nr), (nf, nf)).copy_from(local.a());
        let mut b2 = DMatrix::zeros(n, nu);
        if let Some(gamma) = gamma {
            b2.rows_mut(ny, ny).copy_from(gamma);
        }
        b2.rows_mut(nr, nf).copy_from(local.b());
        let mut c2 = DMatrix::zeros(ny, n);
        c2.columns_mut(0, nr).copy_from(&rigid_c.resize(ny, nr, 0.0));
        c2.columns_mut(nr, nf).copy_from(local.c());

        let mut rng = ChaCha8Rng::seed_from_u64(random.seed);
        let mut normal = |rows: usize, columns: usize| {
            DMatrix::from_fn(rows, columns, |_, _| {
                let value: f64 = StandardNormal.sample(&mut rng);
                value
            })
        };
        let mean = |m: &DMatrix<f64>| m.abs().sum() / m.len().max(1) as f64;
        let rate = local.clock().rate(local.a());
        let mut b1 = DMatrix::zeros(n, nc);
        b1.rows_mut(nr, nf)
            .copy_from(&(normal(nf, nc) * (random.size * rate)));
        let mut c1 = DMatrix::zeros(nc, n);
        c1.columns_mut(nr, nf).copy_from(&normal(nc, nf));
        let mut blocks = LfrBlocks {
            d21: DMatrix::zeros(ny, nc),
            d12: normal(nc, nu) * (mean(local.b()) / rate.max(f64::MIN_POSITIVE)),
            d11: normal(nc, nc) * 0.1,
            d22: local.d().clone(),
            a,
            b1,
            b2,
            c1,
            c2,
        };
        let is_free = |i: usize, j: usize| {
            let beside = i < nr || j < nr;
            let held = !beside && rigid.holds((i - nr, j - nr), ny, nf);
            // Outputs see states only.
            let direct = (n..n + ny).contains(&i) && j >= n;
            !beside && !held && !direct
        };
        let free = DMatrix::from_fn(n + ny + nc, n + nu + nc, is_free);
        // The channels touch nothing that is held.
        for (j, i) in (0..nc).flat_map(|j| (0..n).map(move |i| (j, i))) {
            if !free[(i, n + nu + j)] {
                blocks.b1[(i, j)] = 0.0;
            }
            if !free[(n + ny + j, i)] {
                blocks.c1[(j, i)] = 0.0;
            }
        }
        Self::new(&blocks, free, channels, range, local.clock())
    }

    /// The same candidate with the gain of the rigid body free where it is not zero. Only for one that
    /// [`Candidate::flexible`] made with a gain.
    ///
    /// # Errors
    /// [`FitError::Core`] if there are fewer than `2 n_y` states.
    pub fn with_free_gain(self) -> Result<Self, FitError> {
        let (n, nu, ny) = (self.states(), self.inputs(), self.outputs());
        if n < 2 * ny {
            return Err(CoreError::Dimension {
                what: "rigid body: states, at least",
                expected: 2 * ny,
                found: n,
            }
            .into());
        }
        let mut free = self.free().clone();
        for i in ny..2 * ny {
            for j in n..n + nu {
                free[(i, j)] = self.matrix()[(i, j)] != 0.0;
            }
        }
        self.with_free(free)
    }

    /// The same candidate with D21 free: the deltas reach the outputs directly, C and D depend on p. Fewer deltas may
    /// then do for the same frozen responses, at the price of a direct term that a plant behind a hold does not have.
    ///
    /// # Errors
    /// None beyond those of [`Candidate::with_free`].
    pub fn with_free_outputs(self) -> Result<Self, FitError> {
        let (n, nu, ny) = (self.states(), self.inputs(), self.outputs());
        let mut free = self.free().clone();
        let columns = free.ncols() - n - nu;
        free.view_mut((n, n + nu), (ny, columns)).fill(true);
        self.with_free(free)
    }
}
