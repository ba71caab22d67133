//! Rigid-body axes by inverse dynamics.
//!
//! For each axis `J q'' + F_v q' + o = u` is linear in J, F_v and o, so that no simulation and no start are needed
//! \[janot2014\], \[janot2019\]. Where nothing else is asked for, the equation is solved between windowed spectra, at the
//! lines at which the force stands out, with instruments that noise has not reached (`spectral`). With cut-offs of the
//! user, dry friction beside or references that say as much, it is solved between filtered derivatives:
//!
//! 1. The measured position is low-pass filtered forth and back, which shifts nothing in time, and differentiated by
//!    central differences.
//! 2. Regressors and force are filtered alike once more, to the band in which the axis is driven, and decimated to
//!    2.5 samples a period of that cut-off: rows in between would repeat what the others say.
//! 3. A force is taken to be held from sample to sample, see [`centred`].
//! 4. Deviations come from sums of the scores over parts of the data, so that a coloured residual (friction that the
//!    model lacks) does not make them too small.
//!
//! Central differences make an acceleration at `f` too small by the part `(2 pi f T)^2 / 12`: sample 30 times faster
//! than the cut-off of the regression for 0.4 % there, and much less below.

mod cutoff;
mod dry;
mod filter;
mod found;
mod lines;
mod regression;
mod rounding;
mod settings;
mod spectral;
mod speed;

pub use cutoff::Filter;
pub use settings::{Estimator, RigidBodySettings};
pub use speed::integrated;

use crate::{LtiIdentError, Segment};
use cutoff::ROUNDING;
use found::Found;
use lpv_core::{AxisOutput, Discrete, Record, RigidBody, RigidBodyAxis, Signals};
use nalgebra::DVector;
use regression::{Rows, Solution, solution, stacked};

/// A rigid body with what its fit says about each axis.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidBodyFit {
    /// The model.
    pub model: RigidBody,
    /// One account an axis.
    pub axes: Vec<AxisAccount>,
}

/// What the fit of an axis says about itself.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisAccount {
    /// Cut-off of the filter on the position; of lines of the spectrum, that below which steps and direction of the motion
    /// are looked at.
    pub position_cutoff_hz: f64,
    /// Cut-off of the filter on the equations, or the highest line used.
    pub regression_cutoff_hz: f64,
    /// Samples a row of the regression; 1 for lines.
    pub decimation: usize,
    /// Rows of the regression: two a line.
    pub rows: usize,
    /// Condition number of the regressors, columns scaled to norm one.
    pub condition_number: f64,
    /// Norm of the residual over the norm of the force, both filtered and decimated, in percent.
    pub relative_force_error_percent: f64,
    /// How the equations were solved; not [`Estimator::Automatic`].
    pub estimator: Estimator,
    /// Frequency below which the force has its power, constant and drift left out.
    pub force_band_hz: f64,
    /// Rows that count once the colour of the residual is taken into account.
    pub effective_rows: f64,
}

/// Position, velocity and acceleration of one axis, low-pass filtered forth and back.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Position.
    pub position: Vec<f64>,
    /// Velocity, per second.
    pub velocity: Vec<f64>,
    /// Acceleration, per second squared.
    pub acceleration: Vec<f64>,
}

impl Motion {
    /// Filters a measured position and differentiates it by central differences; the two end samples repeat their
    /// neighbours.
    ///
    /// # Errors
    /// [`LtiIdentError::Setting`] for a cut-off that is not between zero and Nyquist; [`LtiIdentError::TooFewSamples`]
    /// for less than three samples.
    pub fn new(position: &[f64], clock: Discrete, cutoff_hz: f64) -> Result<Self, LtiIdentError> {
        filter::check("position_cutoff_hz", cutoff_hz, clock)?;
        if position.len() < 3 {
            return Err(LtiIdentError::TooFewSamples {
                what: "derivatives of a position",
                equations: position.len(),
                unknowns: 3,
            });
        }
        let t = clock.sample_time();
        let position = filter::low_pass(position, clock, cutoff_hz);
        let velocity = inner(&position, |q| spectral::first(q, t));
        let acceleration = inner(&position, |q| spectral::second(q, t));
        Ok(Self {
            position,
            velocity,
            acceleration,
        })
    }

    /// `J q'' + F_v q' + o` at each sample.
    #[must_use]
    pub fn force(&self, axis: &RigidBodyAxis) -> Vec<f64> {
        let pairs = self.velocity.iter().zip(&self.acceleration);
        pairs.map(|(&v, &a)| axis.force(v, a)).collect()
    }
}

/// A function of each three neighbours; the ends repeat.
fn inner(signal: &[f64], f: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    let values: Vec<f64> = signal.windows(3).map(f).collect();
    let ends = (values.first().copied(), values.last().copied());
    ends.0.into_iter().chain(values).chain(ends.1).collect()
}

/// The mean of each sample and the one before. A force that is held until the next sample acts half a sample late; of a
/// mass under such a force `J (q(k+1) - 2 q(k) + q(k-1)) / T^2` is exactly this mean.
#[must_use]
pub fn centred(force: &[f64]) -> Vec<f64> {
    let means = force.windows(2).map(|f| 0.5 * (f[0] + f[1]));
    force.first().copied().into_iter().chain(means).collect()
}

/// The signal low-pass filtered forth and back, its ends left out and one sample kept of `decimation`: what both sides
/// of the equations go through.
///
/// # Errors
/// [`LtiIdentError::Setting`] for a cut-off that is not between zero and Nyquist, or a decimation of zero.
pub fn decimated(
    signal: &[f64],
    clock: Discrete,
    cutoff_hz: f64,
    decimation: usize,
) -> Result<Vec<f64>, LtiIdentError> {
    filter::check("regression_cutoff_hz", cutoff_hz, clock)?;
    if decimation == 0 {
        let (name, allowed) = ("decimation", "1 or more");
        return Err(LtiIdentError::Setting {
            name,
            value: 0.0,
            allowed,
        });
    }
    // What the point reflection at the ends makes up has faded after a period of the cut-off.
    let end = ((1.0 - ROUNDING) / (cutoff_hz * clock.sample_time())).ceil() as usize;
    let filtered = filter::low_pass(signal, clock, cutoff_hz);
    let inside = filtered
        .get(end..filtered.len().saturating_sub(end))
        .unwrap_or_default();
    Ok(inside.iter().copied().step_by(decimation).collect())
}

/// Inertia, viscous friction and offset of each axis: output i is the position that input i drives.
///
/// # Errors
/// [`LtiIdentError::Channels`] if inputs and outputs differ in number, or references are needed and missing;
/// [`LtiIdentError::TooFewSamples`], [`LtiIdentError::Singular`] if the motion does not tell the parameters apart;
/// [`LtiIdentError::Inertia`]; [`LtiIdentError::Setting`] for a cut-off above Nyquist.
pub fn identify(
    segments: &[Segment],
    clock: Discrete,
    settings: &RigidBodySettings,
) -> Result<RigidBodyFit, LtiIdentError> {
    crate::segment::check(segments)?;
    let axes = segments.first().map_or(0, |s| s.record.outputs.channels());
    for (segment, s) in segments.iter().enumerate() {
        if s.record.inputs.channels() != axes {
            return Err(LtiIdentError::Axes {
                inputs: s.record.inputs.names.clone(),
                outputs: s.record.outputs.names.clone(),
            });
        }
        let found = s.record.references.channels();
        if settings.estimator == Estimator::ReferenceInstruments && found != axes {
            return Err(LtiIdentError::Channels {
                segment,
                what: "references",
                expected: axes,
                found,
            });
        }
    }
    let fits: Result<Vec<_>, LtiIdentError> = (0..axes)
        .map(|axis| identify_axis(segments, axis, clock, settings))
        .collect();
    let (bodies, axes): (Vec<_>, Vec<_>) = fits?.into_iter().unzip();
    Ok(RigidBodyFit {
        model: RigidBody::new(bodies)?,
        axes,
    })
}

fn identify_axis(
    segments: &[Segment],
    axis: usize,
    clock: Discrete,
    settings: &RigidBodySettings,
) -> Result<(RigidBodyAxis, AxisAccount), LtiIdentError> {
    let channel = |s: &'_ Segment<'_>, signals: fn(&Record) -> &Signals| -> Vec<f64> {
        signals(s.record).columns[axis][s.range.clone()].to_vec()
    };
    let positions: Vec<Vec<f64>> = segments.iter().map(|s| channel(s, |r| &r.outputs)).collect();
    let runs: Vec<&[f64]> = positions.iter().map(Vec::as_slice).collect();
    let both = Filter::new(&runs, clock, settings)?;
    let Filter {
        position_cutoff_hz,
        regression_cutoff_hz,
        decimation,
    } = both;
    let reduced = |v: &[f64]| both.reduced(v, clock);
    let columns = |position: &[f64]| -> Result<Vec<Vec<f64>>, LtiIdentError> {
        let motion = Motion::new(position, clock, position_cutoff_hz)?;
        let acceleration = reduced(&motion.acceleration)?;
        let ones = vec![1.0; acceleration.len()];
        let mut columns = vec![acceleration, reduced(&motion.velocity)?, ones];
        if settings.dry_friction {
            let direction: Vec<f64> = motion.velocity.iter().map(|v| v.signum()).collect();
            columns.push(reduced(&direction)?);
        }
        Ok(columns)
    };
    let asked = settings.estimator == Estimator::ReferenceInstruments;
    let told = |s: &Segment| s.record.references.channels() > axis && (asked || !is_input(s.record, axis));
    let with_references = settings.estimator != Estimator::LeastSquares && segments.iter().all(told);
    let (mut force, mut regressors, mut instruments) = (Vec::new(), Vec::new(), Vec::new());
    for (s, position) in segments.iter().zip(&positions) {
        regressors.push(columns(position)?);
        force.extend(both.held(&channel(s, |r| &r.inputs), clock)?);
        if with_references {
            instruments.push(columns(&channel(s, |r| &r.references))?);
        }
    }
    let rows = Rows {
        regressors: stacked(&regressors),
        force: DVector::from_vec(force),
    };
    let instruments = with_references.then(|| stacked(&instruments));
    let forces: Vec<Vec<f64>> = segments.iter().map(|s| channel(s, |r| &r.inputs)).collect();
    let force_runs: Vec<&[f64]> = forces.iter().map(Vec::as_slice).collect();
    let force_band_hz = cutoff::band_hz(&force_runs, clock);
    let names = |signals: &Signals| signals.names.get(axis).cloned().unwrap_or_default();
    let (input, output) = segments.first().map_or_else(Default::default, |s| {
        (names(&s.record.inputs), names(&s.record.outputs))
    });
    let references: Vec<Vec<f64>> = match with_references && settings.estimator == Estimator::Automatic {
        true => segments.iter().map(|s| channel(s, |r| &r.references)).collect(),
        false => Vec::new(),
    };
    let lines = found::asked(settings).then(|| {
        let of = |i: usize| spectral::Run {
            force: &forces[i],
            position: &positions[i],
            reference: references.get(i).map(Vec::as_slice),
        };
        let runs: Vec<spectral::Run<'_>> = (0..segments.len()).map(of).collect();
        spectral::estimate(&runs, clock, found::limit_hz(settings, clock))
    });
    let lines = lines.flatten();
    let plain = solution(&rows, instruments, settings.estimator);
    let found = Found::new(lines, plain, settings)?;
    if found.is_doubtful(regression_cutoff_hz, force_band_hz, settings) {
        return Err(LtiIdentError::NotExcited {
            input,
            output,
            force_band_hz,
        });
    }
    let ([inertia, viscous, offset], deviations) = (found.theta, found.deviations);
    let moves_as_told = inertia > 0.0 && inertia.is_finite();
    let left = found.relative_error_percent;
    let motion = |position: &[f64]| Motion::new(position, clock, position_cutoff_hz);
    if !moves_as_told || left > SPEED_DOUBTED {
        let of_speed = |m: &Motion| Ok(vec![reduced(&m.velocity)?, reduced(&m.position)?]);
        let speed = on_others(segments, axis, &motion, &of_speed, &rows.force)?;
        let certain = |s: &Solution| s.theta[0] > SIGN_CERTAIN * s.deviations[0];
        let better = if moves_as_told {
            SPEED_BETTER
        } else {
            SPEED_AS_GOOD
        };
        if let Some(speed) = speed.filter(certain)
            && speed.relative_error_percent < better * left
        {
            return Err(LtiIdentError::SpeedOutput {
                input,
                output,
                speed_percent: explained(speed.relative_error_percent),
                position_percent: explained(left),
            });
        }
    }
    if !moves_as_told {
        // Below its resonance a spring makes an inertia negative too; beside it only a sign does.
        let with_spring = |m: &Motion| {
            let columns = [&m.acceleration, &m.velocity, &m.position];
            columns.into_iter().map(|c| reduced(c)).collect()
        };
        let spring = on_others(segments, axis, &motion, &with_spring, &rows.force)?;
        let certain = |theta: f64, deviation: f64| theta < -SIGN_CERTAIN * deviation;
        // Friction turns its sign with the inertia; where it does not, something else is wrong.
        let opposite = certain(inertia, deviations[0])
            && viscous < deviations[1]
            && left < 100.0
            && spring.is_some_and(|s| certain(s.theta[0], s.deviations[0]));
        let deviation = deviations[0];
        return Err(match opposite {
            true => LtiIdentError::OppositeSigns {
                input,
                output,
                inertia,
                deviation,
            },
            false => LtiIdentError::Inertia {
                input,
                output,
                inertia,
                deviation,
            },
        });
    }
    let body = RigidBodyAxis {
        inertia,
        viscous,
        offset,
        inertia_deviation: deviations[0],
        viscous_deviation: deviations[1],
        offset_deviation: deviations[2],
        output: AxisOutput::Position,
    };
    let account = found.account(
        Filter {
            position_cutoff_hz,
            regression_cutoff_hz,
            decimation,
        },
        rows.force.len(),
        force_band_hz,
    );
    Ok((body, account))
}

/// Standard deviations below zero from which the sign of an inertia is certain.
const SIGN_CERTAIN: f64 = 4.0;
/// Force error in percent from which an output is tried as a speed, and what that must leave of it.
const SPEED_DOUBTED: f64 = 70.0;
const SPEED_BETTER: f64 = 0.6;
/// The same where the inertia is not above zero.
const SPEED_AS_GOOD: f64 = 0.95;

/// The part of the power, percent, where this much of the amplitude is left, percent.
fn explained(left: f64) -> f64 {
    (100.0 - 0.01 * left * left).clamp(0.0, 100.0)
}

/// Whether the reference is the input itself, up to a factor: it then says nothing beside it.
fn is_input(record: &Record, axis: usize) -> bool {
    let (r, u) = (&record.references.columns[axis], &record.inputs.columns[axis]);
    let product: f64 = r.iter().zip(u).map(|(r, u)| r * u).sum();
    let factor = product / u.iter().map(|u| u * u).sum::<f64>();
    let left: f64 = r.iter().zip(u).map(|(r, u)| (r - factor * u).powi(2)).sum();
    left <= 1e-12 * r.iter().map(|r| r * r).sum::<f64>()
}

/// Regressors of one segment.
type Columns = Vec<Vec<f64>>;

/// Least squares of the force on other functions of the motion, a constant beside them.
fn on_others(
    segments: &[Segment],
    axis: usize,
    motion: &dyn Fn(&[f64]) -> Result<Motion, LtiIdentError>,
    others: &dyn Fn(&Motion) -> Result<Columns, LtiIdentError>,
    force: &DVector<f64>,
) -> Result<Option<Solution>, LtiIdentError> {
    let mut regressors = Vec::with_capacity(segments.len());
    for s in segments {
        let mut columns = others(&motion(&s.record.outputs.columns[axis][s.range.clone()])?)?;
        columns.push(vec![1.0; columns.first().map_or(0, Vec::len)]);
        regressors.push(columns);
    }
    let rows = Rows {
        regressors: stacked(&regressors),
        force: force.clone(),
    };
    Ok(regression::solve(&rows, &rows.regressors).ok())
}
