//! A record that is held out, and is a copy of one that a model is made from: it judges nothing.
//!
//! Rows are compared by winnowing (Schleimer, Wilkerson, Aiken, SIGMOD 2003): of each run of [`WINDOW`] windows of [`ROWS`] rows
//! the smallest hash is kept, so that a stretch that two records share is found wherever it begins.

use super::Finding;
use lpv_core::Record;
use std::collections::BTreeSet;

/// Rows of a window.
const ROWS: usize = 8;
/// Windows of which one is kept.
const WINDOW: usize = 16;
/// Fewest windows that say something.
const FEWEST: usize = 8;
/// Part of the windows of a held-out record that a fitted one has too.
const PART: f64 = 0.5;

/// Most windows that are kept, those of the smallest hashes: enough for records of any length.
const MOST: usize = 4096;

/// A hash with one more number (the finaliser of SplitMix64).
fn mixed(hash: u64, number: u64) -> u64 {
    let mut h = (hash ^ number).wrapping_add(0x9E37_79B9_7F4A_7C15);
    h = (h ^ (h >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    h ^ (h >> 31)
}

/// A transient record by its windows.
#[derive(Debug, Clone, Default)]
pub(super) struct Prints {
    pub(super) record: String,
    pub(super) held_out: bool,
    windows: BTreeSet<u64>,
}

impl Prints {
    /// Adds the windows of outputs and inputs of a record, or of a part of it, without those in which an output rests.
    pub(super) fn add(&mut self, record: &Record) {
        let columns = || record.outputs.columns.iter().chain(&record.inputs.columns);
        let rows: Vec<u64> = (0..record.len())
            .map(|t| columns().fold(0, |hash, x| mixed(hash, x[t].to_bits())))
            .collect();
        let moves = |t: usize| {
            let mut outputs = record.outputs.columns.iter();
            outputs.all(|y| y[t..t + ROWS].iter().any(|v| *v != y[t]))
        };
        let windows: Vec<u64> = rows
            .windows(ROWS)
            .enumerate()
            .filter(|(t, _)| moves(*t))
            .map(|(_, rows)| rows.iter().fold(0, |hash, row| mixed(hash, *row)))
            .collect();
        for run in windows.windows(WINDOW) {
            self.windows.extend(run.iter().min());
            if self.windows.len() > MOST {
                self.windows.pop_last();
            }
        }
    }
}

/// Held-out records that are copies.
pub(super) fn copies(looks: &[&Prints]) -> Vec<Finding> {
    let (held_out, fitted): (Vec<&Prints>, Vec<&Prints>) = looks
        .iter()
        .filter(|l| l.windows.len() >= FEWEST)
        .partition(|l| l.held_out);
    let same = |a: &Prints, b: &Prints| {
        // Of a long record the windows up to this hash are known.
        let full = b.windows.len() == MOST;
        let known = b.windows.last().filter(|_| full).copied().unwrap_or(u64::MAX);
        let of_a = a.windows.range(..=known);
        let (mut all, mut shared) = (0, 0.0);
        for hash in of_a {
            all += 1;
            shared += f64::from(u8::from(b.windows.contains(hash)));
        }
        all >= FEWEST && shared > PART * all as f64
    };
    let copy = |a: &&Prints| {
        let of = fitted.iter().find(|b| same(a, b))?;
        Some(Finding::HeldOutCopy {
            record: a.record.clone(),
            of: of.record.clone(),
        })
    };
    held_out.iter().filter_map(copy).collect()
}

#[cfg(test)]
mod tests {
    use super::super::kit::{self, Random};
    use super::*;
    use lpv_core::Purpose;

    fn record(name: &str, y: Vec<f64>, u: Vec<f64>, purpose: Purpose) -> Record {
        Record {
            name: name.to_owned(),
            purpose,
            ..kit::record(None, &[], &u, &y)
        }
    }

    fn found(records: &[Record]) -> Vec<Finding> {
        let all: Vec<Prints> = records
            .iter()
            .map(|r| {
                let mut prints = Prints {
                    record: r.name.clone(),
                    held_out: r.purpose == Purpose::Validation,
                    ..Prints::default()
                };
                prints.add(r);
                prints
            })
            .collect();
        copies(&all.iter().collect::<Vec<_>>())
    }

    #[test]
    fn a_copy_is_found_wherever_it_begins_and_however_small_its_numbers_are() {
        for seed in 0..40 {
            let mut random = Random::new(seed);
            let n = 10f64.powf(random.between(2.0, 5.3)) as usize;
            let size = random.decades(9.0);
            let (y, u) = (random.noise(n, size), random.noise(n, 1.0));
            let from = (random.unit() * 0.3 * n as f64) as usize;
            let fit = record("fit", y.clone(), u.clone(), Purpose::Estimation);
            let part = record(
                "part",
                y[from..].to_vec(),
                u[from..].to_vec(),
                Purpose::Validation,
            );
            let other = record("other", random.noise(n, size), u, Purpose::Validation);
            let copy = Finding::HeldOutCopy {
                record: "part".into(),
                of: "fit".into(),
            };
            assert_eq!(found(&[fit, other, part]), vec![copy], "seed {seed}");
        }
    }

    #[test]
    fn readings_of_a_coarse_sensor_are_no_copies() {
        for seed in 0..40 {
            let mut random = Random::new(seed);
            let mut make = |name, purpose| {
                let mut at = 0.0;
                let y = (0..2000).map(|_| {
                    at += random.normal();
                    (at / 4.0).round()
                });
                let y: Vec<f64> = y.collect();
                let u = y.iter().map(|v| -(0.1 * v).round()).collect();
                record(name, y, u, purpose)
            };
            let records = [
                make("fit", Purpose::Estimation),
                make("held", Purpose::Validation),
            ];
            assert_eq!(found(&records), Vec::new(), "seed {seed}");
        }
    }
}
