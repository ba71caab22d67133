//! Local methods for arbitrary excitation: a small model of response and transient in a window around each line.

mod data;
mod fit;
mod polynomial;
mod rational;
mod settings;

pub use settings::{HalfWidth, LocalLines, LocalSettings, Regressor};

use crate::FrfError;
use crate::gain::{GainKernel, residual_covariance, response};
use crate::lanes::{ComplexLanes, write_lines};
use crate::periodic::{Condition, worst};
use data::{LocalData, Shape};
use fit::{LocalFit, Window};
use lpv_core::{Discrete, Frf, FrfEstimate, Record};
use nalgebra::DMatrix;
use num_complex::Complex;
use pulp::Scalar;

type C64 = Complex<f64>;

/// An FRF from a local method with its account.
#[derive(Debug, Clone)]
pub struct LocalEstimate {
    /// The FRF with covariance from the residuals of the local fits. Windows of neighbouring lines overlap, so their
    /// errors are correlated; the covariance is that of each line alone.
    pub estimate: FrfEstimate,
    /// Estimated lines, in cycles a record.
    pub lines: Vec<usize>,
    /// Lines in a window.
    pub window: usize,
    /// Equations in a window for one output: lines times records.
    pub equations: usize,
    /// Unknowns for one output, the common denominator not counted.
    pub unknowns: usize,
    /// Ratio of the largest to the smallest diagonal entry of `R` in the QR factorisation of the scaled regressors.
    pub condition: Condition,
}

/// Local polynomial method (Pintelon and Schoukens, System Identification, 2nd ed., ch. 7): around each line `k`
///
/// `Y_e(k+r) = sum_s F_s r^s U_e(k+r) + sum_s t_{e,s} r^s + V`, `s = 0..degree`,
///
/// with one response for all records and a transient `t_e` for each, by least squares; the estimate is `F_0`.
///
/// # Errors
/// [`FrfError::NoRecords`], [`FrfError::Mismatch`], [`FrfError::NotFinite`], [`FrfError::WindowTooWide`],
/// [`FrfError::LocalRank`], [`FrfError::Line`], [`FrfError::References`].
pub fn local_polynomial(
    records: &[&Record],
    clock: Discrete,
    settings: &LocalSettings,
) -> Result<LocalEstimate, FrfError> {
    run(records, clock, settings, 0, polynomial::fit)
}

/// Local rational method (McKelvey and Guerin, SYSID 2012): as [`local_polynomial`], with response and transient over one
/// denominator, common to all channels and records,
///
/// `Y_e(k+r) = (sum_s N_s r^s U_e(k+r) + sum_s t_{e,s} r^s) / (1 + sum_{s>0} d_s r^s) + V`.
///
/// Linear least squares on the equation times the denominator, then repeated with the equation divided by the last
/// denominator (Sanathanan and Koerner), so that the residual is that of the output. The covariance includes the
/// uncertainty of the denominator to first order; since that couples the outputs, `S` is the mean over outputs, each
/// scaled by its noise.
///
/// # Errors
/// As [`local_polynomial`].
pub fn local_rational(
    records: &[&Record],
    clock: Discrete,
    settings: &LocalSettings,
) -> Result<LocalEstimate, FrfError> {
    let denominator = settings.denominator_degree;
    run(records, clock, settings, denominator, rational::fit)
}

fn run(
    records: &[&Record],
    clock: Discrete,
    settings: &LocalSettings,
    denominator: usize,
    fit: fn(&Window<'_>, &LocalSettings) -> Result<LocalFit, f64>,
) -> Result<LocalEstimate, FrfError> {
    settings.check()?;
    let data = LocalData::new(records, clock, settings.regressor)?;
    let shape = data.shape(settings, denominator)?;
    let lines: Vec<usize> = match &settings.lines {
        LocalLines::All => (1..=data.lines).collect(),
        LocalLines::List(list) => list.clone(),
    };
    crate::settings::check_lines(&lines, data.lines)?;
    let all = at_lines(&data, settings, &shape, &lines, fit, false);
    match (&settings.lines, all) {
        // Outside the band of the excitation there is nothing to estimate, and at its edge not at every line.
        (LocalLines::All, Err(FrfError::LocalRank { line, .. })) => {
            let band = excited_band(&data, shape.half_width);
            let lines = if band.is_empty() || band.contains(&line) {
                lines
            } else {
                band
            };
            at_lines(&data, settings, &shape, &lines, fit, true)
        }
        (_, all) => all,
    }
}

/// Power of a regressor in a window, over its largest one, below which a line is not excited: leakage and rounding.
const QUIET: f64 = 1e-7;

/// The lines at which all regressors are excited.
fn excited_band(data: &LocalData, half_width: usize) -> Vec<usize> {
    let window = |k: usize| k.saturating_sub(half_width).max(1)..=(k + half_width).min(data.lines);
    let power = |j: usize, k: usize| -> f64 {
        let records = |line| (0..data.records).map(move |e| data.x(e, j, line).norm_sqr());
        window(k).flat_map(records).sum::<f64>() / window(k).count() as f64
    };
    let powers: Vec<Vec<f64>> = (0..data.regressors)
        .map(|j| (1..=data.lines).map(|k| power(j, k)).collect())
        .collect();
    let largest: Vec<f64> = powers
        .iter()
        .map(|p| p.iter().copied().fold(0.0, f64::max))
        .collect();
    let excited = |k: &usize| {
        powers
            .iter()
            .zip(&largest)
            .all(|(p, most)| p[k - 1] > QUIET * most)
    };
    (1..=data.lines).filter(excited).collect()
}

/// Part of the lines that may be left out because the records do not tell the response there.
const LEFT_OUT: f64 = 0.5;

/// The estimate at some lines; with `lenient`, without those where the regressors are dependent, if they are not too many.
fn at_lines(
    data: &LocalData,
    settings: &LocalSettings,
    shape: &Shape,
    lines: &[usize],
    fit: fn(&Window<'_>, &LocalSettings) -> Result<LocalFit, f64>,
    lenient: bool,
) -> Result<LocalEstimate, FrfError> {
    let (ny, nu) = (data.outputs, data.inputs);
    let mut kept: Vec<usize> = Vec::with_capacity(lines.len());
    let mut refused: Option<FrfError> = None;
    let mut values = Vec::with_capacity(lines.len() * ny * nu);
    let mut c_v: Vec<C64> = Vec::with_capacity(lines.len() * ny * ny);
    let mut s = Vec::with_capacity(lines.len() * nu * nu);
    let mut by_line = Vec::with_capacity(lines.len());
    let simd = Scalar::new();
    let mut inverse = GainKernel::new(simd, nu, nu);
    let lanes = |numbers: &[C64]| -> Vec<_> { numbers.iter().copied().map(ComplexLanes::one).collect() };
    for &k in lines {
        let rank = |condition: f64| FrfError::LocalRank {
            line: k,
            frequency_hz: k as f64 * data.resolution_hz,
            condition,
        };
        let window = Window::new(data, k, shape.half_width, settings.degree);
        let local = match fit(&window, settings).map_err(rank) {
            Ok(local) => local,
            Err(dependent) if lenient => {
                refused.get_or_insert(dependent);
                continue;
            }
            Err(dependent) => return Err(dependent),
        };
        by_line.push(local.condition);
        kept.push(k);
        match settings.regressor {
            Regressor::Inputs => {
                values.extend_from_slice(local.response.as_slice());
                c_v.extend_from_slice(local.covariance.as_slice());
                s.extend_from_slice(local.factor.as_slice());
            }
            // F = G_y G_u^-1, hence dF = [I -F] dG_z G_u^-1.
            Regressor::References => {
                let (g_y, g_u) = (local.response.rows(0, ny), local.response.rows(ny, nu));
                let [condition, ..] = inverse.compute(&lanes(g_u.clone_owned().as_slice()), None);
                if condition.is_infinite() {
                    return Err(rank(condition));
                }
                let mut f = vec![ComplexLanes::zero(simd); ny * nu];
                let mut c = vec![ComplexLanes::zero(simd); ny * ny];
                let covariance = lanes(local.covariance.as_slice());
                response(
                    simd,
                    &lanes(g_y.clone_owned().as_slice()),
                    inverse.gain(),
                    ny,
                    nu,
                    &mut f,
                );
                residual_covariance(simd, &covariance, &f, ny, nu, 1.0, &mut c);
                let first = c_v.len();
                c_v.resize(first + ny * ny, C64::new(0.0, 0.0));
                write_lines(&c, &mut c_v[first..]);
                let g = DMatrix::from_iterator(nu, nu, inverse.gain().iter().map(|g| g.value()));
                s.extend_from_slice((g.adjoint() * &local.factor * g).as_slice());
                values.extend(f.iter().map(|f| f.value()));
            }
        }
    }
    let most = (LEFT_OUT * lines.len() as f64) as usize;
    if let Some(refused) = refused.filter(|_| lines.len() - kept.len() > most) {
        return Err(refused);
    }
    let frequencies_hz: Vec<f64> = kept.iter().map(|&k| k as f64 * data.resolution_hz).collect();
    let frf = Frf::new(frequencies_hz, ny, nu, values)?;
    Ok(LocalEstimate {
        condition: worst(&by_line, &kept, frf.frequencies_hz()),
        estimate: FrfEstimate::new(frf, c_v, s, shape.degrees_of_freedom, data.position.clone())?,
        lines: kept,
        window: 2 * shape.half_width + 1,
        equations: shape.equations,
        unknowns: shape.unknowns,
    })
}
