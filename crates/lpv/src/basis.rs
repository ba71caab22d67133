//! Poles in, basis out: FKcM on the estimated poles, and the polish on what lies between them.

use crate::PipelineError;
use crate::config::{IdentifyConfig, Polish};
use lpv_core::num_complex::Complex;
use lpv_core::{BasisKind, Discrete, FunctionBasis};
use obf_basis::{
    FkcmResult, FkcmSettings, MinimaxResult, MinimaxSettings, OrthonormalBasis, PoleSet, fkcm,
    kolmogorov_cost_db, polish_minimax,
};
use pole_fit::PoleFit;

/// The basis.
#[derive(Debug, Clone)]
pub struct BasisStage {
    /// What FKcM found on the estimated poles.
    pub fkcm: FkcmResult,
    /// What the minimax polish made of it.
    pub polish: Option<MinimaxResult>,
    /// The filters that are used.
    pub basis: OrthonormalBasis,
    /// n-width cost of these filters on the poles interpolated between the positions, in dB.
    pub cost_db: f64,
}

impl BasisStage {
    /// What a truncation to these filters leaves out, relative to the response: the n-width cost as a ratio.
    pub fn model_error(&self) -> f64 {
        10_f64.powf(self.cost_db / 20.0)
    }
}

/// FKcM on the flexible poles of all positions, and the polish on the poles interpolated between them.
///
/// # Errors
/// Poles on or outside the unit circle, and what FKcM refuses.
pub fn choose_basis(
    fits: &[PoleFit],
    positions: &[f64],
    clock: Discrete,
    functions: usize,
    config: &IdentifyConfig,
) -> Result<BasisStage, PipelineError> {
    // Distortion may put an estimated pole outside the unit circle, where no basis function has one.
    let inside: Vec<Complex<f64>> = fits
        .iter()
        .flat_map(PoleFit::flexible_poles)
        .filter(|z| z.norm() < 1.0)
        .collect();
    let observed = PoleSet::new(&inside)?;
    let settings = FkcmSettings {
        fuzziness: config.fuzziness,
        seed: config.seed,
        ..FkcmSettings::new(functions)
    };
    let chosen = fkcm(&observed, &settings)?;
    let between = poles_between(fits, positions)?.unwrap_or_else(|| observed.as_slice().to_vec());
    let polish = match config.polish {
        Polish::None => None,
        Polish::Minimax => {
            let settings = MinimaxSettings {
                seed: config.seed,
                ..MinimaxSettings::default()
            };
            Some(polish_minimax(&chosen.poles, &between, &settings)?)
        }
    };
    let poles = polish.as_ref().map_or(&chosen.poles, |p| &p.poles);
    let basis = OrthonormalBasis::takenaka_malmquist(poles, clock)?;
    let cost_db = kolmogorov_cost_db(poles, &between)?;
    Ok(BasisStage {
        fkcm: chosen,
        polish,
        basis,
        cost_db,
    })
}

/// Points between two positions at which the poles are interpolated.
const POINTS_BETWEEN: usize = 10;

/// The pole loci on a dense grid: each mode's `ln z` by a cubic spline over the positions. `None` where the positions
/// do not show the same modes.
fn poles_between(fits: &[PoleFit], positions: &[f64]) -> Result<Option<Vec<Complex<f64>>>, PipelineError> {
    // One of each pair, then the real ones, which friction makes slow.
    let modes: Vec<Vec<Complex<f64>>> = fits
        .iter()
        .map(|f| {
            let poles = f.flexible_poles();
            let pairs = poles.iter().filter(|z| z.im > 0.0);
            let mut real: Vec<f64> = poles.iter().filter(|z| z.im == 0.0).map(|z| z.re).collect();
            real.sort_by(f64::total_cmp);
            let real = real.into_iter().map(Complex::from);
            pairs.copied().chain(real).map(Complex::ln).collect()
        })
        .collect();
    let (count, pairs) = (modes[0].len(), pairs_of(&fits[0]));
    let alike =
        |f: &PoleFit| pairs_of(f) == pairs && f.flexible_poles().iter().all(|z| z.im != 0.0 || z.re > 0.0);
    let same = modes.iter().all(|m| m.len() == count) && fits.iter().all(alike);
    if count == 0 || positions.len() < 4 || !same {
        return Ok(None);
    }
    let spline = FunctionBasis::new(BasisKind::Spline {
        knots: positions.to_vec(),
    })?;
    let intervals = POINTS_BETWEEN * (positions.len() - 1);
    let (first, last) = (positions[0], positions[positions.len() - 1]);
    let mut poles = Vec::with_capacity(2 * count * (intervals + 1));
    for i in 0..=intervals {
        let weights = spline.evaluate(&[first + (last - first) * i as f64 / intervals as f64]);
        for mode in 0..count {
            let z = weights
                .iter()
                .zip(&modes)
                .map(|(w, m)| m[mode] * *w)
                .sum::<Complex<f64>>()
                .exp();
            poles.push(z);
            if mode < pairs {
                poles.push(z.conj());
            }
        }
    }
    Ok(poles.iter().all(|z| z.norm() < 1.0).then_some(poles))
}

/// Complex pairs of a fit.
fn pairs_of(fit: &PoleFit) -> usize {
    fit.flexible_poles().iter().filter(|z| z.im > 0.0).count()
}
