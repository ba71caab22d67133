//! Further looks at records that an observer holds. Where it leaves noise or little more: through slower ones, one after the other, since
//! a fast one takes slow differences away, and with them a small force that would add up over a record. Where no effect explains the
//! records down to their noise: in the band of the motion.

use super::in_band;
use crate::PipelineError;
use lpv_core::{ControllerState, Discrete, Record};
use lpv_diagnose::observer::Observer;
use lpv_diagnose::{Case, Slower, Trace, Track, Verdict, trace_slower};

/// What another look found, and in which loop.
pub(super) struct Again {
    pub(super) found: Trace,
    pub(super) controller: ControllerState,
    /// Bandwidth of its observer, Hz.
    pub(super) hz: f64,
    /// Fitted and judged records, from where the model lets them begin.
    pub(super) tracks: [Vec<Track>; 2],
}

/// What the further looks show.
#[derive(Default)]
pub(super) struct Look {
    /// What has a name there; of the slowest observer through which something new has.
    pub(super) again: Option<Again>,
    /// The bandwidth of the slowest, Hz, and the error of the model that was found there over the noise, where it is more than that.
    pub(super) left: Option<[f64; 2]>,
}

/// Looks again at what `found` says along the judged records of the case. The records, fitted and judged, are those of the tracks.
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
    let faster = case;
    for slower in observer.slower(&found.model.base, records[0], clock) {
        let controller = slower.controller.start()?;
        let held = held_by(&controller, records, told);
        let case = Case {
            controller: &controller,
            ..*case
        };
        let now = look.again.as_ref().map_or(found, |again| &again.found);
        let Some(Slower { over_noise, found }) = trace_slower(&case, (faster, now), &held) else {
            break;
        };
        look.left = None;
        if let Some((found, tracks)) = found {
            look.again = Some(Again {
                found,
                controller,
                hz: slower.hz,
                tracks,
            });
        } else if over_noise > MORE && matches!(now.verdict, Verdict::Explained | Verdict::NothingMissing) {
            look.left = Some([slower.hz, over_noise]);
        }
    }
    let is_explained = matches!(found.verdict, Verdict::Explained | Verdict::NothingMissing);
    if look.again.is_none() && !is_explained {
        look.again = in_band::look(case, (observer.hz, clock), found, records, told)?;
    }
    Ok(look)
}

/// Records, fitted and judged, in the loop of another observer.
pub(super) fn held_by(
    controller: &ControllerState,
    records: [&[Record]; 2],
    told: &[Vec<Track>; 2],
) -> [Vec<Track>; 2] {
    std::array::from_fn(|i| {
        let pairs = told[i].iter().zip(records[i]);
        pairs
            .map(|(track, record)| track.held_by(record, controller))
            .collect()
    })
}
