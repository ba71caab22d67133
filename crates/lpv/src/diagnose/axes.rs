//! Machines of several axes that each move by themselves, without their controller: each axis is diagnosed alone, and all are told
//! together.

use super::encoders::Encoders;
use super::found::{ROUNDING, names};
use super::places::record_names;
use super::words::contradicted;
use super::{AxisErrors, Diagnosed, Diagnosis, Errors, Explanation, FoundEffect, Given, LeftTests, Value};
use crate::PipelineError;
use crate::progress::Progress;
use crate::responses::load_records;
use experiment_data::Bundle;
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Continuous, Model, Purpose, Record, RigidBody, StateSpace};
use lpv_diagnose::{AxisChannels, axes, compare};

/// The axes of a bundle, one after the other.
pub(super) fn diagnose(
    bundle: &Bundle,
    given: Given<'_>,
    progress: Progress<'_>,
) -> Result<Diagnosed, PipelineError> {
    let clock = bundle.clock()?;
    let description = bundle.description();
    let records = load_records(bundle, |i| description.records[i].is_transient(), progress)?;
    let found = axes(&records, clock)?;
    let mut all = Vec::new();
    for axis in &found {
        let one = bundle.of_channels(&[axis.output], &[axis.input]);
        all.push(super::of_axis(&one, given, progress)?);
    }
    let (judged, fitted): (Vec<Record>, Vec<Record>) = records
        .into_iter()
        .partition(|r| r.purpose == Purpose::Validation);
    let mut differ: Vec<String> = Vec::new();
    for (number, (axis, one)) in found.iter().zip(&mut all).enumerate() {
        let mut effects = Vec::new();
        let from = differ.len();
        for other in &axis.further {
            // Where none is held out the fitted records judge.
            let judged = if judged.is_empty() { &fitted } else { &judged };
            if let Some(found) = compare((axis.output, *other), &fitted, judged, clock) {
                let pair = Encoders::new(bundle, (axis.output, *other), found);
                effects.extend(pair.skew());
                // What is between two encoders that a spring parts, its base tells.
                if one.explanation.base.is_rigid() {
                    effects.extend(pair.gain());
                    differ.extend(pair.difference());
                }
            }
        }
        let d = &mut one.diagnosis;
        in_the_whole(d, axis, number);
        d.reasons.insert(0, moves(bundle, axis));
        let own = &differ[from..];
        d.reasons.extend(own.iter().cloned());
        d.verdict = match (d.verdict.as_str(), effects.is_empty(), own.is_empty()) {
            ("explained", true, false) if d.effects.iter().any(|e| e.effect != ROUNDING) => {
                "partly-explained".to_owned()
            }
            ("nothing-missing" | "explained", true, false) => "unexplained".to_owned(),
            ("nothing-missing" | "explained", false, false) => "partly-explained".to_owned(),
            ("nothing-missing", false, true) => "explained".to_owned(),
            ("unexplained", false, _) => "partly-explained".to_owned(),
            (verdict, ..) => verdict.to_owned(),
        };
        let named = Some(names(&effects, &[]).0).filter(|n| !n.is_empty());
        for more in named.iter().chain(own) {
            d.verdict_in_words = format!("{}; {more}", d.verdict_in_words);
        }
        d.effects.extend(effects);
    }
    let mut diagnosis = together(bundle, all.iter().map(|a| &a.diagnosis));
    for more in differ {
        diagnosis.verdict_in_words = format!("{}; {more}", diagnosis.verdict_in_words);
    }
    Ok(Diagnosed {
        model: models(all.iter().map(|a| &a.model))?,
        explanation: Explanation {
            effects: diagnosis.effects.clone(),
            base_parameters: diagnosis.base_parameters.clone(),
            ..all[0].explanation.clone()
        },
        force: Vec::new(),
        errors: all[0].errors.clone(),
        spectrum: None,
        free_run: None,
        frozen: None,
        diagnosis,
        axes: all,
    })
}

/// Which channels an axis has, in words.
fn moves(bundle: &Bundle, axis: &AxisChannels) -> String {
    let channels = &bundle.description().channels;
    let name = |i: &usize| channels.output.columns[*i].clone();
    let also = match axis.further.is_empty() {
        true => String::new(),
        false => {
            let further: Vec<String> = axis.further.iter().map(name).collect();
            format!(
                ", which {} tell{} too",
                further.join(" and "),
                if further.len() == 1 { "s" } else { "" }
            )
        }
    };
    format!(
        "{} moves {}{also}: the motion explains {:.1} % of its square by inertia and friction",
        channels.input.columns[axis.input],
        name(&axis.output),
        100.0 * axis.explained
    )
}

/// An axis told among others: where its effects act, and whose its parameters are.
fn in_the_whole(d: &mut Diagnosis, axis: &AxisChannels, number: usize) {
    for effect in &mut d.effects {
        if let Some(place) = &mut effect.place {
            place.index = match place.kind.as_str() {
                "output" => axis.output,
                _ => axis.input,
            };
        }
    }
    let named = |(name, value): (String, Value)| (format!("axis {} {name}", number + 1), value);
    d.base_parameters = std::mem::take(&mut d.base_parameters)
        .into_iter()
        .map(named)
        .collect();
}

/// All axes in one account.
fn together<'a>(bundle: &Bundle, axes: impl Iterator<Item = &'a Diagnosis> + Clone) -> Diagnosis {
    let all: Vec<&Diagnosis> = axes.collect();
    let effects: Vec<FoundEffect> = all.iter().flat_map(|d| d.effects.clone()).collect();
    let is = |d: &&&Diagnosis, verdict: &str| d.verdict == verdict;
    let verdict = if all.iter().all(|d| is(&d, "nothing-missing")) {
        "nothing-missing"
    } else if all
        .iter()
        .all(|d| is(&d, "nothing-missing") || is(&d, "explained"))
    {
        "explained"
    } else if effects.iter().all(|e| e.effect == ROUNDING) {
        "unexplained"
    } else {
        "partly-explained"
    };
    let forces: Vec<String> = all
        .iter()
        .filter_map(|d| {
            let record = d.records.iter().find(|r| r.purpose == "validation")?;
            let (input, force) = record.force.first_key_value()?;
            Some(format!(
                "{input} {:.1} -> {:.1} %",
                force.before_percent, force.after_percent
            ))
        })
        .collect();
    let (named, rounding) = names(&effects, &record_names(bundle));
    let found = match (named.is_empty(), verdict) {
        (true, "explained") => "nothing is missing beside the rounding of the readings",
        (true, _) => "no effect is named",
        (false, _) => &named,
    };
    let contradictions: Vec<String> = all.iter().flat_map(|d| d.contradictions.clone()).collect();
    let first = match contradictions.is_empty() {
        true => String::new(),
        false => format!("{}; with the other axes: ", contradicted(&contradictions)),
    };
    let errors = |of: fn(&Diagnosis) -> &Errors| Errors {
        validation: all.iter().flat_map(|d| of(d).validation.clone()).collect(),
    };
    let left = |of: fn(&LeftTests) -> &Vec<super::LeftTest>| {
        let tests = all.iter().filter_map(|d| d.left.as_ref());
        tests.flat_map(|l| of(l).clone()).collect()
    };
    let input = |d: &Diagnosis| {
        let first = d.records.first().and_then(|r| r.force.keys().next().cloned());
        first.unwrap_or_default()
    };
    let reasons = |d: &&Diagnosis| {
        let input = input(d);
        let line = move |line: &String| format!("{input}: {line}");
        d.reasons.iter().map(line).collect::<Vec<_>>()
    };
    // A record has one row for each axis.
    let rows = |d: &&Diagnosis| {
        let input = input(d);
        let row = move |row: &AxisErrors| AxisErrors {
            record: format!("{input}, {}", row.record),
            ..row.clone()
        };
        d.axis.iter().map(row).collect::<Vec<_>>()
    };
    Diagnosis {
        format: 2,
        bundle: bundle.description().name.clone(),
        base_model: format!("{} independent axes", all.len()),
        verdict: verdict.to_owned(),
        verdict_in_words: format!(
            "{first}{}: {found}; force error on held-out records {}{rounding}",
            verdict.replace('-', " "),
            forces.join(", ")
        ),
        contradictions,
        error_of: "observer".to_owned(),
        observer_hz: None,
        effects,
        noise_floor: all.iter().flat_map(|d| d.noise_floor.clone()).collect(),
        noise: all.first().and_then(|d| d.noise.clone()),
        before: errors(|d| &d.before),
        after: errors(|d| &d.after),
        candidates: all.iter().flat_map(|d| d.candidates.clone()).collect(),
        left: Some(LeftTests {
            before: left(|l| &l.before),
            after: left(|l| &l.after),
        }),
        characterisation: None,
        base_parameters: all.iter().flat_map(|d| d.base_parameters.clone()).collect(),
        responses: Vec::new(),
        axis: all.iter().flat_map(rows).collect(),
        records: records(&all),
        reasons: all.iter().flat_map(reasons).collect(),
    }
}

/// The records of all axes, each once.
fn records(all: &[&Diagnosis]) -> Vec<super::RecordErrors> {
    let mut merged: Vec<super::RecordErrors> = Vec::new();
    for record in all.iter().flat_map(|d| &d.records) {
        let Some(there) = merged.iter_mut().find(|r| r.record == record.record) else {
            merged.push(record.clone());
            continue;
        };
        there.worse |= record.worse;
        there.force.extend(record.force.clone());
        for run in &record.free_run {
            match there.free_run.iter_mut().find(|r| r.horizon_s == run.horizon_s) {
                Some(same) => same.outputs.extend(run.outputs.clone()),
                None => there.free_run.push(run.clone()),
            }
        }
    }
    merged
}

/// The axes in one model: rigid bodies side by side, or, where a spring holds one, a state space.
fn models<'a>(all: impl Iterator<Item = &'a Model> + Clone) -> Result<Model, PipelineError> {
    let bodies: Option<Vec<_>> = all
        .clone()
        .map(|m| match m {
            Model::RigidBody(body) => Some(body.axes()[0]),
            _ => None,
        })
        .collect();
    if let Some(axes) = bodies {
        return Ok(Model::RigidBody(RigidBody::new(axes)?));
    }
    let (mut a, mut b, mut c) = (DMatrix::zeros(0, 0), DMatrix::zeros(0, 0), DMatrix::zeros(0, 0));
    for model in all {
        let one = model.in_states()?.frozen(&[0.0])?.continuous()?;
        a = beside(&a, one.a());
        b = beside(&b, one.b());
        c = beside(&c, one.c());
    }
    let d = DMatrix::zeros(c.nrows(), b.ncols());
    Ok(Model::ContinuousStateSpace(StateSpace::new(
        a, b, c, d, Continuous,
    )?))
}

/// Two blocks on a diagonal.
fn beside(one: &DMatrix<f64>, other: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = one.shape();
    let mut both = DMatrix::zeros(rows + other.nrows(), columns + other.ncols());
    both.view_mut((0, 0), (rows, columns)).copy_from(one);
    both.view_mut((rows, columns), other.shape()).copy_from(other);
    both
}
