//! The records of each place, so that places can be worked on apart.

use super::places::{Placed, one_signal, runs};
use crate::PipelineError;
use experiment_data::{Bundle, DataError};
use lpv_core::Purpose;
use rayon::prelude::*;
use std::ops::Range;

/// Records in order of position, with the run of each place.
pub(super) fn runs_of(
    bundle: &Bundle,
    indices: &[usize],
) -> Result<(Vec<Placed>, Vec<Range<usize>>), PipelineError> {
    let placed = indices
        .par_iter()
        .map(|&index| {
            Ok(Placed {
                place: bundle.place(index)?,
                name: bundle.record_name(index)?.to_owned(),
                index,
            })
        })
        // Collected before the first error is taken, so that it is the first in the file and not in time.
        .collect::<Vec<Result<_, DataError>>>();
    let mut placed = placed.into_iter().collect::<Result<Vec<_>, DataError>>()?;
    let runs = runs(&mut placed)?;
    Ok((placed, runs))
}

/// The estimation records of each place by index, in order of position: lists that [`super::estimate_part`] takes one by one. Only the
/// scheduling of the records is read.
///
/// There is one list with all records where no place stands by itself: transient records share their length and the choice of a
/// regressor, and responses that were measured elsewhere must not be two of one place.
///
/// # Errors
/// [`PipelineError::Places`], [`PipelineError::SchedulingSignals`]; what is wrong with the first record that cannot be read.
pub fn records_by_place(bundle: &Bundle) -> Result<Vec<Vec<usize>>, PipelineError> {
    let entries = &bundle.description().records;
    let all: Vec<usize> = (0..bundle.len())
        .filter(|&i| entries[i].purpose == Purpose::Estimation)
        .collect();
    let periodic: Vec<usize> = all
        .iter()
        .copied()
        .filter(|&i| entries[i].is_periodic())
        .collect();
    if periodic.is_empty() || all.iter().any(|&i| entries[i].is_response()) {
        return Ok(vec![all]);
    }
    one_signal(bundle, &periodic)?;
    let (placed, runs) = runs_of(bundle, &periodic)?;
    let of_run = |run: Range<usize>| placed[run].iter().map(|p| p.index).collect();
    Ok(runs.into_iter().map(of_run).collect())
}

#[cfg(test)]
mod tests {
    use super::records_by_place;
    use crate::responses::{estimate_bundle, estimate_part};
    use crate::silent;
    use crate::simulate::{MachineFile, simulate};
    use experiment_data::{Bundle, RecordFormat};

    #[test]
    fn a_place_by_itself_has_the_bits_of_the_bundle() {
        let machine: MachineFile = toml::from_str(
            "positions = { count = 3 }\nmultisine = { period = 256, lines = \"odd\" }\nsetpoints = { samples = 400 }\n",
        )
        .unwrap();
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("bundle");
        simulate(&machine, &[], &place, RecordFormat::Npz, &|_, _| {}).unwrap();
        let bundle = Bundle::open(&place).unwrap();
        let whole = estimate_bundle(&bundle, None, &silent).unwrap();
        let parts = records_by_place(&bundle).unwrap();
        assert_eq!(parts.len(), 3);
        for (part, expected) in parts.iter().zip(&whole.estimates) {
            let found = estimate_part(&bundle, |i| part.contains(&i), None, &silent).unwrap();
            assert_eq!(format!("{:?}", found.estimates), format!("{:?}", [expected]));
        }
    }
}
