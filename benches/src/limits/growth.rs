//! How time and memory grow.

use crate::works::{self, Work, time};
use crate::{Failure, Growth};
use lpv_benches::Bench;

/// What a run takes at its peak beyond what was in memory before; none where the system does not tell.
fn peak_mib(work: &mut Work<'_>) -> Result<Option<f64>, Failure> {
    let status = |key: &str| -> Option<f64> {
        let text = std::fs::read_to_string("/proc/self/status").ok()?;
        let line = text
            .lines()
            .find_map(|l| l.strip_prefix(key)?.strip_suffix("kB"))?;
        Some(line.trim().parse::<f64>().ok()? / 1024.0)
    };
    // Forgets the peaks of the runs before.
    let forgotten = std::fs::write("/proc/self/clear_refs", "5").is_ok();
    let before = status("VmRSS:");
    work()?;
    let peak = status("VmHWM:").filter(|_| forgotten);
    Ok(before.zip(peak).map(|(before, peak)| peak - before))
}

/// All rows.
pub(crate) fn all(bench: &Bench) -> Result<Vec<Growth>, Failure> {
    let model = bench.large_model(24)?;
    Ok(vec![
        over(
            "regression against positions (1,023 lines, 16 functions)",
            vec![21, 66, 210, 664, 2100],
            Some(1.05),
            &|n| works::regression(bench, n, 1023, 16),
        )?,
        over(
            "regression against lines (one position, 16 functions)",
            (10..=18).map(|i| (1 << i) - 1).collect(),
            Some(1.05),
            &|n| works::regression(bench, 1, n, 16),
        )?,
        over(
            "regression against functions (one position, 4,095 lines)",
            vec![4, 8, 16, 32, 64],
            None,
            &|n| works::regression(bench, 1, 4095, n),
        )?,
        over(
            "FRF accumulation against the length of the period (2x2)",
            (10..=18).map(|i| 1 << i).collect(),
            Some(1.05),
            &|n| works::accumulation(n, 2),
        )?,
        over(
            "FRF accumulation against channels (period 8,192)",
            vec![2, 4, 8, 16],
            None,
            &|n| works::accumulation(1 << 13, n),
        )?,
        over(
            "simulation against samples (24 states)",
            (12..=20).map(|i| 1 << i).collect(),
            Some(1.05),
            &|n| Ok(works::simulation(&model, n)),
        )?,
    ])
}

/// One row: what is measured at these sizes.
fn over<'a>(
    what: &'static str,
    sizes: Vec<usize>,
    bar: Option<f64>,
    make: &dyn Fn(usize) -> Result<Work<'a>, Failure>,
) -> Result<Growth, Failure> {
    let (mut seconds, mut mib) = (Vec::new(), Vec::new());
    for size in &sizes {
        let mut work = make(*size)?;
        mib.push(peak_mib(&mut work)?);
        seconds.push(time(work)?);
    }
    let points: Vec<(f64, f64)> = sizes
        .iter()
        .zip(&seconds)
        .map(|(n, s)| ((*n as f64).ln(), s.ln()))
        .collect();
    let count = points.len() as f64;
    let (mx, my) = points
        .iter()
        .fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
    let (xy, xx) = points.iter().fold((0.0, 0.0), |(xy, xx), p| {
        (xy + (p.0 - mx) * (p.1 - my), xx + (p.0 - mx).powi(2))
    });
    let exponent = xy / xx;
    println!("{what}: exponent {exponent:.3}");
    Ok(Growth {
        what,
        sizes,
        seconds,
        exponent,
        bar,
        mib: mib.into_iter().collect(),
    })
}
