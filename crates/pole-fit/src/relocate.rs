//! Poles from anywhere: vector fitting (Gustavsen, Semlyen, IEEE Trans. Power Delivery 14(3), 1999), in z and with the relaxed
//! constraint (Gustavsen, IEEE Trans. Power Delivery 21(3), 2006).
//!
//! With poles `l_i` at hand, `sigma F = (1/t) (sum_i r_i / (z - l_i) + polynomial)`, `sigma = d + sum_i s_i / (z - l_i)`, is
//! linear in all that is unknown, and the zeros of sigma are the next poles. Each channel has its own `r`, which an orthogonal
//! factorisation removes; what is left of all channels gives `s` and `d`. Poles that begin spread over the band find many modes
//! where a denominator that begins as a constant finds the few strongest.

use crate::model::Setup;
use lpv_core::linalg::{eigenvalues, least_squares, svd};
use lpv_numerics::dense::Triangle;
use lpv_numerics::poles::partial_fractions;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

type C64 = Complex<f64>;

/// Passes at most. Where the order suffices, five to ten do.
const PASSES: usize = 20;
/// A pass that moves sigma by less than this from one, in the mean over the lines, is the last.
const SETTLED: f64 = 1e-4;
/// Channels that a start looks at: of more, so many combinations that hold most of the response.
const COMBINATIONS: usize = 8;
/// Lines that a start looks at.
const LINES: usize = 3000;
/// Damping of the poles that a start spreads over the band.
const DAMPING: f64 = 0.01;

/// Where the first poles lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Spread {
    /// As the lines do.
    Lines,
    /// Evenly in the logarithm of frequency.
    Decades,
}

/// One of each conjugate pair, and the real ones, spread over the lines; `count` poles in all.
pub(crate) fn spread(z: &[C64], count: usize, how: Spread) -> Vec<C64> {
    let pairs = count / 2;
    let angles: Vec<f64> = z.iter().map(|z| z.arg().abs()).filter(|a| *a > 0.0).collect();
    let (Some(&low), Some(&high)) = (angles.first(), angles.last()) else {
        return Vec::new();
    };
    let at = |part: f64| match how {
        Spread::Lines => angles[((part * angles.len() as f64) as usize).min(angles.len() - 1)],
        Spread::Decades => low * (high / low).powf(part),
    };
    let pole =
        |angle: f64| C64::from_polar((-DAMPING * angle).exp(), angle.min(0.999 * std::f64::consts::PI));
    let mut poles: Vec<C64> = Vec::with_capacity(pairs + 1);
    for i in 0..pairs {
        let mut next = pole(at((i as f64 + 0.5) / pairs as f64));
        // Equal poles have no partial fractions.
        if let Some(last) = poles.last()
            && next.arg() <= last.arg()
        {
            next = pole(last.arg() * (1.0 + 1e-3) + 1e-12);
        }
        poles.push(next);
    }
    if count % 2 == 1 {
        poles.push(C64::from((-at(0.5)).exp()));
    }
    poles
}

/// `prod (z - l)` over the poles and their conjugates, on the lines.
pub(crate) fn denominator(z: &[C64], poles: &[C64]) -> Vec<C64> {
    let of = |z: &C64| {
        let factor = |l: &C64| {
            if l.im == 0.0 {
                z - l
            } else {
                (z - l) * (z - l.conj())
            }
        };
        poles.iter().map(factor).product()
    };
    z.iter().map(of).collect()
}

/// What the passes look at: few lines and few columns, the weights beside them.
struct Data {
    z: Vec<C64>,
    over_t: Vec<C64>,
    /// Response of each column on the lines.
    columns: Vec<Vec<C64>>,
    /// Square root of its weight.
    roots: Vec<Vec<f64>>,
}

impl Data {
    fn new(setup: &Setup<'_>) -> Self {
        let lines = setup.lines;
        let step = lines.len().div_ceil(LINES).max(1);
        let index: Vec<usize> = (0..lines.len()).step_by(step).collect();
        let z: Vec<C64> = index.iter().map(|&k| lines.z[k]).collect();
        let over_t = index.iter().map(|&k| setup.over_t(k)).collect();
        let channels = lines.channels();
        let of = |c: usize| -> Vec<C64> { index.iter().map(|&k| lines.f.at(k, c)).collect() };
        let root = |c: usize| -> Vec<f64> { index.iter().map(|&k| lines.weight(k, c).sqrt()).collect() };
        let (columns, roots) = if channels <= COMBINATIONS {
            ((0..channels).map(of).collect(), (0..channels).map(root).collect())
        } else {
            combinations(channels, &index, of, root)
        };
        Self {
            z,
            over_t,
            columns,
            roots,
        }
    }
}

/// The combinations of channels that hold most of the weighted response, each with one weight a line.
fn combinations(
    channels: usize,
    index: &[usize],
    of: impl Fn(usize) -> Vec<C64>,
    root: impl Fn(usize) -> Vec<f64>,
) -> (Vec<Vec<C64>>, Vec<Vec<f64>>) {
    let n = index.len();
    let (mut tall, mut profile) = (DMatrix::zeros(2 * n, channels), vec![0.0; n]);
    for c in 0..channels {
        let (own, weight) = (of(c), root(c));
        let size = (weight.iter().map(|w| w * w).sum::<f64>() / n as f64).sqrt();
        for (k, (v, w)) in own.iter().zip(&weight).enumerate() {
            tall[(k, c)] = v.re * size;
            tall[(n + k, c)] = v.im * size;
            profile[k] += w * w / (size * size * channels as f64);
        }
    }
    let profile: Vec<f64> = profile.into_iter().map(f64::sqrt).collect();
    let mut weighted = tall.clone();
    for (i, mut row) in weighted.row_iter_mut().enumerate() {
        row *= profile[i % n];
    }
    // The right singular vectors, of the small square.
    let directions = match svd(weighted.tr_mul(&weighted)) {
        Ok(found) => found.u.unwrap_or_else(|| DMatrix::identity(channels, channels)),
        Err(_) => DMatrix::identity(channels, channels),
    };
    let combined = tall * directions.columns(0, COMBINATIONS);
    let columns = (0..COMBINATIONS).map(|j| {
        let column = combined.column(j);
        (0..n).map(|k| C64::new(column[k], column[n + k])).collect()
    });
    (columns.collect(), vec![profile; COMBINATIONS])
}

/// Moves poles until they stay, and gives the last; none where a pass has no answer.
pub(crate) fn relocate(setup: &Setup<'_>, mut poles: Vec<C64>) -> Option<Vec<C64>> {
    let data = Data::new(setup);
    let extra = setup.n_b - (setup.n_a - 1).min(setup.n_b);
    for _ in 0..PASSES {
        let (next, moved) = pass(&data, &poles, extra)?;
        poles = next;
        if moved < SETTLED {
            break;
        }
    }
    Some(poles)
}

/// So many of the poles, one of each pair, that an order asks for: one group after the other is left out that makes the residual
/// rise least, the residues of the others fitted anew. Poles that cancel each other go first, however large their residues.
pub(crate) fn most_important(setup: &Setup<'_>, poles: &[C64], count: usize) -> Option<Vec<C64>> {
    let data = Data::new(setup);
    let extra = setup.n_b - (setup.n_a - 1).min(setup.n_b);
    let lines = data.z.len();
    let fractions = partial_fractions(&data.z, poles);
    let n = fractions.len();
    let columns = n + extra + 1;
    let mut channels: Vec<(DMatrix<f64>, DVector<f64>)> = Vec::new();
    for (f, root) in data.columns.iter().zip(&data.roots) {
        let mut triangle = Triangle::new(columns, 2 * lines);
        let mut put = |j: usize, value: &dyn Fn(usize) -> C64| {
            triangle.set_complex(j, (0..lines).map(|k| value(k) * root[k]));
        };
        // The polynomial first: the rows below it see the fractions alone.
        for j in 0..extra {
            put(j, &|k| (data.z[k] - 1.0).powu(j as u32) * data.over_t[k]);
        }
        for (j, phi) in fractions.iter().enumerate() {
            put(extra + j, &|k| phi[k] * data.over_t[k]);
        }
        put(columns - 1, &|k| f[k]);
        triangle.absorb(2 * lines);
        let factor = triangle.factor();
        let r = factor.view((extra, extra), (n, n)).into_owned();
        let inverse = r.solve_upper_triangular(&DMatrix::identity(n, n))?;
        let x = &inverse * factor.view((extra, columns - 1), (n, 1)).column(0);
        channels.push((&inverse * inverse.transpose(), x));
    }
    // First column and size of each group.
    let mut groups: Vec<(C64, usize, usize)> = Vec::new();
    let mut at = 0;
    for &l in poles {
        let size = if l.im == 0.0 { 1 } else { 2 };
        groups.push((l, at, size));
        at += size;
    }
    let mut left = n;
    while left > count {
        let rise = |&(_, at, size): &(C64, usize, usize)| -> f64 {
            let of = |(inverse, x): &(DMatrix<f64>, DVector<f64>)| {
                let own = x.rows(at, size).into_owned();
                let inner = inverse.view((at, at), (size, size)).into_owned().try_inverse()?;
                Some(own.dot(&(inner * &own)))
            };
            channels.iter().map(|c| of(c).unwrap_or(0.0)).sum()
        };
        let allowed = |group: &&(C64, usize, usize)| group.2 <= left - count;
        let Some((gone, _)) = groups
            .iter()
            .enumerate()
            .filter(|(_, group)| allowed(group))
            .map(|(i, group)| (i, rise(group)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
        else {
            break;
        };
        let (_, at, size) = groups.remove(gone);
        left -= size;
        for (inverse, x) in &mut channels {
            let inner = inverse.view((at, at), (size, size)).into_owned().try_inverse()?;
            let gain = inverse.columns(at, size) * inner;
            *x -= &gain * x.rows(at, size).into_owned();
            *inverse -= &gain * inverse.rows(at, size).into_owned();
        }
    }
    let mut kept: Vec<C64> = groups.into_iter().map(|(l, _, _)| l).collect();
    // A pair that is one pole too many leaves its real one.
    if left > count {
        let pair = kept.iter().rposition(|l| l.im > 0.0)?;
        kept[pair] = C64::from(kept[pair].norm());
    }
    Some(kept)
}

/// One pass: the next poles, and how far sigma was from one.
fn pass(data: &Data, poles: &[C64], extra: usize) -> Option<(Vec<C64>, f64)> {
    let lines = data.z.len();
    let fractions = partial_fractions(&data.z, poles);
    let n = fractions.len();
    let (left, right) = (n + extra, n + 1);
    let columns = left + right;
    let mut rest: Vec<DMatrix<f64>> = Vec::with_capacity(data.columns.len());
    let mut size = 0.0;
    for (f, root) in data.columns.iter().zip(&data.roots) {
        let mut triangle = Triangle::new(columns, 2 * lines);
        let mut put = |j: usize, value: &dyn Fn(usize) -> C64| {
            triangle.set_complex(j, (0..lines).map(|k| value(k) * root[k]));
        };
        for (j, phi) in fractions.iter().enumerate() {
            put(j, &|k| phi[k] * data.over_t[k]);
            put(left + j, &|k| -phi[k] * f[k]);
        }
        for j in 0..extra {
            put(n + j, &|k| (data.z[k] - 1.0).powu(j as u32) * data.over_t[k]);
        }
        put(left + n, &|k| -f[k]);
        size += f.iter().zip(root).map(|(f, w)| (f * w).norm_sqr()).sum::<f64>();
        triangle.absorb(2 * lines);
        let factor = triangle.factor();
        rest.push(factor.view((left, left), (right, right)).into_owned());
    }
    let rows = rest.len() * right;
    let mut system = DMatrix::zeros(rows + 1, right);
    for (i, block) in rest.iter().enumerate() {
        system.view_mut((i * right, 0), (right, right)).copy_from(block);
    }
    // The mean of the real part of sigma is one: unlike d = 1, no noise pulls it to zero.
    let weight = size.sqrt() / lines as f64;
    for (j, phi) in fractions.iter().enumerate() {
        system[(rows, j)] = weight * phi.iter().map(|v| v.re).sum::<f64>();
    }
    system[(rows, n)] = weight * lines as f64;
    let mut right_side = DVector::zeros(rows + 1);
    right_side[rows] = weight * lines as f64;
    let scale: Vec<f64> = (0..right)
        .map(|j| system.column(j).norm().max(f64::MIN_POSITIVE))
        .collect();
    for (j, s) in scale.iter().enumerate() {
        system.column_mut(j).scale_mut(1.0 / s);
    }
    let mut x = least_squares(system, &right_side, 0.0).ok()?;
    for (x, s) in x.iter_mut().zip(&scale) {
        *x /= s;
    }
    let largest = x.amax();
    let d = if x[n].abs() < 1e-8 * largest {
        1e-8 * largest.copysign(x[n])
    } else {
        x[n]
    };
    let moved = (0..lines)
        .map(|k| {
            (fractions
                .iter()
                .zip(x.iter())
                .map(|(phi, s)| phi[k] * *s)
                .sum::<C64>()
                / d)
                .norm()
        })
        .sum::<f64>()
        / lines as f64;
    let zeros = zeros(poles, &x.as_slice()[..n], d)?;
    Some((zeros, moved))
}

/// How many poles these are, one of each pair.
pub(crate) fn size(poles: &[C64]) -> usize {
    poles.iter().map(|l| if l.im == 0.0 { 1 } else { 2 }).sum()
}

/// A pole inside the unit circle: mirrored at it, and off it.
pub(crate) fn inside(z: C64) -> C64 {
    let z = if z.norm() > 1.0 { z.conj().inv() } else { z };
    if z.norm() > 1.0 - 1e-9 {
        z * (1.0 - 1e-9)
    } else {
        z
    }
}

/// The zeros of `d + sum_i s_i phi_i`: eigenvalues of `A - b s^T / d`. Those outside the unit circle are mirrored at it.
fn zeros(poles: &[C64], s: &[f64], d: f64) -> Option<Vec<C64>> {
    let n = s.len();
    let mut a = DMatrix::zeros(n, n);
    let mut b = DVector::zeros(n);
    let mut at = 0;
    for l in poles {
        a[(at, at)] = l.re;
        b[at] = 1.0;
        if l.im != 0.0 {
            (a[(at, at + 1)], a[(at + 1, at)], a[(at + 1, at + 1)]) = (l.im, -l.im, l.re);
            b[at] = 2.0;
            at += 1;
        }
        at += 1;
    }
    a.ger(-1.0 / d, &b, &DVector::from_column_slice(s), 1.0);
    let found = eigenvalues(&a).ok()?;
    let mut next: Vec<C64> = found
        .into_iter()
        .filter(|z| z.im >= 0.0 && z.norm().is_finite())
        .map(inside)
        .collect();
    next.sort_by(|x, y| x.arg().total_cmp(&y.arg()).then(x.re.total_cmp(&y.re)));
    // Equal poles have no partial fractions.
    for i in 0..next.len() {
        if i > 0 && (next[i] - next[i - 1]).norm() < 1e-12 {
            next[i] *= 1.0 - 1e-6;
        }
    }
    (size(&next) == n).then_some(next)
}
