//! Which records are fitted and which judge, and whether the controller is that of the records.

use crate::PipelineError;
use experiment_data::{Bundle, Description, Quantity, RecordEntry};
use lpv_core::{ControllerState, Purpose, Record};
use lpv_diagnose::{TraceError, Track};

/// A machine without its controller by its positions alone, where other motions stand beside them as a drive logs them, and that in
/// words.
pub(super) fn positions_alone(bundle: &Bundle) -> Option<(Bundle, String)> {
    let description = bundle.description();
    let channels = &description.channels;
    let outputs = &channels.output;
    if description.controller.is_some() || description.geometry.is_some() || !channels.scheduling.is_empty() {
        return None;
    }
    let (positions, others): (Vec<usize>, Vec<usize>) =
        (0..outputs.len()).partition(|k| outputs.quantity_of(*k) == Quantity::Position);
    let motion = |k: &usize| outputs.quantity_of(*k).derivatives().is_some();
    if positions.is_empty() || others.is_empty() || !others.iter().all(motion) {
        return None;
    }
    let names: Vec<String> = others
        .iter()
        .map(|k| format!("`{}` ({})", outputs.columns[*k], outputs.quantity_of(*k).name()))
        .collect();
    let inputs: Vec<usize> = (0..channels.input.len()).collect();
    Some((
        bundle.of_channels(&positions, &inputs),
        format!(
            "left aside: {}; effects are traced along positions",
            names.join(", ")
        ),
    ))
}

/// Refuses outputs that are no positions, and bundles whose only records beside periodic ones are measured frequency responses.
pub(super) fn check_records(description: &Description) -> Result<(), PipelineError> {
    let outputs = &description.channels.output;
    let moves = |k: &usize| outputs.quantity_of(*k) == Quantity::Position;
    if let Some(k) = (0..outputs.len()).find(|k| !moves(k)) {
        return Err(PipelineError::NoPosition {
            output: outputs.columns[k].clone(),
            quantity: outputs.quantity_of(k).name(),
        });
    }
    let records = &description.records;
    if records.iter().any(RecordEntry::is_response) && !records.iter().any(RecordEntry::is_transient) {
        return Err(PipelineError::Structure {
            problem: "effects are traced along records of samples, and beside measured frequency responses (kind = \"response\") this bundle \
                      has no moves: add records of them; `lpv identify` and `lpv validate` take the responses",
        });
    }
    Ok(())
}

/// Words on the record whose inputs the controller gives worst, if that is bad.
pub(super) fn wrong_controller(records: &[Record], controller: &ControllerState) -> Option<String> {
    /// Part of the inputs that rounding may make.
    const SMALL: f64 = 1e-2;
    let gap = |record: &Record| {
        let mut controller = controller.begun(record).unwrap_or_else(|| controller.clone());
        let (mut gap, mut size) = (0.0, 0.0);
        for k in 0..record.len() {
            let at = |columns: &[Vec<f64>]| columns.iter().map(|c| c[k]).collect::<Vec<f64>>();
            let (logged, injected) = (at(&record.inputs.columns), at(&record.injection.columns));
            let mut u = vec![0.0; logged.len()];
            controller.step(
                &at(&record.references.columns),
                &at(&record.outputs.columns),
                &mut u,
            );
            for (i, logged) in logged.iter().enumerate() {
                gap += (u[i] + injected.get(i).copied().unwrap_or(0.0) - logged).powi(2);
                size += logged * logged;
            }
        }
        (gap / size).sqrt()
    };
    let (worst, name) = records
        .iter()
        .map(|r| (gap(r), &r.name))
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    (worst > SMALL).then(|| {
        format!(
            "the controller of the bundle gives the logged inputs of {name} with an error of {:.1} %: if they are those of the machine, \
             check [controller] before you believe what was found",
            100.0 * worst
        )
    })
}

/// Samples of a single record of which the last third judges.
const LEAST_SAMPLES: usize = 300;

/// Records to fit and to judge by; where none is held out, the last ones, and of a single one that an observer holds its last third.
pub(super) fn split(
    records: Vec<Record>,
    reasons: &mut Vec<String>,
) -> Result<(Vec<Record>, Vec<Record>), PipelineError> {
    records.iter().try_for_each(Track::check)?;
    let moves = |r: &Record| {
        r.references
            .columns
            .iter()
            .chain(&r.injection.columns)
            .any(|c| c.iter().any(|v| *v != c[0]))
    };
    let (mut fitted, mut judged): (Vec<Record>, Vec<Record>) = records
        .into_iter()
        .filter(moves)
        .partition(|r| r.purpose == Purpose::Estimation);
    if judged.is_empty() && fitted.len() > 1 {
        let kept = fitted.len() - fitted.len().div_ceil(3);
        judged = fitted.split_off(kept);
        reasons.push(format!(
            "no record has use = \"validation\": the last {} of those for estimation judge",
            judged.len()
        ));
    }
    if let (true, [only]) = (judged.is_empty(), fitted.as_slice())
        && only.references.columns == only.outputs.columns
        && only.len() >= LEAST_SAMPLES
    {
        let kept = only.len() - only.len() / 3;
        reasons.push(format!(
            "no record has use = \"validation\": the last third of {} judges; what changes with time from the start of a record on is not \
             told by that: hold out a record of its own",
            only.name
        ));
        let last = Record {
            name: format!("{}, last third", only.name),
            purpose: Purpose::Validation,
            ..only.part(kept..only.len())
        };
        (fitted, judged) = (vec![only.part(0..kept)], vec![last]);
    }
    if fitted.is_empty() || judged.is_empty() {
        return Err(PipelineError::Structure {
            problem: "a diagnosis needs records along moves: at least one to fit and one to judge by; take a second record and write use = \
                      \"validation\" in its entry",
        });
    }
    Ok((fitted, judged))
}

/// An error in view of data that contradict themselves, which may be its cause; where nobody knows the controller, a base that diverges is
/// one that its inputs do not move.
pub(super) fn in_view_of(contradictions: &[String], is_known: bool, error: PipelineError) -> PipelineError {
    let error = match error {
        PipelineError::Trace(TraceError::Diverges { record }) if !is_known => TraceError::Record {
            record,
            problem: "the logged input does not move the output as a force moves a mass: check which columns are input and output, their \
                      signs and units, and that both are of one machine and one time"
                .to_owned(),
        }
        .into(),
        other => other,
    };
    match contradictions.is_empty() {
        true => error,
        false => TraceError::Contradicted {
            what: contradictions.join("; "),
            why: error.to_string(),
        }
        .into(),
    }
}
