//! Known injections as the excitation of a loop whose references rest.

use crate::signal::moves;
use lpv_core::Record;

/// Puts injections in the place of references that rest, in all records of a place: they are excitation too that no noise has reached.
pub(super) fn take_injections(records: &mut [Record]) {
    if records.iter().all(is_injected) {
        for record in records {
            record.references = std::mem::take(&mut record.injection);
        }
    }
}

/// Whether a known injection into every input moves the machine, and no reference does.
pub(super) fn is_injected(record: &Record) -> bool {
    record.injection.channels() == record.inputs.channels()
        && moves(&record.injection)
        && !moves(&record.references)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

    use crate::progress::silent;
    use crate::responses::periodic_responses;
    use crate::test_kit::two_periodic_records;
    use experiment_data::{BundleWriter, RecordFormat};
    use frf_estimation::Instrument;

    /// What was a reference, given as an injection beside a reference that rests, gives the same response.
    #[test]
    fn an_injection_is_the_instrument_where_the_reference_rests() {
        let (folder, bundle) = two_periodic_records();
        let out = folder.path().join("injected");
        let mut writer = BundleWriter::create(&out, bundle.description().clone(), RecordFormat::Npz).unwrap();
        for record in bundle.records() {
            let mut record = record.unwrap();
            record.injection = record.references.clone();
            record.injection.names = vec!["d1".to_owned(), "d2".to_owned()];
            record.references.columns.iter_mut().for_each(|c| c.fill(0.3));
            writer.write(&record).unwrap();
        }
        let injected = writer.finish().unwrap();
        let periodic = |i: usize| bundle.description().records[i].is_periodic();
        let [own, other] = [&bundle, &injected]
            .map(|bundle| periodic_responses(bundle, periodic, Some(2), &silent).unwrap());
        assert_eq!(other[0].estimate.instrument, Instrument::References);
        assert_eq!(own[0].estimate.estimate, other[0].estimate.estimate);
    }
}
