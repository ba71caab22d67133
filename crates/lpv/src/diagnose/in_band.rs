//! The competition in the band of the motion, for records that no effect explains down to their noise.

use crate::PipelineError;
use lpv_core::{ControllerState, Discrete, Record};
use lpv_diagnose::observer::{self, Observer};
use lpv_diagnose::{Base, Case, Explained, Trace, Track, axis_in_band, trace_in_band};

/// What another look found, and in which loop.
pub(super) struct Again {
    pub(super) found: Trace,
    pub(super) controller: ControllerState,
    /// Fitted and judged records, from where the model lets them begin.
    pub(super) tracks: [Vec<Track>; 2],
}

/// Looks beside `found`, what the competition down to the noise says; none where that stands. The records, fitted and judged, are
/// those of the tracks.
pub(super) fn look(
    case: &Case<'_>,
    (hz, clock): (f64, Discrete),
    found: &Trace,
    records: [&[Record]; 2],
    told: &[Vec<Track>; 2],
) -> Result<Option<Again>, PipelineError> {
    let base = axis_in_band(case.base, records[0], clock, observer::FORCE_BAND * hz);
    let base = base.unwrap_or_else(|| case.base.clone());
    let Base::Axis(_) = &base else {
        return Ok(None);
    };
    let controller = Observer::new(&base, records[0], clock)?.controller.start()?;
    let held: [Vec<Track>; 2] = std::array::from_fn(|i| {
        let pairs = told[i].iter().zip(records[i]);
        pairs
            .map(|(track, record)| track.held_by(record, &controller))
            .collect()
    });
    let bare = Explained {
        base: base.clone(),
        effects: Vec::new(),
    };
    let settled = |model: &Explained| held.each_ref().map(|t| observer::settled(model, &controller, t));
    let [fitted, judged] = settled(&bare);
    let case = Case {
        base: &base,
        controller: &controller,
        fitted: &fitted,
        judged: &judged,
        ..*case
    };
    let Some(found) = trace_in_band(&case, hz, found)? else {
        return Ok(None);
    };
    Ok(Some(Again {
        tracks: settled(&found.model),
        found,
        controller,
    }))
}
