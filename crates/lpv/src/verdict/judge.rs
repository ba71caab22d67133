//! The rules that turn figures into a judgement.

use super::{BandPlace, Basis, Cause, Run, Stability, Verdict, Worth};
use crate::validation::{Band, ErrorFigure, FrozenCheck, OutputCheck, RecordCheck};
use lpv_numerics::statistics::median;
use lpv_simulate::SMALL_INPUT_SHARE;

/// Errors up to this multiple of the noise are noise, with what estimates of it and of a few parameters scatter.
pub(crate) const GOOD_OVER_NOISE: f64 = 2.0;

/// A frozen error that no design feels, percent of the response (-60 dB), whatever its noise.
pub(crate) const NEGLIGIBLE_PERCENT: f64 = 0.1;

/// An error in closed loop that is rounding, percent of the motion: the controller makes any model follow.
const ROUNDING_PERCENT: f64 = 1e-6;

/// Without a known noise: an error in time is noise where neither the inputs nor its own past explain more than three quarters of its
/// power, so that the best model would not halve it.
const UNEXPLAINED: f64 = 0.25;

/// Where no noise is known, errors are ordered by this part of the motion, percent.
const USUAL_PERCENT: f64 = 10.0;

/// A model that misses more than this part of a response or motion, percent, explains nothing.
pub(crate) const HALF_PERCENT: f64 = 50.0;

/// A response with more noise than this, percent, judges nothing.
const MOSTLY_NOISE_PERCENT: f64 = 50.0;

/// An error of the inverse dynamics up to this part of the force is good, percent.
const GOOD_FORCE_PERCENT: f64 = 15.0;

/// One thing that was judged.
struct Judged {
    grade: Grade,
    fact: Cause,
}

#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Grade {
    Good,
    Missed,
    Nothing,
}

impl Verdict {
    /// Judges a model by its frozen response and what it does along records. `closed_loop` says that these were taken under
    /// feedback, where an unstable machine stays bounded; the first of the notes says why there is nothing to compare with, if so.
    pub(crate) fn of(
        check: Option<&FrozenCheck>,
        along_records: &[RecordCheck],
        stability: Stability,
        closed_loop: bool,
        notes: &[String],
    ) -> Self {
        let frozen = check.map(response);
        let records: Vec<Judged> = along_records
            .iter()
            .flat_map(|r| along(r, stability, closed_loop))
            .collect();
        if frozen.is_none() && records.is_empty() {
            let why = notes
                .first()
                .cloned()
                .unwrap_or_else(|| "the bundle has no record to compare with".to_owned());
            return Self::new(
                Worth::Unjudged,
                Basis::Nothing,
                &[],
                vec![Cause::NotJudged { why }],
            );
        }
        let held_out = along_records
            .iter()
            .any(|r| r.purpose == "validation" || r.from > 0)
            || check.is_some_and(|f| f.source == "validation");
        let basis = if held_out { Basis::HeldOut } else { Basis::Fitted };
        let facts = facts(&frozen, &records);
        let worst = |judged: &[&Judged]| {
            judged
                .iter()
                .map(|j| j.grade)
                .fold(Grade::Good, |a, b| if b > a { b } else { a })
        };
        let (moving, resting): (Vec<&Judged>, Vec<&Judged>) = records
            .iter()
            .partition(|j| matches!(j.fact, Cause::Record { moves: true, .. }));
        let rest_grade = worst(&resting);
        let (frozen_worth, frozen_causes) = frozen
            .as_ref()
            .map_or((Worth::Good, Vec::new()), |f| (f.worth, f.causes.clone()));
        let worth = if frozen_worth == Worth::NotAModel || rest_grade == Grade::Nothing {
            Worth::NotAModel
        } else if rest_grade == Grade::Missed || frozen_worth == Worth::Approximate {
            Worth::Approximate
        } else if worst(&moving) == Grade::Good {
            frozen_worth
        } else if frozen.is_some() {
            Worth::GoodAtRest
        } else if worst(&moving) == Grade::Nothing {
            Worth::NotAModel
        } else {
            Worth::Approximate
        };
        let mut missed: Vec<&Judged> = records.iter().filter(|j| j.grade != Grade::Good).collect();
        missed.sort_by(|a, b| size(&b.fact).total_cmp(&size(&a.fact)));
        let along = missed.into_iter().map(|j| j.fact.clone());
        // A record of which nothing is explained says more than a band of a response.
        let mut causes = match worst(&moving) == Grade::Nothing && worth == Worth::Approximate {
            true => along.chain(frozen_causes).collect(),
            false => frozen_causes.into_iter().chain(along).collect::<Vec<_>>(),
        };
        if let Stability::Unstable { radius } = stability
            && records.iter().any(|j| {
                matches!(
                    j.fact,
                    Cause::Record {
                        run: Run::OneStep,
                        ..
                    }
                )
            })
        {
            causes.push(Cause::UnstableAlone { radius });
        }
        Self::new(worth, basis, &facts, causes)
    }
}

/// How far a cause is beyond its bar, to order causes of one kind.
fn size(cause: &Cause) -> f64 {
    match cause {
        Cause::Unstable { .. } => f64::INFINITY,
        Cause::Record {
            over_noise: Some(over),
            ..
        } => over / GOOD_OVER_NOISE,
        Cause::Record { error_percent, .. } => error_percent / USUAL_PERCENT,
        Cause::Force { error_percent, .. } => error_percent / GOOD_FORCE_PERCENT,
        _ => 0.0,
    }
}

/// The figures for the sentence of a good model: the response, and the worst record.
fn facts(frozen: &Option<Response>, records: &[Judged]) -> Vec<Cause> {
    let worst = records
        .iter()
        .max_by(|a, b| size(&a.fact).total_cmp(&size(&b.fact)));
    let response = frozen.as_ref().map(|f| f.fact.clone());
    response
        .into_iter()
        .chain(worst.map(|j| j.fact.clone()))
        .collect()
}

/// The judgement of the frozen response alone.
struct Response {
    worth: Worth,
    fact: Cause,
    causes: Vec<Cause>,
}

fn response(check: &FrozenCheck) -> Response {
    let bands = &check.bands;
    let all = |f: fn(&Band) -> f64| bands.iter().map(f).collect::<Vec<f64>>();
    let error_percent = median(&all(|b| b.error_percent));
    let noise_percent = median(&all(|b| b.noise_percent));
    let square: Option<Vec<f64>> = bands
        .iter()
        .map(|b| b.over_noise.map(|over| over * over))
        .collect();
    let over_noise = square.map(|s| (s.iter().sum::<f64>() / s.len().max(1) as f64).sqrt());
    let fact = Cause::Response {
        error_percent,
        noise_percent,
        over_noise,
    };
    // Without a known noise, what neighbouring lines scatter is the bar.
    let within = |over: Option<f64>, error: f64, noise: f64| match over {
        Some(over) => over <= GOOD_OVER_NOISE,
        None => error <= GOOD_OVER_NOISE * noise,
    };
    let good = |b: &Band| {
        within(b.over_noise, b.error_percent, b.noise_percent) || b.error_percent <= NEGLIGIBLE_PERCENT
    };
    let sound = bands.iter().take_while(|b| good(b)).count();
    let worst = bands
        .iter()
        .filter(|b| !good(b))
        .max_by(|a, b| a.error_percent.total_cmp(&b.error_percent));
    let Some(worst) = worst else {
        if noise_percent > MOSTLY_NOISE_PERCENT {
            return Response {
                worth: Worth::Approximate,
                fact,
                causes: vec![Cause::NoisyResponse { noise_percent }],
            };
        }
        return Response {
            worth: Worth::Good,
            fact,
            causes: Vec::new(),
        };
    };
    let (first, last) = (bands[0].low_hz, bands[bands.len() - 1].high_hz);
    let place = if worst.low_hz == first {
        BandPlace::Low
    } else if worst.high_hz == last {
        BandPlace::High
    } else {
        BandPlace::Middle
    };
    let cause = Cause::Band {
        band_hz: [worst.low_hz, worst.high_hz],
        error_percent: worst.error_percent,
        over_noise: worst.over_noise,
        place,
    };
    let worth = if error_percent > HALF_PERCENT && !within(over_noise, error_percent, noise_percent) {
        Worth::NotAModel
    } else if sound > 0 && bands[sound - 1].high_hz >= (first * last).sqrt() {
        Worth::GoodUpTo {
            frequency_hz: bands[sound - 1].high_hz,
        }
    } else {
        Worth::Approximate
    };
    let causes = match worth {
        Worth::GoodUpTo { .. } => vec![cause],
        _ => vec![fact.clone(), cause],
    };
    Response { worth, fact, causes }
}

/// The judgements along one record: axes by their force, other models by each output.
fn along(record: &RecordCheck, stability: Stability, closed_loop: bool) -> Vec<Judged> {
    let mut all: Vec<Judged> = record
        .axes
        .iter()
        .map(|a| Judged {
            grade: graded(a.force_percent, GOOD_FORCE_PERCENT),
            fact: Cause::Force {
                record: record.name.clone(),
                input: a.input.clone(),
                error_percent: a.force_percent,
            },
        })
        .collect();
    // A rigid body drifts in open loop; its force says what it is worth.
    if all.is_empty() || record.outputs.iter().any(|o| o.closed_loop.is_some()) {
        all.extend(
            record
                .outputs
                .iter()
                .map(|o| output(record, o, stability, closed_loop)),
        );
    }
    all
}

/// The error by which an output is judged.
pub(crate) fn judged_run(o: &OutputCheck, stability: Stability) -> (Run, &ErrorFigure) {
    match (&o.closed_loop, &o.one_step) {
        (Some(figure), _) => (Run::ClosedLoop, figure),
        (None, Some(figure)) if stability != Stability::Stable => (Run::OneStep, figure),
        _ => (Run::OpenLoop, &o.open_loop),
    }
}

fn output(record: &RecordCheck, o: &OutputCheck, stability: Stability, closed_loop: bool) -> Judged {
    let (run, figure) = judged_run(o, stability);
    let error_percent = 100.0 - figure.fit_percent;
    let fact = Cause::Record {
        record: record.name.clone(),
        output: o.name.clone(),
        run,
        error_percent,
        over_noise: figure.over_noise,
        moves: record.moves,
    };
    if let Stability::Unstable { radius } = stability
        && !stability.may_stay_bounded(closed_loop)
        && o.closed_loop.is_none()
        && (100.0 - o.open_loop.fit_percent > 100.0 || !o.open_loop.rms.is_finite())
    {
        return Judged {
            grade: Grade::Nothing,
            fact: Cause::Unstable { radius },
        };
    }
    let grade = match (figure.over_noise, run) {
        (Some(over), _) if over <= GOOD_OVER_NOISE => Grade::Good,
        (Some(_), Run::ClosedLoop) => graded(error_percent, ROUNDING_PERCENT),
        (Some(_), _) => graded(error_percent, NEGLIGIBLE_PERCENT),
        (None, Run::OpenLoop) => {
            let noise = (1.0 - o.open_loop_by_inputs) * (1.0 - o.open_loop_predictable);
            let good = if noise >= UNEXPLAINED {
                HALF_PERCENT
            } else {
                NEGLIGIBLE_PERCENT
            };
            graded(error_percent, good)
        }
        (None, _) => {
            let residual = record.whiteness.iter().find(|w| w.output == o.name);
            let nothing_left = residual.is_some_and(|w| w.is_white() && w.by_inputs <= SMALL_INPUT_SHARE);
            if figure.rms > o.change_rms {
                // To predict no change would be better.
                Grade::Nothing
            } else {
                graded(
                    error_percent,
                    if nothing_left {
                        HALF_PERCENT
                    } else {
                        NEGLIGIBLE_PERCENT
                    },
                )
            }
        }
    };
    Judged { grade, fact }
}

fn graded(error_percent: f64, good: f64) -> Grade {
    if error_percent <= good {
        Grade::Good
    } else if error_percent <= HALF_PERCENT {
        Grade::Missed
    } else {
        Grade::Nothing
    }
}
