//! Between LPV state space and LFR: exact realisation of polynomial dependence, and back.

use crate::function::BasisKind;
use crate::linalg::{column_space, from_blocks};
use crate::{
    Clock, CoreError, DeltaBlock, FunctionBasis, Lfr, LfrBlocks, LpvStateSpace, MatrixFunction,
    SchedulingRange,
};
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Relative size below which a direction of the coefficients counts as rounding.
const RANK_TOLERANCE: f64 = 1e-12;

/// A static LFR `y = (D22 + D21 Delta (I - D11 Delta)^-1 D12) v`.
struct Chain {
    d11: DMatrix<f64>,
    d12: DMatrix<f64>,
    d21: DMatrix<f64>,
    d22: DMatrix<f64>,
    deltas: Vec<DeltaBlock>,
}

impl<K: Clock> LpvStateSpace<K> {
    /// The exact LFR of a model whose coefficients are polynomials in p.
    ///
    /// `[A B; C D](p)` is written in Chebyshev polynomials for one parameter and evaluated by Clenshaw's recurrence,
    /// whose every step is one block of deltas; for several parameters in monomials by Horner's rule. At each step
    /// only the column space (or, where that is smaller, the row space) of the coefficients that are still to come
    /// passes through the deltas.
    ///
    /// # Errors
    /// [`CoreError::NotRational`] for spline, tabulated or Gaussian-process coefficients.
    pub fn to_lfr(&self) -> Result<Lfr<K>, CoreError> {
        let (n, nu) = (self.states(), self.inputs());
        let chain = if self.range().parameters() == 1 {
            let degree = [self.a(), self.b(), self.c(), self.d()]
                .into_iter()
                .map(|f| degree(f.basis()))
                .try_fold(0, |most, d| d.map(|d| most.max(d)))?;
            let expand = |f| chebyshev_coefficients(f, self.range(), degree);
            let (a, b, c, d) = (
                expand(self.a()),
                expand(self.b()),
                expand(self.c()),
                expand(self.d()),
            );
            let joint = (0..=degree)
                .map(|k| from_blocks(&[&[&a[k], &b[k]], &[&c[k], &d[k]]]))
                .collect::<Result<Vec<_>, _>>()?;
            smaller(&joint, |m| clenshaw(m, 0))
        } else {
            let mut joint: BTreeMap<Vec<u32>, DMatrix<f64>> = BTreeMap::new();
            let size = (n + self.outputs(), n + nu);
            for (f, row, column) in [
                (self.a(), 0, 0),
                (self.b(), 0, n),
                (self.c(), n, 0),
                (self.d(), n, n),
            ] {
                let (exponents, centred) = centred_monomials(f, self.range())?;
                for (e, theta) in exponents.into_iter().zip(centred) {
                    let sum = joint.entry(e).or_insert_with(|| DMatrix::zeros(size.0, size.1));
                    let mut part = sum.view_mut((row, column), theta.shape());
                    part += theta;
                }
            }
            let (keys, values): (Vec<_>, Vec<_>) = joint.into_iter().unzip();
            smaller(&values, |m| {
                horner(keys.iter().cloned().zip(m.iter().cloned()).collect(), size_of(m))
            })
        };
        let nd = chain.d11.nrows();
        let blocks = LfrBlocks {
            a: chain.d22.view((0, 0), (n, n)).into_owned(),
            b2: chain.d22.view((0, n), (n, nu)).into_owned(),
            c2: chain.d22.view((n, 0), (self.outputs(), n)).into_owned(),
            d22: chain.d22.view((n, n), (self.outputs(), nu)).into_owned(),
            b1: chain.d21.rows(0, n).into_owned(),
            d21: chain.d21.rows(n, self.outputs()).into_owned(),
            c1: chain.d12.columns(0, n).into_owned(),
            d12: chain.d12.columns(n, nu).into_owned(),
            d11: chain.d11,
        };
        debug_assert_eq!(nd, blocks.d11.ncols());
        Lfr::new(blocks, chain.deltas, self.range().clone(), self.clock())
    }
}

fn size_of(m: &[DMatrix<f64>]) -> (usize, usize) {
    m.first().map_or((0, 0), DMatrix::shape)
}

/// Realises the coefficients and their transposes, and keeps the one with fewer deltas.
fn smaller(joint: &[DMatrix<f64>], realise: impl Fn(&[DMatrix<f64>]) -> Chain) -> Chain {
    let output_side = realise(joint);
    let transposed: Vec<_> = joint.iter().map(DMatrix::transpose).collect();
    let dual = realise(&transposed);
    if dual.d11.nrows() < output_side.d11.nrows() {
        Chain {
            d11: dual.d11.transpose(),
            d12: dual.d21.transpose(),
            d21: dual.d12.transpose(),
            d22: dual.d22.transpose(),
            deltas: dual.deltas,
        }
    } else {
        output_side
    }
}

fn degree(basis: &FunctionBasis) -> Result<usize, CoreError> {
    match basis.kind() {
        BasisKind::Monomials { exponents } => Ok(exponents
            .iter()
            .map(|e| e.iter().sum::<u32>() as usize)
            .max()
            .unwrap_or(0)),
        BasisKind::Chebyshev { degree, .. } => Ok(*degree),
        _ => Err(CoreError::NotRational { basis: basis.name() }),
    }
}

/// Chebyshev coefficients over `range` of a polynomial of one parameter, from its values at the Chebyshev points:
/// exact up to rounding, whatever basis it is given in.
fn chebyshev_coefficients(f: &MatrixFunction, range: &SchedulingRange, degree: usize) -> Vec<DMatrix<f64>> {
    if let BasisKind::Chebyshev { range: own, .. } = f.basis().kind()
        && own == range
    {
        let zero = DMatrix::zeros(f.shape().0, f.shape().1);
        return (0..=degree)
            .map(|k| f.coefficients().get(k).unwrap_or(&zero).clone())
            .collect();
    }
    let (centre, half) = (range.centre()[0], range.half_width()[0]);
    let n = degree + 1;
    let angle = |j: usize| std::f64::consts::PI * (j as f64 + 0.5) / n as f64;
    let values: Vec<_> = (0..n)
        .map(|j| f.evaluate(&[centre + half * angle(j).cos()]))
        .collect();
    (0..n)
        .map(|k| {
            let weight = if k == 0 { 1.0 } else { 2.0 } / n as f64;
            let zero = DMatrix::zeros(f.shape().0, f.shape().1);
            values
                .iter()
                .enumerate()
                .fold(zero, |s, (j, v)| s + v * (weight * (k as f64 * angle(j)).cos()))
        })
        .collect()
}

/// `sum_k M_k T_k(delta)` by Clenshaw's recurrence `b_k = M_k v + 2 delta b_{k+1} - b_{k+2}`, value
/// `M_0 v + delta b_1 - b_2`. With `b_k = U_k beta_k`, `U_k` spanning the columns of `M_k, M_{k+1}, ...`, the deltas
/// carry `z_k = beta_k`, `w_k = delta z_k`.
fn clenshaw(m: &[DMatrix<f64>], parameter: usize) -> Chain {
    let (rows, columns) = size_of(m);
    let degree = m.len().saturating_sub(1);
    let scale = m.iter().map(DMatrix::amax).fold(0.0, f64::max);
    // spaces[k] spans what b_k can be, for k = 1 ... degree.
    let spaces: Vec<DMatrix<f64>> = (0..=degree + 2)
        .map(|k| {
            let rest: Vec<&DMatrix<f64>> = m.iter().skip(k.max(1)).collect();
            if k == 0 || rest.is_empty() {
                return DMatrix::zeros(rows, 0);
            }
            let joined = from_blocks(&[&rest]).unwrap_or_else(|_| DMatrix::zeros(rows, 0));
            if joined.amax() <= RANK_TOLERANCE * scale {
                return DMatrix::zeros(rows, 0);
            }
            column_space(&joined, RANK_TOLERANCE)
        })
        .collect();
    let offsets: Vec<usize> = (0..=degree + 2)
        .scan(0, |sum, k| {
            let at = *sum;
            *sum += spaces[k].ncols();
            Some(at)
        })
        .collect();
    let nd = spaces.iter().map(DMatrix::ncols).sum();
    // beta_k = from_v[k] v + from_w[k] w
    let mut from_v = vec![DMatrix::zeros(0, columns); degree + 3];
    let mut from_w = vec![DMatrix::zeros(0, nd); degree + 3];
    let mut d11 = DMatrix::zeros(nd, nd);
    let mut d12 = DMatrix::zeros(nd, columns);
    for k in (1..=degree).rev() {
        let u = spaces[k].transpose();
        let r = u.nrows();
        let mut v = &u * &m[k] - &u * &spaces[k + 2] * &from_v[k + 2];
        let mut w = -(&u * &spaces[k + 2] * &from_w[k + 2]);
        if r == 0 {
            v = DMatrix::zeros(0, columns);
            w = DMatrix::zeros(0, nd);
        }
        let next = &spaces[k + 1];
        let mut block = w.view_mut((0, offsets[k + 1]), (r, next.ncols()));
        block += &u * next * 2.0;
        d12.rows_mut(offsets[k], r).copy_from(&v);
        d11.rows_mut(offsets[k], r).copy_from(&w);
        from_v[k] = v;
        from_w[k] = w;
    }
    let mut d21 = DMatrix::zeros(rows, nd);
    let mut d22 = m
        .first()
        .cloned()
        .unwrap_or_else(|| DMatrix::zeros(rows, columns));
    if degree >= 1 {
        d21.view_mut((0, offsets[1]), (rows, spaces[1].ncols()))
            .copy_from(&spaces[1]);
        d21 -= &spaces[2] * &from_w[2];
        d22 -= &spaces[2] * &from_v[2];
    }
    Chain {
        d11,
        d12,
        d21,
        d22,
        deltas: vec![DeltaBlock {
            parameter,
            repetitions: nd,
        }],
    }
}

/// Monomials in the normalised parameters `delta`, from monomials in p, by expanding `(centre + half delta)^e`.
#[allow(clippy::type_complexity)]
fn centred_monomials(
    f: &MatrixFunction,
    range: &SchedulingRange,
) -> Result<(Vec<Vec<u32>>, Vec<DMatrix<f64>>), CoreError> {
    let BasisKind::Monomials { exponents } = f.basis().kind() else {
        return Err(CoreError::NotRational {
            basis: f.basis().name(),
        });
    };
    let (centre, half) = (range.centre(), range.half_width());
    let mut sum: BTreeMap<Vec<u32>, DMatrix<f64>> = BTreeMap::new();
    for (e, theta) in exponents.iter().zip(f.coefficients()) {
        let mut terms = vec![(Vec::new(), 1.0)];
        for i in 0..range.parameters() {
            let power = e.get(i).copied().unwrap_or(0);
            terms = terms
                .into_iter()
                .flat_map(|(key, c): (Vec<u32>, f64)| {
                    let (centre, half) = (centre[i], half[i]);
                    (0..=power).map(move |k| {
                        let factor =
                            binomial(power, k) * half.powi(k as i32) * centre.powi((power - k) as i32);
                        ([key.as_slice(), &[k]].concat(), c * factor)
                    })
                })
                .collect();
        }
        for (key, c) in terms.into_iter().filter(|(_, c)| *c != 0.0) {
            let entry = sum
                .entry(key)
                .or_insert_with(|| DMatrix::zeros(theta.nrows(), theta.ncols()));
            *entry += theta * c;
        }
    }
    Ok(sum.into_iter().unzip())
}

fn binomial(n: u32, k: u32) -> f64 {
    (0..k).map(|i| f64::from(n - i) / f64::from(i + 1)).product()
}

/// `M_0 + sum_i delta_i U_i N_i(delta)`, each `N_i` realised in turn; a monomial belongs to its first parameter.
fn horner(monomials: Vec<(Vec<u32>, DMatrix<f64>)>, (rows, columns): (usize, usize)) -> Chain {
    let mut d22 = DMatrix::zeros(rows, columns);
    let mut groups: BTreeMap<usize, Vec<(Vec<u32>, DMatrix<f64>)>> = BTreeMap::new();
    for (mut e, theta) in monomials {
        match e.iter().position(|&k| k > 0) {
            None => d22 += theta,
            Some(i) => {
                e[i] -= 1;
                groups.entry(i).or_default().push((e, theta));
            }
        }
    }
    let mut chain = Chain {
        d11: DMatrix::zeros(0, 0),
        d12: DMatrix::zeros(0, columns),
        d21: DMatrix::zeros(rows, 0),
        d22,
        deltas: Vec::new(),
    };
    for (parameter, group) in groups {
        let all: Vec<&DMatrix<f64>> = group.iter().map(|(_, t)| t).collect();
        let u = column_space(
            &from_blocks(&[&all]).unwrap_or_else(|_| DMatrix::zeros(rows, 0)),
            RANK_TOLERANCE,
        );
        let r = u.ncols();
        if r == 0 {
            continue;
        }
        let inner = horner(
            group.into_iter().map(|(e, t)| (e, u.transpose() * t)).collect(),
            (r, columns),
        );
        // z = N(delta) v is the value of the inner chain; w = delta_i z enters the output through U.
        let (old, ni) = (chain.d11.nrows(), inner.d11.nrows());
        let nd = old + r + ni;
        let mut d11 = DMatrix::zeros(nd, nd);
        d11.view_mut((0, 0), (old, old)).copy_from(&chain.d11);
        d11.view_mut((old, old + r), (r, ni)).copy_from(&inner.d21);
        d11.view_mut((old + r, old + r), (ni, ni)).copy_from(&inner.d11);
        let mut d12 = DMatrix::zeros(nd, columns);
        d12.rows_mut(0, old).copy_from(&chain.d12);
        d12.rows_mut(old, r).copy_from(&inner.d22);
        d12.rows_mut(old + r, ni).copy_from(&inner.d12);
        let mut d21 = DMatrix::zeros(rows, nd);
        d21.columns_mut(0, old).copy_from(&chain.d21);
        d21.columns_mut(old, r).copy_from(&u);
        chain.d11 = d11;
        chain.d12 = d12;
        chain.d21 = d21;
        chain.deltas.push(DeltaBlock {
            parameter,
            repetitions: r,
        });
        chain.deltas.extend(inner.deltas);
    }
    chain
}

impl<K: Clock> Lfr<K> {
    /// The exact LPV state space of an LFR of one parameter whose dependence on p is polynomial (D11 is nilpotent),
    /// or of any number of parameters if it is affine (D11 is zero).
    ///
    /// # Errors
    /// [`CoreError::NotPolynomial`] if the LFR is rational in p: use [`Lfr::tabulate`].
    pub fn to_state_space(&self) -> Result<LpvStateSpace<K>, CoreError> {
        let m = self.blocks();
        let nd = self.delta_count();
        // The nilpotency index: the smallest d with D11^d = 0 up to rounding.
        let mut power = DMatrix::<f64>::identity(nd, nd);
        let mut degree = 0;
        let scale = m.d11.norm().max(f64::MIN_POSITIVE);
        while degree <= nd
            && power.norm() > 1e-13 * scale.powi(degree as i32).max(f64::MIN_POSITIVE)
            && nd > 0
        {
            power *= &m.d11;
            degree += 1;
        }
        if degree > nd || (self.range().parameters() > 1 && degree > 1) {
            return Err(CoreError::NotPolynomial);
        }
        if self.range().parameters() > 1 {
            return self.affine();
        }
        let kind = BasisKind::Chebyshev {
            degree,
            range: self.range().clone(),
        };
        let basis = FunctionBasis::new(kind)?;
        let n = degree + 1;
        let (centre, half) = (self.range().centre()[0], self.range().half_width()[0]);
        let angle = |j: usize| std::f64::consts::PI * (j as f64 + 0.5) / n as f64;
        let frozen = (0..n)
            .map(|j| self.frozen(&[centre + half * angle(j).cos()]))
            .collect::<Result<Vec<_>, _>>()?;
        let expand = |part: fn(&crate::StateSpace<K>) -> &DMatrix<f64>| {
            let coefficients = (0..n)
                .map(|k| {
                    let weight = if k == 0 { 1.0 } else { 2.0 } / n as f64;
                    let (rows, columns) = part(&frozen[0]).shape();
                    frozen
                        .iter()
                        .enumerate()
                        .fold(DMatrix::zeros(rows, columns), |s, (j, f)| {
                            s + part(f) * (weight * (k as f64 * angle(j)).cos())
                        })
                })
                .collect();
            MatrixFunction::new(basis.clone(), coefficients)
        };
        LpvStateSpace::new(
            expand(|f| f.a())?,
            expand(|f| f.b())?,
            expand(|f| f.c())?,
            expand(|f| f.d())?,
            self.range().clone(),
            self.clock(),
        )
    }

    fn affine(&self) -> Result<LpvStateSpace<K>, CoreError> {
        let np = self.range().parameters();
        let unit = |i: usize| (0..np).map(|j| u32::from(i == j)).collect::<Vec<_>>();
        let exponents = std::iter::once(vec![0; np]).chain((0..np).map(unit)).collect();
        let basis = FunctionBasis::new(BasisKind::Monomials { exponents })?;
        let (centre, half) = (self.range().centre(), self.range().half_width());
        let middle = self.frozen(&centre)?;
        let moved = (0..np)
            .map(|i| {
                let mut p = centre.clone();
                p[i] += half[i];
                self.frozen(&p)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let expand = |part: fn(&crate::StateSpace<K>) -> &DMatrix<f64>| {
            let slopes: Vec<_> = moved
                .iter()
                .zip(&half)
                .map(|(f, h)| (part(f) - part(&middle)) / *h)
                .collect();
            let offset = slopes
                .iter()
                .zip(&centre)
                .fold(part(&middle).clone(), |s, (slope, c)| s - slope * *c);
            MatrixFunction::new(basis.clone(), std::iter::once(offset).chain(slopes).collect())
        };
        LpvStateSpace::new(
            expand(|f| f.a())?,
            expand(|f| f.b())?,
            expand(|f| f.c())?,
            expand(|f| f.d())?,
            self.range().clone(),
            self.clock(),
        )
    }

    /// The LPV state space that equals the LFR at `points` equidistant values of its one parameter and interpolates
    /// its matrices linearly between them.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] for several parameters, [`CoreError::IllPosed`].
    pub fn tabulate(&self, points: usize) -> Result<LpvStateSpace<K>, CoreError> {
        crate::linalg::dimension("tabulation: parameters", 1, self.range().parameters())?;
        let knots: Vec<f64> = self.range().grid(points).into_iter().flatten().collect();
        let basis = FunctionBasis::new(BasisKind::Tabulated { knots: knots.clone() })?;
        let frozen = knots
            .iter()
            .map(|&p| self.frozen(&[p]))
            .collect::<Result<Vec<_>, _>>()?;
        let table = |part: fn(&crate::StateSpace<K>) -> &DMatrix<f64>| {
            MatrixFunction::new(basis.clone(), frozen.iter().map(|f| part(f).clone()).collect())
        };
        LpvStateSpace::new(
            table(|f| f.a())?,
            table(|f| f.b())?,
            table(|f| f.c())?,
            table(|f| f.d())?,
            self.range().clone(),
            self.clock(),
        )
    }
}
