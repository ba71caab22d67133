//! What all records say together, and columns of times that no description names.

use super::Finding;
use super::clock::is_clock;
use super::compare::{Names, Voice, compare};
use super::copies::copies;
use super::places::places;
use super::transient::odd_ones;
use super::watch::{Look, clock_finding};
use experiment_data::Bundle;
use rayon::prelude::*;

/// What all records say, each by itself and against each other.
pub(crate) fn examine<'b>(
    bundle: &Bundle,
    looks: impl Iterator<Item = &'b Look>,
    voices: &[Voice],
) -> Vec<Finding> {
    let looks: Vec<&Look> = looks.collect();
    let channels = &bundle.description().channels;
    let names = Names {
        outputs: &channels.output.columns,
        inputs: &channels.input.columns,
    };
    let mut found: Vec<Finding> = looks.iter().flat_map(|l| l.findings.iter().cloned()).collect();
    let at = looks
        .iter()
        .filter_map(|l| Some((l.record.as_str(), l.scheduling?)));
    found.extend(places(&at.collect::<Vec<_>>()));
    found.extend(copies(&looks.iter().map(|l| &l.prints).collect::<Vec<_>>()));
    let spectra: Vec<_> = looks.iter().filter_map(|l| l.spectrum.as_ref()).collect();
    for other in compare(voices, &names)
        .into_iter()
        .chain(odd_ones(&spectra, &names))
    {
        // The cause goes before what it does to the controller.
        let follows =
            |f: &Finding| matches!(f, Finding::ControllerMismatch { record, .. } if record == other.place());
        found.retain(|f| !follows(f));
        found.push(other);
    }
    found
}

/// Files up to this size are searched for a column of times that the description does not name.
const SMALL: u64 = 1 << 26;

/// What columns of times say that are in the files and not in the description.
pub(crate) fn clocks(bundle: &Bundle, wanted: impl Fn(usize) -> bool + Sync) -> Vec<Finding> {
    let c = &bundle.description().channels;
    let groups = [&c.output, &c.input, &c.reference, &c.scheduling, &c.auxiliary];
    let named = |column: &str| groups.iter().any(|g| g.columns.iter().any(|c| c == column));
    let of = |index: usize| -> Option<Finding> {
        let path = bundle.record_path(index).ok()?;
        let kind = path.extension()?.to_str()?.to_lowercase();
        if !matches!(kind.as_str(), "csv" | "txt" | "dat" | "log" | "asc" | "tsv")
            || path.metadata().ok()?.len() > SMALL
        {
            return None;
        }
        let columns = experiment_data::list_columns(&path).ok()?;
        let clock = columns
            .into_iter()
            .map(|c| c.name)
            .find(|c| is_clock(c) && !named(c))?;
        let samples = experiment_data::read_columns(&path, &[clock.as_str()]).ok()?;
        let record = bundle.record_name(index).ok()?.to_owned();
        clock_finding(record, clock, samples.first()?)
    };
    let indices: Vec<usize> = (0..bundle.len()).filter(|i| wanted(*i)).collect();
    indices.into_par_iter().filter_map(of).collect()
}
