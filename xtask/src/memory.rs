//! Time and peak memory of work in this process.

use std::time::Instant;

/// What some work took.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Taken {
    pub(crate) seconds: f64,
    /// Peak of the resident memory of the process meanwhile, MiB, where the system tells (Linux).
    pub(crate) mib: Option<f64>,
}

pub(crate) fn measured<T>(work: impl FnOnce() -> T) -> (T, Taken) {
    // Counts the peak from here on.
    let is_fresh = std::fs::write("/proc/self/clear_refs", "5").is_ok();
    let begin = Instant::now();
    let result = work();
    let seconds = begin.elapsed().as_secs_f64();
    let mib = peak_mib().filter(|_| is_fresh);
    (result, Taken { seconds, mib })
}

/// Peak of the resident memory of this process, MiB, where the system tells.
pub(crate) fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}
