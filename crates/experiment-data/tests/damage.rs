//! Bytes flipped and cut at seeded places of files of every format: an answer, soon, and no large allocation.
//!
//! A panic inside a crate that decodes a format is caught by ours and becomes an error. How often that happens is
//! printed; a panic of our own would be seen there too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests, too

#[path = "all/broken/hdf5.rs"]
mod hdf5;

use experiment_data::{list_columns, look_into, read_columns};
use rand_like::Numbers;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Damaged versions of each file.
const TIMES: usize = 200;

/// A few numbers without a pattern, the same in every run.
mod rand_like {
    pub(crate) struct Numbers(pub(crate) u64);
    impl Numbers {
        /// Below `n`; Marsaglia's xorshift.
        pub(crate) fn below(&mut self, n: usize) -> usize {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 % n as u64) as usize
        }
    }
}

fn fixtures() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let files = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path());
    let mut files: Vec<PathBuf> = files.filter(|f| f.extension().unwrap() != "py").collect();
    files.sort();
    files
}

fn damaged(whole: &[u8], numbers: &mut Numbers) -> Vec<u8> {
    let mut file = whole.to_vec();
    match numbers.below(8) {
        0 => file.truncate(numbers.below(whole.len())),
        1 => {
            // A piece of the file in the place of another.
            let length = 1 + numbers.below(40);
            let (from, to) = (
                numbers.below(whole.len() - length),
                numbers.below(whole.len() - length),
            );
            file.copy_within(from..from + length, to);
        }
        2 | 3 => {
            let at = numbers.below(whole.len() - 8);
            file[at..at + 1 + numbers.below(8)].fill(0xff);
        }
        _ => {
            for _ in 0..1 + numbers.below(3) {
                file[numbers.below(whole.len())] ^= 1 << numbers.below(8);
            }
        }
    }
    file
}

/// Peak memory of this process, where the system tells it.
fn peak_bytes() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM:"));
    let kilobytes = line.and_then(|l| l.split_whitespace().nth(1)?.parse::<usize>().ok());
    1024 * kilobytes.unwrap_or(0)
}

static PANICS: AtomicUsize = AtomicUsize::new(0);
static OURS: AtomicUsize = AtomicUsize::new(0);

#[test]
fn damage_is_an_error_or_a_record() {
    std::panic::set_hook(Box::new(|info| {
        let ours = info
            .location()
            .is_some_and(|l| l.file().contains("experiment-data"));
        PANICS.fetch_add(1, Ordering::Relaxed);
        if ours {
            OURS.fetch_add(1, Ordering::Relaxed);
            println!("{info}");
        }
    }));
    let dir = tempfile::tempdir().unwrap();
    let mut slowest = (Duration::ZERO, PathBuf::new());
    let mut numbers = Numbers(20_260_701);
    let mut files: Vec<(PathBuf, Vec<u8>)> = fixtures()
        .into_iter()
        .map(|f| (f.clone(), std::fs::read(f).unwrap()))
        .collect();
    let csv = (0..40).fold("f8,f4,\"i1\"\n".to_owned(), |all, k| {
        all + &format!("{k},{}.5e-3,\"{k}\"\r\n", 7 * k)
    });
    files.push((PathBuf::from("table.csv"), csv.into_bytes()));
    for (name, whole) in &files {
        let path = dir.path().join(name.file_name().unwrap());
        let (mut read, before) = (0, PANICS.load(Ordering::Relaxed));
        let newer_hdf5 = whole.windows(4).any(|w| w == b"OHDR");
        let mut sealed = whole.clone();
        hdf5::reseal(&mut sealed);
        assert!(
            sealed == *whole,
            "the checksums of {} are not understood",
            name.display()
        );
        for time in 0..TIMES {
            let mut file = damaged(whole, &mut numbers);
            if newer_hdf5 && time % 2 == 0 {
                hdf5::reseal(&mut file);
            }
            std::fs::write(&path, &file).unwrap();
            let start = Instant::now();
            let listed = list_columns(&path).unwrap_or_default();
            let usual = ["f8", "f4", "i1"];
            let mut names: Vec<&str> = listed.iter().map(|c| c.name.as_str()).collect();
            if names.is_empty() || usual.iter().all(|n| names.contains(n)) {
                names = usual.to_vec();
            }
            read += usize::from(read_columns(&path, &names).is_ok());
            drop(look_into(&path));
            if start.elapsed() > slowest.0 {
                slowest = (start.elapsed(), name.clone());
            }
        }
        println!(
            "{}: {read} of {TIMES} still readable, {} panics caught",
            name.file_name().unwrap().display(),
            PANICS.load(Ordering::Relaxed) - before
        );
    }
    println!(
        "slowest {:?} ({}), peak {} MB",
        slowest.0,
        slowest.1.display(),
        peak_bytes() >> 20
    );
    let _ = std::panic::take_hook();
    assert_eq!(OURS.load(Ordering::Relaxed), 0);
    assert!(slowest.0 < Duration::from_secs(5));
    assert!(peak_bytes() < 1 << 30);
}
