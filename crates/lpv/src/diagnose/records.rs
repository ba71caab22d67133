//! Which records are fitted and which judge, and whether the controller is that of the records.

use crate::PipelineError;
use experiment_data::{Description, Quantity, RecordEntry};
use lpv_core::{ControllerState, Purpose, Record};
use lpv_diagnose::{TraceError, Track};

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

/// Records to fit and to judge by; where none is held out, the last ones.
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
    if fitted.is_empty() || judged.is_empty() {
        return Err(PipelineError::Structure {
            problem: "a diagnosis needs records along moves: at least one to fit and one with use = \"validation\" to judge by",
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
