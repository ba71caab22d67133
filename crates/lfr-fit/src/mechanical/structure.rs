//! Which entries of M a mechanical structure joins, and random deltas for it.

use super::DeltaSplit;
use crate::{Candidate, Channel, FitError, RandomChannels};
use lpv_core::{Continuous, LfrBlocks};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

impl Candidate<Continuous> {
    /// The same mechanical structure with other, small and random deltas: at the centre of the range nothing changes.
    pub(crate) fn with_mechanical_deltas(
        &self,
        split: DeltaSplit,
        scales: &[f64],
        random: RandomChannels,
    ) -> Result<Self, FitError> {
        let good = random.size.is_finite() && random.size >= 0.0;
        FitError::unless(good, "size", random.size, "give a finite number, not negative")?;
        let nd = self.channels().iter().filter(|c| **c == Channel::Direct).count();
        let (n, nu, ny) = (self.states(), self.inputs(), self.outputs());
        let nq = n / 2;
        let nm = nq - ny;
        let nc = nd + split.total();
        let sizes = self.mechanical_sizes();
        let m = self.matrix();
        let (rows, columns) = (n + ny + nd, n + nu + nd);
        let mut wide = DMatrix::zeros(n + ny + nc, n + nu + nc);
        wide.view_mut((0, 0), (rows, columns))
            .copy_from(&m.view((0, 0), (rows, columns)));

        let mut rng = ChaCha8Rng::seed_from_u64(random.seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let (z, w) = (n + ny, n + nu);
        let outputs = nd + split.forces;
        let accelerations = outputs + split.outputs;
        for d in nd..outputs {
            for i in 0..nq {
                wide[(z + d, i)] = normal();
                wide[(z + d, nq + i)] = random.size * normal();
            }
            for f in 0..nm {
                wide[(z + f, w + d)] = random.size * sizes.rate * normal();
            }
        }
        for d in outputs..accelerations {
            for i in 0..nq {
                wide[(z + d, i)] = normal();
            }
            for i in 0..ny {
                wide[(n + i, w + d)] = random.size * scales[i] * normal();
            }
        }
        for d in accelerations..nc {
            for f in 0..nd {
                wide[(z + d, w + f)] = normal() / sizes.rate;
            }
            for j in 0..nu {
                wide[(z + d, n + j)] = normal() / sizes.input[j];
            }
            for i in 0..nq {
                wide[(nq + i, w + d)] = random.size * sizes.rate * normal();
            }
        }
        // Chains of deltas: powers of p.
        for group in [nd..outputs, outputs..accelerations, accelerations..nc] {
            for one in group.clone() {
                for other in group.clone() {
                    wide[(z + one, w + other)] = 0.1 * random.size * normal();
                }
            }
        }
        let friction = nd - nm;
        let mask = Mask {
            nq,
            ny,
            nu,
            nm,
            friction,
        };
        let part = |at, size| wide.view(at, size).into_owned();
        let blocks = LfrBlocks {
            a: part((0, 0), (n, n)),
            b1: part((0, w), (n, nc)),
            b2: part((0, n), (n, nu)),
            c1: part((z, 0), (nc, n)),
            d11: part((z, w), (nc, nc)),
            d12: part((z, n), (nc, nu)),
            c2: part((n, 0), (ny, n)),
            d21: part((n, w), (ny, nc)),
            d22: part((n, n), (ny, nu)),
        };
        let channels = std::iter::repeat_n(Channel::Direct, nd)
            .chain(std::iter::repeat_n(Channel::Parameter(0), split.total()))
            .collect();
        let free = mask.mask(split);
        Self::new(&blocks, free, channels, self.range().clone(), Continuous)
    }

    /// Typical sizes of the signals of a mechanical structure, whose positions are of size one.
    pub(crate) fn mechanical_sizes(&self) -> Sizes {
        let (nq, nu) = (self.states() / 2, self.inputs());
        let m = self.matrix();
        let rate = m[(0, nq)];
        // An input of size one accelerates some coordinate by the rate squared.
        let input = (0..nu).map(|j| {
            let largest = m.view((nq, 2 * nq + j), (nq, 1)).amax() / rate;
            if largest > 0.0 { 1.0 / largest } else { 1.0 }
        });
        Sizes {
            input: input.collect(),
            rate,
        }
    }
}

/// Typical sizes of signals.
pub(crate) struct Sizes {
    pub(crate) input: Vec<f64>,
    /// Radians per unit of time.
    pub(crate) rate: f64,
}

/// What may be joined to what.
pub(super) struct Mask {
    nq: usize,
    ny: usize,
    nu: usize,
    nm: usize,
    /// Forces of friction.
    friction: usize,
}

#[derive(PartialEq)]
enum Part {
    Position,
    Speed,
    Port,
    Force,
    Friction,
    Before,
    Output,
    After,
}

impl Mask {
    /// Of a structure without deltas.
    pub(super) fn of(m: &LfrBlocks) -> Self {
        Self {
            nq: m.a.nrows() / 2,
            ny: m.c2.nrows(),
            nu: m.b2.ncols(),
            nm: m.a.nrows() / 2 - m.c2.nrows(),
            friction: m.d11.nrows() + m.c2.nrows() - m.a.nrows() / 2,
        }
    }

    pub(super) fn mask(&self, split: DeltaSplit) -> DMatrix<bool> {
        let channels = self.nm + self.friction + split.total();
        let (rows, columns) = (2 * self.nq + self.ny + channels, 2 * self.nq + self.nu + channels);
        DMatrix::from_fn(rows, columns, |i, j| {
            let from = self.part(j, self.nu, split);
            match self.part(i, self.ny, split) {
                Part::Position => false,
                Part::Speed | Part::After => {
                    matches!(from, Part::Force | Part::Friction | Part::Port | Part::After)
                }
                Part::Friction => from == Part::Speed,
                Part::Port | Part::Output => matches!(from, Part::Position | Part::Output),
                Part::Force | Part::Before => matches!(from, Part::Position | Part::Speed | Part::Before),
            }
        })
    }

    /// The part that a row or a column of M belongs to; `ports` are outputs or inputs.
    fn part(&self, i: usize, ports: usize, split: DeltaSplit) -> Part {
        let parts = [
            (self.nq, Part::Position),
            (self.nq, Part::Speed),
            (ports, Part::Port),
            (self.nm, Part::Force),
            (self.friction, Part::Friction),
            (split.forces, Part::Before),
            (split.outputs, Part::Output),
        ];
        let mut end = 0;
        for (size, part) in parts {
            end += size;
            if i < end {
                return part;
            }
        }
        Part::After
    }
}
