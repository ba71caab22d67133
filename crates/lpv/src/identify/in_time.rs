//! Records without periods: state space in innovation form by prediction error.

use super::{Outcome, Stages, estimation_records};
use crate::progress::{Progress, begin};
use crate::responses::{estimate_local, examine_records};
use crate::signal::fit_percent;
use crate::summary::{HeldOut, OrderRow, Summary, TimeSummary};
use crate::{Direct, FitFocus, IdentifyConfig, PipelineError};
use experiment_data::Bundle;
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Discrete, FrfEstimate, Model, Record, StateSpace, counted};
use lti_ident::{DirectTerm, Focus, InnovationFit, InnovationSettings, OrderEntry, Segment};
use pole_fit::{Integrators, NumeratorDegree, PoleFitSettings, fit};
use rayon::prelude::*;

/// Numbers of states that are tried where none is given.
const ORDERS: std::ops::RangeInclusive<usize> = 1..=12;

pub(super) fn in_time(
    bundle: &Bundle,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<Outcome, PipelineError> {
    let clock = bundle.clock()?;
    let (records, fitted) = estimation_records(bundle, config, progress)?;
    let findings = examine_records(bundle, &records);
    let orders: Vec<usize> = match config.order {
        Some(order) => vec![order],
        None => ORDERS.collect(),
    };
    let cut: Vec<Record> = records
        .iter()
        .zip(&fitted)
        .map(|(r, &n)| {
            let mut cut = r.clone();
            cut.truncate(n);
            cut
        })
        .collect();
    let (estimates, reason) = estimate_local(cut, clock, progress)?;
    let mut reasons = vec![reason];
    let (slope, integrators) = match config.integrators {
        Some(n) => (f64::NAN, n),
        None => crate::poles::integrators_from_slope(&estimates[0]),
    };
    begin(progress, "prediction error");
    let starts = local_starts(&estimates[0], clock, &orders);
    let closed = bundle.description().controller.is_some() || records.iter().all(|r| moves(&r.references));
    let (focus, why) = match config.focus {
        Some(focus) => (focus, "as asked".to_owned()),
        None if integrators > 0 => (
            FitFocus::Prediction,
            format!("{} would let a simulation drift", counted(integrators, "integrator")),
        ),
        None if closed => (
            FitFocus::Prediction,
            "the bundle has a controller or moving references, and in closed loop the simulation error is biased by the noise that is fed back"
                .to_owned(),
        ),
        // A single order may put a pole outside for want of a better one; an unstable plant shows at every order.
        None if !starts.is_empty() && starts.iter().all(unstable) => (
            FitFocus::Prediction,
            "the local response has poles outside the unit circle at every order".to_owned(),
        ),
        None => (
            FitFocus::Simulation,
            format!("|F| falls with the power {slope:.2} of frequency at the lowest lines, no integrator"),
        ),
    };
    let error = match focus {
        FitFocus::Simulation => "the simulated output",
        FitFocus::Prediction => "the one-step prediction",
    };
    reasons.push(format!("the error of {error} is minimised: {why}"));
    let direct = config
        .direct
        .unwrap_or(if closed { Direct::Zero } else { Direct::Estimated });
    if closed && config.direct.is_none() {
        reasons.push("no direct term: the controller acts on the output of the same sample".to_owned());
    }
    let settings = InnovationSettings {
        focus: match focus {
            FitFocus::Simulation => Focus::Simulation,
            FitFocus::Prediction => Focus::Prediction,
        },
        direct: match direct {
            Direct::Zero => DirectTerm::Zero,
            Direct::Estimated => DirectTerm::Estimated,
        },
        ..InnovationSettings::new(orders)
    };
    let segments: Vec<Segment<'_>> = records
        .iter()
        .zip(&fitted)
        .map(|(r, &n)| Segment::new(r, 0..n))
        .collect();
    let tell = |done, of| progress("prediction error", done, of);
    let mut found = lti_ident::identify_telling(&segments, clock, &settings, &starts, &tell)?;
    if config.order.is_none() {
        let samples = fitted.iter().copied().max().unwrap_or(0);
        reasons.extend(refuse_unstable(&mut found, samples, closed));
    }
    let chosen = found.chosen();
    let rows: Vec<OrderRow> = found.entries.iter().map(OrderRow::new).collect();
    reasons.push(order_reason(&rows, chosen.order, config));
    let held_out = held_out(chosen, &records, &fitted)?;
    let model = Model::InnovationStateSpace(chosen.model.clone());
    let mut summary = Summary::of_time(&model, TimeSummary::new(chosen, rows, held_out)?, reasons);
    summary.findings = findings;
    Ok(Outcome {
        model,
        summary,
        deviation: None,
        explanation: None,
        stages: Stages::Time(Box::new(found)),
    })
}

/// Whether every signal of a group changes; an empty group does not.
fn moves(signals: &lpv_core::Signals) -> bool {
    let changes = |c: &Vec<f64>| c.iter().any(|v| *v != c[0]);
    !signals.columns.is_empty() && signals.columns.iter().all(changes)
}

fn unstable(system: &StateSpace<Discrete>) -> bool {
    system.is_stable().is_ok_and(|stable| !stable)
}

/// Takes the best order whose model may stay bounded over so many samples, where the chosen one may not: the machine did.
fn refuse_unstable(found: &mut InnovationFit, samples: usize, closed_loop: bool) -> Option<String> {
    let explodes = |e: &OrderEntry| {
        let poles = e.model.model().poles().unwrap_or_default();
        !crate::validation::stability(&poles, samples).may_stay_bounded(closed_loop)
    };
    let refused = found.chosen().order;
    if !explodes(found.chosen()) {
        return None;
    }
    let (best, entry) = found
        .entries
        .iter()
        .enumerate()
        .filter(|(_, e)| e.expected_cost.is_finite() && !explodes(e))
        .min_by(|a, b| a.1.expected_cost.total_cmp(&b.1.expected_cost))?;
    let taken = entry.order;
    found.chosen = best;
    Some(format!(
        "{refused} states have the least cost to expect, but the model grows without bound where the record does not: {taken} are taken"
    ))
}

fn order_reason(rows: &[OrderRow], chosen: usize, config: &IdentifyConfig) -> String {
    if config.order.is_some() {
        return format!("{chosen} states as asked");
    }
    let tried: Vec<String> = rows
        .iter()
        .filter_map(|r| Some(format!("{}: {:.4}", r.order, r.expected_cost?)))
        .collect();
    format!(
        "{chosen} states by the cost to expect on other data ({})",
        tried.join(", ")
    )
}

/// Pole fits of the local response, one an order; those that fail are no starts.
fn local_starts(estimate: &FrfEstimate, clock: Discrete, orders: &[usize]) -> Vec<StateSpace<Discrete>> {
    orders
        .par_iter()
        .filter_map(|&order| {
            let settings = PoleFitSettings {
                integrators: Integrators::Free,
                numerator: NumeratorDegree::Proper,
                smoothing_lines: 4,
                ..PoleFitSettings::new(order)
            };
            let found = fit(estimate, clock, &settings).ok()?;
            found.state_space().ok()
        })
        .collect()
}

/// The fit on what follows the fitted part of each record; the state is carried over, no output is used to simulate.
fn held_out(
    entry: &OrderEntry,
    records: &[Record],
    fitted: &[usize],
) -> Result<Option<HeldOut>, PipelineError> {
    let mut measured: Vec<Vec<f64>> = Vec::new();
    let (mut simulated, mut predicted): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    for ((record, &n), x0) in records.iter().zip(fitted).zip(&entry.initial_states) {
        if n >= record.len() {
            continue;
        }
        let whole = Segment::whole(record);
        let (u, y) = (whole.inputs(), whole.outputs());
        let runs = [
            entry.model.simulate(x0, &u)?.outputs,
            entry.model.predict_one_step(x0, &u, &y)?.outputs,
        ];
        measured.resize(y.nrows(), Vec::new());
        for (errors, run) in [&mut simulated, &mut predicted].into_iter().zip(&runs) {
            errors.resize(y.nrows(), Vec::new());
            append_errors(errors, &y, run, n);
        }
        for (i, m) in measured.iter_mut().enumerate() {
            m.extend(y.row(i).iter().skip(n));
        }
    }
    if measured.is_empty() {
        return Ok(None);
    }
    let percent = |errors: &[Vec<f64>]| -> Vec<f64> {
        measured
            .iter()
            .zip(errors)
            .map(|(m, e)| fit_percent(m, e))
            .collect()
    };
    Ok(Some(HeldOut {
        samples: measured[0].len(),
        simulated_fit_percent: percent(&simulated),
        one_step_fit_percent: percent(&predicted),
    }))
}

fn append_errors(errors: &mut [Vec<f64>], measured: &DMatrix<f64>, run: &DMatrix<f64>, from: usize) {
    for (i, e) in errors.iter_mut().enumerate() {
        e.extend((from..measured.ncols()).map(|k| measured[(i, k)] - run[(i, k)]));
    }
}
