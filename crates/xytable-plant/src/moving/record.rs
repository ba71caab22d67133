//! Samples as a record, with the names and units that a measurement would have.

use super::MovingSample;
use lpv_core::{Purpose, Record, RecordKind, Signals};

pub(super) fn record(
    name: &str,
    purpose: Purpose,
    samples: &[MovingSample],
    injection: Option<&[Vec<f64>; 2]>,
) -> Record {
    let column = |f: fn(&MovingSample) -> f64| samples.iter().map(f).collect::<Vec<f64>>();
    let signals = |names: &[&str], units: &[&str], columns| Signals {
        units: units.iter().map(ToString::to_string).collect(),
        ..Signals::new(names, columns)
    };
    let acceleration = ["m/s^2", "rad/s^2"];
    Record {
        name: name.to_owned(),
        kind: RecordKind::Transient,
        purpose,
        position: None,
        outputs: signals(
            &["y1", "y2"],
            &["m", "rad"],
            vec![column(|s| s.outputs[0]), column(|s| s.outputs[1])],
        ),
        inputs: signals(
            &["u1", "u2"],
            &acceleration,
            vec![column(|s| s.inputs[0]), column(|s| s.inputs[1])],
        ),
        references: signals(
            &["r1", "r2"],
            &["m", "rad"],
            vec![column(|s| s.references[0]), column(|s| s.references[1])],
        ),
        scheduling: signals(&["p"], &["m"], vec![column(|s| s.position)]),
        auxiliary: Signals::default(),
        injection: injection.map_or_else(Signals::default, |columns| {
            signals(&["injection1", "injection2"], &acceleration, columns.to_vec())
        }),
    }
}
