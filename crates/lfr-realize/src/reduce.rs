//! Reduction of an LFR, states and deltas together, and the starts that it shares with fits to data.

mod balance;
mod rigid;
mod settings;

use crate::RealizeError;
use balance::{dominant_poles, truncated};
use lfr_fit::{
    Candidate, DeltaReach, FitError, FrozenData, GrowSettings, Grown, LocalSettings, Refined, RigidGain,
    Sampling, StartAccount, grow, grow_from, local_model, sampled,
};
use lpv_core::{Clock, Continuous, DeltaBlock, Discrete, Frf, Lfr, StateSpace};
use nalgebra::DMatrix;
use rigid::Split;
pub use settings::ReduceSettings;

/// A reduced LFR, with its error.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduced<K: Sampling> {
    /// The model, fitted to the frozen responses of the large one.
    pub refined: Refined<K>,
    /// Gain of the rigid body, held exactly: `gamma` (`n_y x n_u`) in `gamma (T^2/2) (z + 1) / (z - 1)^2`.
    pub gamma: Option<DMatrix<f64>>,
    /// One entry a start, in their order.
    pub starts: Vec<StartAccount>,
    /// Index of the start that won.
    pub winner: usize,
    /// Largest `||F_reduced - F||_F / ||F||_F` of a line over the grid that the error is judged on.
    pub largest: f64,
    /// Median of the same.
    pub median: f64,
    /// Where the largest is: scheduling values and frequency.
    pub worst: (Vec<f64>, f64),
    /// Positions that the error is judged on, those of the fit and more between them.
    pub judged: usize,
}

impl<K: Sampling> Reduced<K> {
    /// The reduced model fitted to data in the place of the LFR that it came from, by the stages and the stopping rules of
    /// [`grow`]: the first start is the reduced model itself, the others begin at its centre.
    ///
    /// # Errors
    /// Those of [`grow`].
    pub fn grow(&self, data: &FrozenData, settings: &GrowSettings) -> Result<Grown<K>, RealizeError> {
        let (local, model) = (self.local()?, &self.refined.candidate);
        let deltas = model.to_lfr()?.deltas().to_vec();
        Ok(grow_from(
            model,
            &local,
            self.gamma.as_ref(),
            data,
            &deltas,
            settings,
        )?)
    }

    /// The flexible part at the centre of the range: a local model from which [`grow`] can begin on the data
    /// themselves, with `gamma` as the gain of the rigid body.
    ///
    /// # Errors
    /// None for a model that [`reduce`] made.
    pub fn local(&self) -> Result<StateSpace<K>, RealizeError> {
        let model = &self.refined.candidate;
        let centre = model.frozen(&model.range().centre())?;
        let rigid = self.gamma.as_ref().map_or(0, |_| 2 * model.outputs());
        let nf = model.states() - rigid;
        Ok(StateSpace::new(
            centre.a().view((rigid, rigid), (nf, nf)).into_owned(),
            centre.b().rows(rigid, nf).into_owned(),
            centre.c().columns(rigid, nf).into_owned(),
            centre.d().clone(),
            model.clock(),
        )?)
    }
}

/// Reduces an LFR to some states and deltas in the same time, by its frozen responses.
///
/// What is minimised is the relative error over lines and positions. The double integrators of a rigid body are held
/// exactly and count as `2 n_y` of the `states`; everything else must be stable at every position. Each start is fitted on
/// few lines, the best of them on all. The deltas reach states only, so that C does not depend on p, unless D does or the
/// structure of the start asks for it. `clock`: at which rate the responses of a continuous-time LFR are compared; that
/// of a discrete-time one must be its own.
///
/// # Errors
/// [`RealizeError::Reduction`] for unstable parts and for integrators that are not those of a rigid body or depend on p;
/// [`FitError::Setting`] for fewer states than the rigid body has, [`FitError::Empty`] without deltas, and those
/// of [`lfr_fit::refine`]. A large error is a result.
pub fn reduce<K: Sampling>(
    lfr: &Lfr<K>,
    clock: Discrete,
    states: usize,
    deltas: &[DeltaBlock],
    settings: &ReduceSettings,
) -> Result<Reduced<K>, RealizeError> {
    let large = Large::new(lfr, clock, states, settings)?;
    let balanced = truncated(
        lfr,
        clock,
        large.gamma.as_ref(),
        large.flexible_states,
        deltas,
        &large.responses,
    );
    large.reduce(lfr.clock(), balanced, deltas, settings)
}

/// As [`reduce`], from discrete time to continuous time behind a zero-order hold. A machine behind a hold often needs
/// fewer deltas there than in discrete time.
///
/// # Errors
/// Those of [`reduce`]; [`FitError::Pole`] if a pole that matters is real and negative at the centre.
pub fn reduce_to_continuous(
    lfr: &Lfr<Discrete>,
    states: usize,
    deltas: &[DeltaBlock],
    settings: &ReduceSettings,
) -> Result<Reduced<Continuous>, RealizeError> {
    Large::new(lfr, lfr.clock(), states, settings)?.reduce(Continuous, None, deltas, settings)
}

/// What a reduction needs to know of the large LFR.
struct Large<'a, K: Sampling> {
    lfr: &'a Lfr<K>,
    clock: Discrete,
    gamma: Option<DMatrix<f64>>,
    flexible_states: usize,
    /// The frozen model at the centre.
    centre: Split,
    /// Whether D depends on p.
    direct: bool,
    responses: Vec<(Vec<f64>, Frf)>,
}

/// The gain of a rigid body must not change by more than this part over the range.
const CONSTANT: f64 = 1e-6;

impl<'a, K: Sampling> Large<'a, K> {
    fn new(
        lfr: &'a Lfr<K>,
        clock: Discrete,
        states: usize,
        settings: &ReduceSettings,
    ) -> Result<Self, RealizeError> {
        let at = lfr.range().centre();
        let centre = Split::new(&frozen(lfr, clock, &at)?, &at)?;
        let gamma = centre.gamma.clone();
        let rigid = gamma.as_ref().map_or(0, |_| 2 * lfr.outputs());
        let allowed = "give more states than the rigid body has, two an output, and no more than the LFR has";
        let good = (rigid + 1..=lfr.states().max(rigid)).contains(&states);
        FitError::unless(good, "states", states as f64, allowed)?;
        let mut direct = false;
        let mut responses = Vec::new();
        for p in lfr.range().grid(settings.positions(lfr.range().parameters())) {
            let model = frozen(lfr, clock, &p)?;
            let split = Split::new(&model, &p)?;
            let differs = match (&gamma, &split.gamma) {
                (Some(own), Some(other)) => (own - other).norm() > CONSTANT * own.norm(),
                (None, None) => false,
                _ => true,
            };
            if differs {
                let problem = "the gain of the rigid body differs from that at the centre";
                return Err(RealizeError::Reduction { p, problem });
            }
            direct |= (model.d() - centre.flexible.d()).amax() > 1e-9 * model.d().amax();
            let lines = lines(&split.flexible, settings.lines)?;
            responses.push((p, model.frequency_response(&lines)?));
        }
        Ok(Self {
            lfr,
            clock,
            gamma,
            flexible_states: states - rigid,
            centre,
            direct,
            responses,
        })
    }

    fn reduce<T: Sampling>(
        &self,
        target: T,
        balanced: Option<Candidate<T>>,
        deltas: &[DeltaBlock],
        settings: &ReduceSettings,
    ) -> Result<Reduced<T>, RealizeError> {
        if deltas.iter().all(|d| d.repetitions == 0) {
            return Err(FitError::Empty { what: "deltas" }.into());
        }
        let data = FrozenData::relative(self.clock, &self.responses)?;
        let range = self.lfr.range();
        let reach = if self.direct || balanced.as_ref().is_some_and(has_direct_channels) {
            DeltaReach::Outputs
        } else {
            DeltaReach::States
        };
        // Random channels are for targets that can be reached; here a residual is the rule.
        let settings_of_growth = GrowSettings {
            reach,
            restarts: 0,
            target: Some(REACHED),
            refine: settings.refine,
            ..GrowSettings::default()
        };
        let local = self.local(target)?;
        let gamma = self.gamma.as_ref();
        let grown = match &balanced {
            Some(balanced) => grow_from(balanced, &local, gamma, &data, deltas, &settings_of_growth)?,
            None => grow(&local, gamma, &data, deltas, range, &settings_of_growth)?,
        };
        let mut reduced = Reduced {
            refined: grown.refined,
            gamma: self.gamma.clone(),
            starts: grown.starts,
            winner: grown.winner,
            largest: 0.0,
            median: 0.0,
            worst: (range.centre(), 0.0),
            judged: 0,
        };
        self.judge(&mut reduced, settings)?;
        Ok(reduced)
    }

    /// The flexible part at the centre, from the poles of its balanced truncation.
    fn local<T: Sampling>(&self, target: T) -> Result<StateSpace<T>, RealizeError> {
        let poles = dominant_poles(&self.centre.flexible, self.flexible_states)?;
        let flexible = &self.centre.flexible;
        let strictly_proper = StateSpace::new(
            flexible.a().clone(),
            flexible.b().clone(),
            flexible.c().clone(),
            DMatrix::zeros(flexible.outputs(), flexible.inputs()),
            self.clock,
        )?;
        let lines = lines(flexible, 160)?;
        let responses = [(
            self.lfr.range().centre(),
            strictly_proper.frequency_response(&lines)?,
        )];
        let data = FrozenData::relative(self.clock, &responses)?;
        let settings = LocalSettings {
            rigid: RigidGain::Absent,
            ..LocalSettings::default()
        };
        let local = local_model(target, &data, &poles, &settings)?.flexible;
        let d = flexible.d().clone();
        Ok(StateSpace::new(
            local.a().clone(),
            local.b().clone(),
            local.c().clone(),
            d,
            target,
        )?)
    }

    /// The error over a grid with points between those of the fit.
    fn judge<T: Sampling>(
        &self,
        reduced: &mut Reduced<T>,
        settings: &ReduceSettings,
    ) -> Result<(), RealizeError> {
        let parameters = self.lfr.range().parameters();
        let between = if parameters <= 1 { 4 } else { 2 };
        let points = between * (settings.positions(parameters) - 1) + 1;
        let mut errors = Vec::new();
        let mut largest = -1.0;
        for p in self.lfr.range().grid(points) {
            let truth = frozen(self.lfr, self.clock, &p)?;
            let lines = lines(&Split::new(&truth, &p)?.flexible, settings.lines)?;
            let own =
                sampled(&reduced.refined.candidate.frozen(&p)?, self.clock)?.ok_or_else(|| too_fast(&p))?;
            let relative = own
                .frequency_response(&lines)?
                .relative_error(&truth.frequency_response(&lines)?)?;
            for (error, f) in relative.into_iter().zip(lines) {
                if error > largest {
                    largest = error;
                    reduced.worst = (p.clone(), f);
                }
                errors.push(error);
            }
            reduced.judged += 1;
        }
        errors.sort_by(f64::total_cmp);
        reduced.largest = largest.max(0.0);
        reduced.median = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
        Ok(())
    }
}

/// Rms residual on few lines of a start after which no further one is tried.
const REACHED: f64 = 1e-9;

/// Whether the deltas of a candidate reach its outputs.
fn has_direct_channels<K: Clock>(candidate: &Candidate<K>) -> bool {
    let states = candidate.states();
    let first = states + candidate.inputs();
    let m = candidate.matrix();
    m.view((states, first), (candidate.outputs(), m.ncols() - first))
        .iter()
        .any(|v| *v != 0.0)
}

fn too_fast(p: &[f64]) -> RealizeError {
    RealizeError::Reduction {
        p: p.to_vec(),
        problem: "the model is too fast for the clock that it is compared at",
    }
}

fn frozen<K: Sampling>(
    lfr: &Lfr<K>,
    clock: Discrete,
    p: &[f64],
) -> Result<StateSpace<Discrete>, RealizeError> {
    sampled(&lfr.frozen(p)?, clock)?.ok_or_else(|| too_fast(p))
}

/// Frequencies that show a model: equidistant up to Nyquist, and some around each pole, as far apart as it is wide.
fn lines(model: &StateSpace<Discrete>, count: usize) -> Result<Vec<f64>, RealizeError> {
    let nyquist = model.clock().nyquist_hz();
    let mut all: Vec<f64> = (0..count)
        .map(|k| nyquist * (k as f64 + 0.5) / count as f64)
        .collect();
    for z in model.poles()? {
        let (centre, width) = (
            z.arg() / std::f64::consts::PI,
            -z.norm().ln() / std::f64::consts::PI,
        );
        if z.im > 0.0 && width < 2.0 / count as f64 {
            let near = [-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0].map(|k| nyquist * (centre + k * width));
            all.extend(near.into_iter().filter(|f| *f > 0.0 && *f < nyquist));
        }
    }
    all.sort_by(f64::total_cmp);
    all.dedup();
    Ok(all)
}
