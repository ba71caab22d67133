//! The competition in the band of the motion, for records that no effect explains down to their noise.

use super::again::{Again, held_by};
use crate::PipelineError;
use lpv_core::{Discrete, Record};
use lpv_diagnose::observer::{self, Observer};
use lpv_diagnose::{Base, Case, Explained, Trace, Track, axis_in_band, trace_in_band};

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
    let held = held_by(&controller, records, told);
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
        hz,
    }))
}
