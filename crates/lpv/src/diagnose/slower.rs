//! The competition through slower observers, one after the other, where a faster one leaves noise or little more: it takes slow differences
//! away, and with them a small force that would add up over a record.

use super::in_band::Again;
use crate::PipelineError;
use lpv_core::{Discrete, Record};
use lpv_diagnose::observer::Observer;
use lpv_diagnose::{Case, Slower, Trace, Track, Verdict, trace_slower};

/// What the slower observers show.
#[derive(Default)]
pub(super) struct Look {
    /// What has a name there; of the slowest one where something new has.
    pub(super) again: Option<Again>,
    /// The bandwidth of the slowest, Hz, and the error of the model that was found there over the noise, where it is more than that.
    pub(super) left: Option<[f64; 2]>,
}

/// Looks again at what `found` says. The records, fitted and judged, are those of the tracks.
pub(super) fn look(
    case: &Case<'_>,
    (observer, clock): (&Observer, Discrete),
    found: &Trace,
    records: [&[Record]; 2],
    told: &[Vec<Track>; 2],
) -> Result<Look, PipelineError> {
    /// Error over the noise from which it is told.
    const MORE: f64 = 1.5;
    let mut look = Look::default();
    for slower in observer.slower(&found.model.base, records[0], clock) {
        let controller = slower.controller.start()?;
        let held: [Vec<Track>; 2] = std::array::from_fn(|i| {
            let pairs = told[i].iter().zip(records[i]);
            pairs
                .map(|(track, record)| track.held_by(record, &controller))
                .collect()
        });
        let case = Case {
            controller: &controller,
            ..*case
        };
        let now = look.again.as_ref().map_or(found, |again| &again.found);
        let Some(Slower { over_noise, found }) = trace_slower(&case, now, &held)? else {
            break;
        };
        look.left = None;
        if let Some((found, tracks)) = found {
            look.again = Some(Again {
                found,
                controller,
                tracks,
            });
        } else if over_noise > MORE && matches!(now.verdict, Verdict::Explained | Verdict::NothingMissing) {
            look.left = Some([slower.hz, over_noise]);
        }
    }
    Ok(look)
}
