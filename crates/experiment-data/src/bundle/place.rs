//! Where records stand, from their scheduling alone.

use super::{BLOCK, Bundle, scale_column};
use crate::DataError;
use crate::rest::{RestingPlace, Travel};

impl Bundle {
    /// The position that [`Bundle::load`] gives a record, from its scheduling alone, with its resolution.
    ///
    /// # Errors
    /// As [`Bundle::load`].
    pub fn place(&self, index: usize) -> Result<Option<RestingPlace>, DataError> {
        let entry = self.entry(index)?;
        if let Some(declared) = &entry.position {
            return Ok(Some(RestingPlace::declared(declared.clone())));
        }
        if self.description.channels.scheduling.is_empty() || !entry.is_periodic() {
            return Ok(None);
        }
        let travels = self.travels(index)?;
        match travels.iter().all(|travel| travel.mean().is_finite()) {
            true => Ok(Some(RestingPlace::measured(&travels))),
            // What is wrong with it, the record tells best.
            false => Ok(self.each_period(index, |_| ())?.map(RestingPlace::declared)),
        }
    }

    /// Where each scheduling signal of a record has been.
    ///
    /// # Errors
    /// As [`Bundle::load`].
    pub fn travels(&self, index: usize) -> Result<Vec<Travel>, DataError> {
        self.entry(index)?;
        let group = &self.description.channels.scheduling;
        let entry = self.entry(index)?;
        let names: Vec<&str> = group.columns.iter().map(String::as_str).collect();
        let mut travels = vec![Travel::default(); names.len()];
        let path = self.record_path(index)?;
        let read = self.source(entry, &path).each_block(&names, BLOCK, &mut |block| {
            for (k, (travel, mut column)) in travels.iter_mut().zip(block).enumerate() {
                scale_column(group, k, &mut column);
                travel.push(&column);
            }
        });
        if read.is_err() {
            // What is wrong with it, the record tells best.
            self.each_period(index, |_| ())?;
        }
        Ok(travels)
    }

    /// Largest minus smallest value of a scheduling column over all records that can be read, or of the declared positions, if those
    /// differ by more; the others report themselves when they are loaded. Reads that column of every record, once.
    pub fn scheduling_range(&self, column: usize) -> f64 {
        let ranges = self.scheduling_ranges.get_or_init(|| {
            let group = &self.description.channels.scheduling;
            let names: Vec<&str> = group.columns.iter().map(String::as_str).collect();
            let mut all = vec![(f64::INFINITY, f64::NEG_INFINITY); names.len()];
            let take = |range: &mut (f64, f64), v: f64| {
                if v.is_finite() {
                    *range = (range.0.min(v), range.1.max(v));
                }
            };
            let mut declared = all.clone();
            for (index, entry) in self.description.records.iter().enumerate() {
                let said = entry.position.iter().flat_map(|p| p.iter());
                declared
                    .iter_mut()
                    .zip(said)
                    .for_each(|(range, p)| take(range, *p));
                let Ok(path) = self.record_path(index) else {
                    continue;
                };
                if entry.is_response() {
                    continue;
                }
                let mut own = all.clone();
                let source = self.source(&self.description.records[index], &path);
                let read = source.each_block(&names, BLOCK, &mut |block| {
                    for (k, (range, mut column)) in own.iter_mut().zip(block).enumerate() {
                        scale_column(group, k, &mut column);
                        column.iter().for_each(|v| take(range, *v));
                    }
                });
                if read.is_ok() {
                    all = own;
                }
            }
            let width = |(low, high): (f64, f64)| (high - low).max(0.0);
            all.into_iter()
                .zip(declared)
                .map(|(measured, said)| width(measured).max(width(said)))
                .collect()
        });
        ranges.get(column).copied().unwrap_or(0.0)
    }
}
