//! The sizes that were tried for the small LFR, and what records along a moving p added.

use super::Subject;
use crate::{MovingStage, SmallSummary};
use lpv_report::{Cell, Format, Section, Table};

pub(super) fn section(s: &Subject) -> Option<Section> {
    let account = s.file.identification.as_ref()?;
    let lpv = account.summary.frequency.as_ref()?.lpv.as_ref()?;
    let small = lpv.small.as_ref()?;
    let unit = if account.frozen_deviation.is_some() {
        "rms residual over the noise"
    } else {
        "relative rms residual"
    };
    let mut section = Section::new("Small LFR");
    if let Some([states, deltas]) = lpv.lfr {
        section = section.paragraph(format!("The model has {states} states and {deltas} deltas."));
    }
    let section = section.table(sizes(small, unit));
    Some(match &small.moving {
        Some(moving) => section.table(along(moving)),
        None => section.note(slow_only(&lpv.modes)),
    })
}

/// One row a size.
fn sizes(small: &SmallSummary, unit: &str) -> Table {
    let mut table = Table::new(
        "Sizes that were tried: residual of the frozen responses against states and deltas.",
        ["states", "deltas", unit, "starts"],
    );
    for row in &small.sizes {
        table = table.row([
            Cell::count(row.states),
            Cell::count(row.deltas),
            Cell::number(row.residual, Format::Significant(4)),
            Cell::count(row.starts),
        ]);
    }
    table
}

fn along(moving: &MovingStage) -> Table {
    let [forces, outputs, accelerations] = moving.deltas;
    let mut table = Table::new(
        format!(
            "Records along a moving p: rms error over the noise of a sample. Deltas of forces, outputs and accelerations in \
             the joint fit: {forces}, {outputs}, {accelerations}; its rms residual of the frozen responses: {:.3}.",
            moving.frozen_residual
        ),
        ["model", "error over the noise"],
    );
    let names = [
        "fit to the frozen responses, its own coordinates",
        "the same, coordinates that turn with p",
        "joint fit, parameter-independent coordinates",
    ];
    for (name, error) in names.into_iter().zip(moving.over_noise) {
        let error = match error {
            Some(error) => Cell::number(error, Format::Significant(4)),
            None => Cell::text("it runs away"),
        };
        table = table.row([Cell::text(name), error]);
    }
    table
}

/// What a model from constant positions alone is good for.
fn slow_only(modes: &[Vec<[f64; 2]>]) -> String {
    let lowest = modes
        .iter()
        .flatten()
        .filter(|[frequency, damping]| *frequency > 0.0 && *damping > 0.0 && *damping < 1.0)
        .map(|[frequency, _]| *frequency)
        .fold(f64::INFINITY, f64::min);
    let against = if lowest.is_finite() {
        format!(", that is against its slowest mode at {lowest:.3} Hz")
    } else {
        String::new()
    };
    format!(
        "This model is known for slow p only. No records along a moving p decided its state coordinates, and constant \
         positions cannot: while p moves fast against the machine{against}, the simulated output may be far off, although \
         every frozen response is met. If there are none, records in closed loop along a moving p with use = \"estimation\" can \
         remove this limit."
    )
}
