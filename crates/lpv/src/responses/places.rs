//! Which records were made at one place. Places are never merged by the size of p, only where records agree within the
//! resolution that they show, or where the same small scatter shows at several places.

use crate::PipelineError;
use experiment_data::{Bundle, RestingPlace, Travel};
use lpv_core::Record;
use std::ops::Range;

/// Part of the largest gap between neighbours below which two positions are either one place, or the unit of p is wrong in a record.
const NEAR: f64 = 1e-3;

/// A record and where it rests.
#[derive(Debug, Clone)]
pub(super) struct Placed {
    /// None without a scheduling signal.
    pub(super) place: Option<RestingPlace>,
    /// Of the record.
    pub(super) name: String,
    /// Of the record, in whatever list it comes from.
    pub(super) index: usize,
}

impl Placed {
    /// A record in memory; its position is a measured one where it is the mean of the scheduling signals.
    pub(super) fn of(record: &Record, index: usize) -> Self {
        let place = record.position.as_ref().map(|position| {
            let columns = record.scheduling.columns.iter();
            let measured = RestingPlace::measured(&columns.map(|p| Travel::of(p)).collect::<Vec<_>>());
            match measured.position == *position {
                true => measured,
                false => RestingPlace::declared(position.clone()),
            }
        });
        Self {
            place,
            name: record.name.clone(),
            index,
        }
    }

    /// The value of the only scheduling signal.
    fn position(&self) -> f64 {
        let place = self.place.as_ref();
        place.and_then(|place| place.position.single()).unwrap_or(0.0)
    }

    fn signals(&self) -> usize {
        self.place.as_ref().map_or(0, |place| place.position.len())
    }

    fn agrees(&self, other: &Self) -> bool {
        match (&self.place, &other.place) {
            (Some(a), Some(b)) => a.agrees(b),
            (None, None) => true,
            _ => false,
        }
    }

    fn declared(&self) -> bool {
        self.place.as_ref().is_some_and(|place| place.declared)
    }
}

/// Sorts by position, then by name, and gives the run of each place.
///
/// # Errors
/// [`PipelineError::Places`] where it is not clear whether two records are at one place.
pub(super) fn runs(records: &mut [Placed]) -> Result<Vec<Range<usize>>, PipelineError> {
    if records.iter().any(|r| r.signals() > 1) {
        return Ok(of_several(records));
    }
    let by_position = |a: &Placed, b: &Placed| a.position().total_cmp(&b.position());
    records.sort_by(|a, b| by_position(a, b).then_with(|| a.name.cmp(&b.name)));
    let gap = |i: usize| records[i + 1].position() - records[i].position();
    let gaps = records.len().saturating_sub(1);
    let largest = (0..gaps).map(gap).fold(0.0, f64::max);
    let agree = |i: usize| records[i].agrees(&records[i + 1]);
    let near = |i: usize| {
        let said = records[i].declared() && records[i + 1].declared();
        !said && gap(i) <= NEAR * largest
    };
    let mut found = Vec::new();
    let mut first = 0;
    // The first doubtful gap of each place that has one.
    let mut doubtful: Vec<usize> = Vec::new();
    let mut doubt = None;
    for i in 0..records.len() {
        if i < gaps && agree(i) {
            continue;
        }
        if i < gaps && near(i) {
            doubt = doubt.or(Some(i));
            continue;
        }
        found.push(first..i + 1);
        doubtful.extend(doubt.take());
        first = i + 1;
    }
    // A scatter that several places have is one of the machine; of one place alone it is a riddle.
    if let [at] = doubtful.as_slice() {
        let far = if gap(gaps - 1) == largest {
            gaps
        } else if gap(0) == largest {
            0
        } else {
            (0..gaps).find(|i| gap(*i) == largest).map_or(gaps, |i| i + 1)
        };
        let of = |i: usize| (records[i].name.clone(), records[i].position());
        return Err(PipelineError::Places {
            pair: Box::new([of(*at), of(at + 1)]),
            far: Box::new(of(far)),
            gaps: [gap(*at), largest],
        });
    }
    Ok(found)
}

/// The same for several scheduling signals: records are at one place if they agree in all.
fn of_several(records: &mut [Placed]) -> Vec<Range<usize>> {
    records.sort_by(|a, b| a.name.cmp(&b.name));
    let mut found: Vec<Range<usize>> = Vec::new();
    let mut first = 0;
    while first < records.len() {
        let mut end = first + 1;
        for i in first + 1..records.len() {
            if records[first].agrees(&records[i]) {
                records[end..=i].rotate_right(1);
                end += 1;
            }
        }
        found.push(first..end);
        first = end;
    }
    found
}

/// Refuses records at different places, and those that move, where p has several scheduling signals: what is identified and validated
/// here has one.
///
/// # Errors
/// [`PipelineError::SchedulingSignals`]; what is wrong with a record that would be named.
pub(crate) fn one_signal(bundle: &Bundle, indices: &[usize]) -> Result<(), PipelineError> {
    if !several_signals(bundle) {
        return Ok(());
    }
    let columns = &bundle.description().channels.scheduling.columns;
    let refuse = |records: [(usize, Vec<f64>); 2]| -> Result<(), PipelineError> {
        let named = |(index, p): (usize, Vec<f64>)| -> Result<_, PipelineError> {
            // What is wrong with the record goes before.
            if !bundle.description().records[index].is_response() {
                bundle.each_period(index, |_| ())?;
            }
            Ok((bundle.record_name(index)?.to_owned(), p))
        };
        let [a, b] = records;
        let names = match columns.is_empty() {
            true => (0..a.1.len()).map(|k| format!("position[{k}]")).collect(),
            false => columns.clone(),
        };
        Err(PipelineError::SchedulingSignals {
            columns: names,
            records: Box::new([named(a)?, named(b)?]),
            measured: !columns.is_empty(),
        })
    };
    let mut first: Option<(usize, RestingPlace)> = None;
    for &index in indices {
        let declared = bundle.description().records[index].position.clone();
        let own = match declared {
            Some(declared) => RestingPlace::declared(declared),
            // It says nothing of where it was made.
            None if columns.is_empty() => continue,
            None => {
                let travels = bundle.travels(index)?;
                let rests = |(k, travel): (usize, &Travel)| travel.rests(|| bundle.scheduling_range(k));
                if !travels.iter().enumerate().all(rests) {
                    let ends = [Travel::low, Travel::high].map(|end| travels.iter().map(end).collect());
                    let [low, high]: [Vec<f64>; 2] = ends;
                    return refuse([(index, low), (index, high)]);
                }
                RestingPlace::measured(&travels)
            }
        };
        match &first {
            None => first = Some((index, own)),
            Some((other, place)) if !place.agrees(&own) => {
                return refuse([(*other, place.position.to_vec()), (index, own.position.to_vec())]);
            }
            Some(_) => {}
        }
    }
    Ok(())
}

/// Whether records tell places apart, by a signal or by their positions.
pub(crate) fn is_scheduled(bundle: &Bundle) -> bool {
    let description = bundle.description();
    let mut declared = description.records.iter().filter_map(|r| r.position.as_ref());
    let first = declared.next();
    !description.channels.scheduling.is_empty() || declared.any(|p| Some(p) != first)
}

/// Whether p has several scheduling signals.
pub(crate) fn several_signals(bundle: &Bundle) -> bool {
    let description = bundle.description();
    let declared = description.records.iter().find_map(|r| r.position.as_ref());
    description.channels.scheduling.len() > 1 || declared.is_some_and(|p| p.len() > 1)
}

/// Whether the scheduling signal that a model has rests in a record.
pub(crate) fn rests(record: &Record, bundle: &Bundle) -> bool {
    let first = record.scheduling.columns.first();
    first.is_none_or(|p| Travel::of(p).rests(|| bundle.scheduling_range(0)))
}

/// A transient record whose one scheduling signal rests is a record at that position.
pub(super) fn rest_position(record: &mut Record, bundle: &Bundle) {
    if record.position.is_none()
        && let [p] = record.scheduling.columns.as_slice()
        && rests(record, bundle)
    {
        record.position = Some(Travel::of(p).mean().into());
    }
}

#[cfg(test)]
mod tests {
    use super::{Placed, runs};
    use crate::PipelineError;
    use experiment_data::{RestingPlace, Travel};

    fn placed(index: usize, samples: &[f64]) -> Placed {
        Placed {
            place: Some(RestingPlace::measured(&[Travel::of(samples)])),
            name: format!("r{index}"),
            index,
        }
    }

    fn of(positions: &[f64]) -> Vec<Placed> {
        positions
            .iter()
            .enumerate()
            .map(|(i, p)| placed(i, &[*p]))
            .collect()
    }

    fn sizes(mut records: Vec<Placed>) -> Option<Vec<usize>> {
        runs(&mut records)
            .ok()
            .map(|r| r.into_iter().map(|r| r.len()).collect())
    }

    #[test]
    fn places_in_the_plane_are_one_where_both_signals_agree() {
        let at = |index: usize, p: [f64; 2], spread: f64| Placed {
            place: Some(RestingPlace::measured(
                &p.map(|p| Travel::of(&[p - spread, p + spread])),
            )),
            name: format!("r{index}"),
            index,
        };
        for unit in [1e-6, 1.0, 1e6] {
            let all = [
                [0.0, 0.0],
                [0.0, 1.0],
                [1e-4, 0.0],
                [1.0, 1.0],
                [0.0, 1.0001],
                [0.0, 0.5],
            ];
            let mut records: Vec<Placed> = all
                .iter()
                .enumerate()
                .map(|(i, p)| at(i, p.map(|p| unit * p), unit * 1e-3))
                .collect();
            let runs = runs(&mut records).unwrap();
            let found: Vec<Vec<usize>> = runs
                .into_iter()
                .map(|run| records[run].iter().map(|r| r.index).collect())
                .collect();
            assert_eq!(found, [vec![0, 2], vec![1, 4], vec![3], vec![5]]);
        }
    }

    #[test]
    fn zero_and_unit_of_p_do_not_merge_places() {
        for (zero, unit) in [(0.0, 1.0), (6e4, 1.0), (2e6, 1.0), (-5.0, 1e-9), (1e9, 1e3)] {
            let at = |p: &[f64]| of(&p.iter().map(|p| zero + unit * p).collect::<Vec<_>>());
            assert_eq!(sizes(at(&[-1.0, -0.5, 0.0, 0.5, 1.0])), Some(vec![1; 5]));
            assert_eq!(sizes(at(&[0.0, 1.0, 0.0, 1.0])), Some(vec![2, 2]));
            // The same scatter at every place.
            assert_eq!(sizes(at(&[0.0, 2e-4, 1.0, 1.0001])), Some(vec![2, 2]));
            assert_eq!(sizes(at(&[1.0, 0.5, 0.5002, 0.0001, 0.0])), Some(vec![2, 2, 1]));
            // Distinct, if not by much.
            assert_eq!(sizes(at(&[0.0, 0.002, 1.0])), Some(vec![1, 1, 1]));
        }
    }

    #[test]
    fn records_show_their_resolution() {
        let noisy = |i: usize, p: f64| placed(i, &[p - 1e-3, p + 1e-3, p - 1e-3, p + 1e-3]);
        let records = vec![noisy(0, 0.1), noisy(1, 0.1015), noisy(2, 0.2), noisy(3, 0.3)];
        assert_eq!(sizes(records), Some(vec![2, 1, 1]));
    }

    #[test]
    fn one_record_in_another_unit_merges_nothing() {
        for factor in [1e3, 1e6, 1e9] {
            for wrong in 0..5 {
                let mut p = [-0.3, -0.15, 0.0, 0.14, 0.31];
                p[wrong] *= factor;
                let mut records = of(&p);
                match runs(&mut records) {
                    Ok(found) => assert_eq!(found.len(), 5),
                    Err(PipelineError::Places { far, .. }) => assert_eq!(far.0, format!("r{wrong}")),
                    Err(other) => panic!("{other}"),
                }
            }
        }
        // Who says the positions is believed.
        let mut records = of(&[0.0, 0.15, 300.0]);
        for record in &mut records {
            record.place = record
                .place
                .take()
                .map(|place| RestingPlace::declared(place.position));
        }
        assert_eq!(sizes(records), Some(vec![1, 1, 1]));
    }
}
