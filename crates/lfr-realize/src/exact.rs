//! From LPV state space to LFR: exact realisation of polynomial dependence.

use crate::RealizeError;
use lpv_core::linalg::{column_space, from_blocks};
use lpv_core::{
    BasisKind, Clock, CoreError, DeltaBlock, FunctionBasis, Lfr, LfrBlocks, LpvStateSpace, MatrixFunction,
    SchedulingRange,
};
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Relative size below which a direction of the coefficients counts as rounding.
const RANK_TOLERANCE: f64 = 1e-12;

/// The coefficient of each monomial, by its exponents; ordered, so that sums do not depend on chance.
type Monomials = BTreeMap<Vec<u32>, DMatrix<f64>>;

/// A static LFR `y = (D22 + D21 Delta (I - D11 Delta)^-1 D12) v`.
struct Chain {
    d11: DMatrix<f64>,
    d12: DMatrix<f64>,
    d21: DMatrix<f64>,
    d22: DMatrix<f64>,
    deltas: Vec<DeltaBlock>,
}

/// The exact LFR of a model whose coefficients are polynomials in p.
///
/// `[A B; C D](p)` is written in Chebyshev polynomials for one parameter and evaluated by Clenshaw's recurrence,
/// whose every step is one block of deltas; for several parameters in monomials by Horner's rule. At each step
/// only the column space (or, where that is smaller, the row space) of the coefficients that are still to come
/// passes through the deltas.
///
/// # Errors
/// [`RealizeError::NotPolynomial`] for spline, tabulated or Gaussian-process coefficients.
pub fn exact_lfr<K: Clock>(model: &LpvStateSpace<K>) -> Result<Lfr<K>, RealizeError> {
    let (n, nu) = (model.states(), model.inputs());
    let chain = if model.range().parameters() == 1 {
        let degree = [model.a(), model.b(), model.c(), model.d()]
            .into_iter()
            .map(|f| degree(f.basis()))
            .try_fold(0, |most, d| d.map(|d| most.max(d)))?;
        let expand = |f| chebyshev_coefficients(f, model.range(), degree);
        let (a, b, c, d) = (
            expand(model.a()),
            expand(model.b()),
            expand(model.c()),
            expand(model.d()),
        );
        let joint = (0..=degree)
            .map(|k| from_blocks(&[&[&a[k], &b[k]], &[&c[k], &d[k]]]))
            .collect::<Result<Vec<_>, _>>()?;
        smaller(&joint, |m| clenshaw(m, 0))
    } else {
        let mut joint = Monomials::new();
        let size = (n + model.outputs(), n + nu);
        for (f, row, column) in [
            (model.a(), 0, 0),
            (model.b(), 0, n),
            (model.c(), n, 0),
            (model.d(), n, n),
        ] {
            for (e, theta) in centred_monomials(f, model.range())? {
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
        c2: chain.d22.view((n, 0), (model.outputs(), n)).into_owned(),
        d22: chain.d22.view((n, n), (model.outputs(), nu)).into_owned(),
        b1: chain.d21.rows(0, n).into_owned(),
        d21: chain.d21.rows(n, model.outputs()).into_owned(),
        c1: chain.d12.columns(0, n).into_owned(),
        d12: chain.d12.columns(n, nu).into_owned(),
        d11: chain.d11,
    };
    debug_assert_eq!(nd, blocks.d11.ncols());
    Ok(Lfr::new(
        blocks,
        chain.deltas,
        model.range().clone(),
        model.clock(),
    )?)
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
    let zero = || DMatrix::zeros(f.shape().0, f.shape().1);
    // Sampled at the points of its own degree, so that what is constant gets exact zeros and no rounding above it.
    let own = self::degree(f.basis()).unwrap_or(degree);
    let (centre, half) = (range.centre()[0], range.half_width()[0]);
    let n = own + 1;
    let angle = |j: usize| std::f64::consts::PI * (j as f64 + 0.5) / n as f64;
    let values: Vec<_> = (0..n)
        .map(|j| f.evaluate(&[centre + half * angle(j).cos()]))
        .collect();
    let coefficient = |k: usize| {
        let weight = if k == 0 { 1.0 } else { 2.0 } / n as f64;
        let terms = values.iter().enumerate();
        terms.fold(zero(), |s, (j, v)| s + v * (weight * (k as f64 * angle(j)).cos()))
    };
    (0..=degree)
        .map(|k| if k > own { zero() } else { coefficient(k) })
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
fn centred_monomials(f: &MatrixFunction, range: &SchedulingRange) -> Result<Monomials, CoreError> {
    let BasisKind::Monomials { exponents } = f.basis().kind() else {
        return Err(CoreError::NotRational {
            basis: f.basis().name(),
        });
    };
    let (centre, half) = (range.centre(), range.half_width());
    let mut sum = Monomials::new();
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
    Ok(sum)
}

fn binomial(n: u32, k: u32) -> f64 {
    (0..k).map(|i| f64::from(n - i) / f64::from(i + 1)).product()
}

/// `M_0 + sum_i delta_i U_i N_i(delta)`, each `N_i` realised in turn; a monomial belongs to its first parameter.
fn horner(monomials: Monomials, (rows, columns): (usize, usize)) -> Chain {
    let mut d22 = DMatrix::zeros(rows, columns);
    let mut groups: BTreeMap<usize, Monomials> = BTreeMap::new();
    for (mut e, theta) in monomials {
        match e.iter().position(|&k| k > 0) {
            None => d22 += theta,
            Some(i) => {
                e[i] -= 1;
                groups.entry(i).or_default().insert(e, theta);
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
        let all: Vec<&DMatrix<f64>> = group.values().collect();
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
