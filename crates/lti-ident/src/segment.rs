//! Parts of records.

use crate::LtiIdentError;
use lpv_core::{Record, Signals};
use nalgebra::DMatrix;
use std::ops::Range;

/// The samples `range` of a record: a run without gaps, with a state of its own at the first sample.
#[derive(Debug, Clone)]
pub struct Segment<'a> {
    /// The record.
    pub record: &'a Record,
    /// Samples used, from 0.
    pub range: Range<usize>,
}

impl<'a> Segment<'a> {
    /// Some samples of a record; whether they are there is checked where they are used.
    #[must_use]
    pub fn new(record: &'a Record, range: Range<usize>) -> Self {
        Self { record, range }
    }

    /// All samples of a record.
    #[must_use]
    pub fn whole(record: &'a Record) -> Self {
        Self::new(record, 0..record.len())
    }

    /// Inputs, `n_u x N`, one column a sample. Empty where the range is not in the record.
    #[must_use]
    pub fn inputs(&self) -> DMatrix<f64> {
        matrix(&self.record.inputs, &self.range)
    }

    /// Outputs, `n_y x N`, one column a sample. Empty where the range is not in the record.
    #[must_use]
    pub fn outputs(&self) -> DMatrix<f64> {
        matrix(&self.record.outputs, &self.range)
    }
}

fn matrix(signals: &Signals, range: &Range<usize>) -> DMatrix<f64> {
    let rows: Option<Vec<&[f64]>> = signals.columns.iter().map(|c| c.get(range.clone())).collect();
    let rows = rows.unwrap_or_default();
    let samples = rows.first().map_or(0, |r| r.len());
    DMatrix::from_fn(rows.len(), samples, |i, k| rows[i][k])
}

/// Refuses segments that are empty, outside their record, not finite or of different channels.
pub(crate) fn check(segments: &[Segment]) -> Result<(), LtiIdentError> {
    let first = segments
        .first()
        .ok_or(LtiIdentError::Empty { what: "segments" })?;
    let channels = |s: &Segment| {
        let Record { inputs, outputs, .. } = s.record;
        [("inputs", inputs.channels()), ("outputs", outputs.channels())]
    };
    for (segment, s) in segments.iter().enumerate() {
        s.record.check()?;
        let (Range { start, end }, samples) = (s.range.clone(), s.record.len());
        if start >= end || end > samples {
            return Err(LtiIdentError::Range {
                segment,
                start,
                end,
                samples,
            });
        }
        for ((what, expected), (_, found)) in channels(first).into_iter().zip(channels(s)) {
            if expected == 0 {
                return Err(LtiIdentError::Empty { what });
            }
            if expected != found {
                return Err(LtiIdentError::Channels {
                    segment,
                    what,
                    expected,
                    found,
                });
            }
        }
    }
    Ok(())
}
