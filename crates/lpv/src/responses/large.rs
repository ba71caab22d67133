//! Periodic records that are too large to be in memory, a period at a time: once to check them and to see their last period, once
//! to see when they settle, once to average them.

use super::injection::is_injected;
use super::{AtPosition, periodic_settings, place};
use crate::PipelineError;
use crate::finding::{Look, Watch};
use crate::period_noise::PeriodNoise;
use crate::progress::Counter;
use experiment_data::Bundle;
use frf_estimation::{FrfError, Layout, PeriodicAccumulator, Settling, SkipRule};
use lpv_core::{Discrete, PeriodBlock, Position, Record};

/// Bytes of files from which they are large together, and bytes in memory: packed ones are larger there.
const LARGE: [u64; 2] = [1 << 26, 1 << 28];

/// Whether these records are large. One that cannot be read tells so when it is.
pub(crate) fn is_large(bundle: &Bundle, indices: &[usize]) -> bool {
    let file = |i: &usize| Some(bundle.record_path(*i).ok()?.metadata().ok()?.len());
    let memory = |i: &usize| bundle.memory(*i).ok();
    let sum = |sizes: &mut dyn Iterator<Item = u64>| sizes.fold(0, u64::saturating_add);
    sum(&mut indices.iter().filter_map(file)) > LARGE[0]
        || sum(&mut indices.iter().filter_map(memory)) > LARGE[1]
}

/// What the records of one position give. An error comes with the index of the record, or with the largest one where it is one of
/// all.
pub(super) fn evaluate(
    bundle: &Bundle,
    indices: &[usize],
    position: Option<Position>,
    (clock, skip): (Discrete, SkipRule),
    counter: &Counter<'_>,
) -> Result<AtPosition, (usize, PipelineError)> {
    let read = |i: usize, sink: &mut dyn FnMut(Record)| {
        bundle
            .each_period(i, sink)
            .map_err(|e| (i, PipelineError::from(e)))
    };
    let mut last: Vec<Record> = Vec::with_capacity(indices.len());
    let mut looks: Vec<Look> = Vec::with_capacity(indices.len());
    let mut injected = true;
    for &i in indices {
        let (mut period, mut periods) = (None, 0);
        let mut watch = Watch::new(bundle);
        read(i, &mut |record| {
            watch.push(&record);
            injected &= is_injected(&record);
            periods += 1;
            period = Some(record);
        })?;
        let look = watch.finish();
        if let Some(period) = &mut period {
            look.level(period, periods - 1);
        }
        last.extend(period);
        looks.push(look);
    }
    let with_injection = |mut record: Record| {
        if injected {
            record.references = std::mem::take(&mut record.injection);
        }
        record
    };
    let last: Vec<Record> = last.into_iter().map(with_injection).collect();
    let names: Vec<String> = last.iter().map(|r| r.name.clone()).collect();
    let failed = |source: FrfError| {
        let names = names.iter().map(String::as_str);
        (usize::MAX, place(position.as_ref(), names, source))
    };
    let Some(first) = last.first() else {
        return Err(failed(FrfError::NoRecords));
    };
    if let Some((record, other)) = last.iter().enumerate().find(|(_, r)| r.len() != first.len()) {
        return Err(failed(FrfError::Mismatch {
            record,
            name: other.name.clone(),
            what: "the period",
            expected: first.len() as f64,
            found: other.len() as f64,
        }));
    }
    let layout = Layout {
        period: first.len(),
        outputs: first.outputs.channels(),
        inputs: first.inputs.channels(),
        references: first.references.channels(),
        experiments: indices.len(),
        sample_rate_hz: 1.0 / clock.sample_time(),
    };
    let skip = match skip {
        SkipRule::Fixed(skip) => skip,
        SkipRule::Auto => {
            let mut most = 0;
            for ((&i, last), look) in indices.iter().zip(&last).zip(&looks) {
                let mut settling = Settling::new(signals(last).map(<[f64]>::to_vec).collect());
                let mut period = 0;
                read(i, &mut |mut record| {
                    look.level(&mut record, period);
                    settling.push(signals(&record));
                    period += 1;
                })?;
                most = most.max(settling.unsettled());
            }
            most
        }
    };
    let settings = periodic_settings(SkipRule::Fixed(skip));
    let mut sums = PeriodicAccumulator::new(layout, &settings, position.clone()).map_err(failed)?;
    let mut noise = PeriodNoise::new(layout.outputs, layout.period);
    for (experiment, &i) in indices.iter().enumerate() {
        let (mut period, mut outcome) = (0, Ok(()));
        read(i, &mut |record| {
            let mut record = with_injection(record);
            looks[experiment].level(&mut record, period);
            if outcome.is_ok() {
                outcome = sums.push(&PeriodBlock {
                    experiment,
                    period,
                    outputs: &record.outputs.columns,
                    inputs: &record.inputs.columns,
                    references: &record.references.columns,
                });
            }
            if period >= skip {
                noise.push(record.outputs.columns.iter().map(Vec::as_slice));
            }
            period += 1;
        })?;
        outcome.map_err(failed)?;
        noise.end_record();
        counter.one();
    }
    let estimate = sums.finish().map_err(failed)?;
    Ok(AtPosition::new(bundle, estimate, noise.deviations(), looks))
}

/// Outputs and inputs.
fn signals(record: &Record) -> impl Iterator<Item = &[f64]> {
    let columns = record.outputs.columns.iter().chain(&record.inputs.columns);
    columns.map(Vec::as_slice)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::silent;
    use crate::responses::periodic_responses;
    use crate::test_kit::two_periodic_records;
    use experiment_data::{BundleWriter, RecordFormat};

    #[test]
    fn a_period_at_a_time_gives_what_whole_records_give() {
        let (_folder, bundle) = two_periodic_records();
        let periodic = |i: usize| bundle.description().records[i].is_periodic();
        let indices: Vec<usize> = (0..bundle.len()).filter(|i| periodic(*i)).collect();
        assert!(indices.len() == 2 && !is_large(&bundle, &indices));
        for skip in [None, Some(3)] {
            let whole = periodic_responses(&bundle, periodic, skip, &silent).unwrap();
            let rule = skip.map_or(SkipRule::Auto, SkipRule::Fixed);
            let counter = Counter::new(&silent, "", 2);
            let settings = (bundle.clock().unwrap(), rule);
            let parts = evaluate(
                &bundle,
                &indices,
                whole[0].estimate.estimate.position().cloned(),
                settings,
                &counter,
            );
            let parts = parts.map_err(|(_, e)| e).unwrap();
            assert_eq!(
                format!("{:?}", parts.estimate),
                format!("{:?}", whole[0].estimate)
            );
            assert_eq!(parts.noise, whole[0].noise);
            assert_eq!(parts.records, whole[0].records);
        }
    }

    /// A scheduling sensor has noise: records at one position are never at exactly the same.
    #[test]
    fn a_noisy_position_is_one_position() {
        let (folder, bundle) = two_periodic_records();
        let out = folder.path().join("noisy");
        let mut writer = BundleWriter::create(&out, bundle.description().clone(), RecordFormat::Npz).unwrap();
        for (i, record) in bundle.records().enumerate() {
            let mut record = record.unwrap();
            if record.position.is_some() {
                record.position = None;
                let p = &mut record.scheduling.columns[0];
                p.iter_mut()
                    .enumerate()
                    .for_each(|(k, p)| *p += 1e-7 * (k % (7 + i)) as f64);
            }
            writer.write(&record).unwrap();
        }
        let noisy = writer.finish().unwrap();
        let places: Vec<f64> = (0..2)
            .map(|i| noisy.place(i).unwrap().unwrap().position[0])
            .collect();
        assert!(places[0] != places[1], "{places:?}");
        let periodic = |i: usize| noisy.description().records[i].is_periodic();
        let found = periodic_responses(&noisy, periodic, None, &silent).unwrap();
        assert_eq!(found.len(), 1);
        let position = found[0].estimate.estimate.single_position().unwrap();
        assert!(
            (position - 0.5 * (places[0] + places[1])).abs() < 1e-12,
            "{position}"
        );
    }
}
