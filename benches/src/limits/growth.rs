//! How time and memory grow.

use crate::disk;
use crate::works::{self, Work, time};
use crate::{Failure, Growth};
use lpv_benches::Bench;
use lpv_core::{Discrete, StateSpace};
use std::process::Command;

/// What is run, at a size.
type Make<'a> = Box<dyn Fn(usize) -> Result<Work<'a>, Failure> + 'a>;

/// A row before it is measured.
struct Row<'a> {
    what: &'static str,
    sizes: Vec<usize>,
    bar: Option<f64>,
    /// Most MiB that it may take beyond its inputs.
    most_mib: Option<f64>,
    make: Make<'a>,
}

fn rows<'a>(bench: &'a Bench, model: &'a StateSpace<Discrete>) -> Vec<Row<'a>> {
    let row = |what, sizes, bar, make| Row {
        what,
        sizes,
        bar,
        most_mib: None,
        make,
    };
    vec![
        row(
            "regression against positions (1,023 lines, 16 functions)",
            vec![21, 66, 210, 664, 2100],
            Some(1.05),
            Box::new(|n| works::regression(bench, n, 1023, 16)) as Make<'a>,
        ),
        row(
            "regression against lines (one position, 16 functions)",
            (10..=18).map(|i| (1 << i) - 1).collect(),
            Some(1.05),
            Box::new(|n| works::regression(bench, 1, n, 16)),
        ),
        row(
            "regression against functions (one position, 4,095 lines)",
            vec![4, 8, 16, 32, 64],
            None,
            Box::new(|n| works::regression(bench, 1, 4095, n)),
        ),
        row(
            "regression against channels (one position, 255 lines, 4 functions)",
            vec![2, 4, 8, 16],
            None,
            Box::new(|n| works::channels(bench, n)),
        ),
        row(
            "FRF accumulation of four periods against their length (2x2)",
            (10..=18).map(|i| 1 << i).collect(),
            Some(1.05),
            Box::new(|n| works::accumulation(n, 2)),
        ),
        row(
            "beside it, transforms by realfft alone: sixteen real signals against their length",
            (10..=18).map(|i| 1 << i).collect(),
            None,
            Box::new(|n| Ok(works::transforms(n, 16))),
        ),
        row(
            "FRF accumulation of a record against its periods (4,096 samples, 2x2)",
            (2..=12).map(|i| 1 << i).collect(),
            Some(1.05),
            Box::new(works::record),
        ),
        row(
            "FRF accumulation of four periods against channels (period 8,192)",
            vec![2, 4, 8, 16],
            None,
            Box::new(|n| works::accumulation(1 << 13, n)),
        ),
        row(
            "simulation against samples (24 states)",
            (12..=20).map(|i| 1 << i).collect(),
            Some(1.05),
            Box::new(|n| Ok(works::simulation(model, n))),
        ),
        row(
            "simulation at moving p against samples (the plant in its loop)",
            (10..=16).map(|i| 1 << i).collect(),
            Some(1.05),
            Box::new(|n| works::motion(bench, n)),
        ),
        row(
            "frequency response against lines (24 states)",
            (10..=18).map(|i| 1 << i).collect(),
            Some(1.05),
            Box::new(|n| Ok(works::response(model, bench.lines_hz(n)))),
        ),
        row(
            "four steps of a pole fit against lines (order 12, 2x2)",
            (9..=14).map(|i| 1 << i).collect(),
            Some(1.05),
            Box::new(|n| works::poles(bench, n)),
        ),
        row(
            "two steps of an LFR refinement against positions (8 states, 5 deltas, 160 lines)",
            vec![21, 66, 210],
            Some(1.05),
            Box::new(works::refinement_at),
        ),
        Row {
            most_mib: Some(500.0),
            ..row(
                "responses of a bundle on disk against its MB (NPZ, two positions, periods of 32,768 samples)",
                vec![200, 400, 800, 1500, 3000, 6000, 10_400],
                Some(1.05),
                Box::new(disk::responses),
            )
        },
    ]
}

/// All rows; bundles on disk have at most so many GB.
pub(crate) fn all(bench: &Bench, gigabytes: f64) -> Result<Vec<Growth>, Failure> {
    let model = bench.large_model(24)?;
    let mut rows = rows(bench, &model);
    if let Some(disk) = rows.last_mut() {
        disk.sizes.retain(|mb| *mb as f64 <= 1100.0 * gigabytes);
    }
    rows.into_iter().enumerate().map(measured).collect()
}

fn measured((index, row): (usize, Row<'_>)) -> Result<Growth, Failure> {
    let (mut seconds, mut mib) = (Vec::new(), Vec::new());
    for &size in &row.sizes {
        mib.push(memory_of(index, size)?);
        seconds.push(time((row.make)(size)?)?);
    }
    let exponent = slope(&row.sizes, &seconds);
    println!("{}: exponent {exponent:.3}", row.what);
    let mib: Option<Vec<f64>> = mib.into_iter().collect();
    // The upper half, and two at the least.
    let from = (row.sizes.len() / 2).min(row.sizes.len().saturating_sub(2));
    let mib_exponent = mib.as_ref().map(|m| slope(&row.sizes[from..], &m[from..]));
    Ok(Growth {
        mib_exponent: mib_exponent.filter(|e| e.is_finite()),
        upper_exponent: slope(&row.sizes[from..], &seconds[from..]),
        what: row.what,
        sizes: row.sizes,
        seconds,
        exponent,
        bar: row.bar,
        mib,
        most_mib: row.most_mib,
    })
}

/// Slope of the logarithms, least squares.
fn slope(sizes: &[usize], values: &[f64]) -> f64 {
    let points: Vec<(f64, f64)> = sizes
        .iter()
        .zip(values)
        .map(|(n, v)| ((*n as f64).ln(), v.ln()))
        .collect();
    let count = points.len() as f64;
    let (mx, my) = points
        .iter()
        .fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
    let (xy, xx) = points.iter().fold((0.0, 0.0), |(xy, xx), p| {
        (xy + (p.0 - mx) * (p.1 - my), xx + (p.0 - mx).powi(2))
    });
    xy / xx
}

/// What a run takes at its peak beyond its inputs, MiB; none where the system does not tell.
///
/// In a process of its own, whose allocator gives back at once what is freed: nothing that was there before is used again.
fn memory_of(row: usize, size: usize) -> Result<Option<f64>, Failure> {
    let mut child = Command::new(std::env::current_exe()?);
    child.arg("--memory").arg(format!("{row}:{size}"));
    for limit in ["MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"] {
        child.env(limit, "65536");
    }
    let out = child.env("MALLOC_TOP_PAD_", "0").output()?;
    if !out.status.success() {
        return Err(String::from_utf8_lossy(&out.stderr).into_owned().into());
    }
    Ok(String::from_utf8(out.stdout)?.trim().parse().ok())
}

/// The work of that process, `row:size`: tells its memory, or nothing.
pub(crate) fn tell_memory(of: &str) -> Result<(), Failure> {
    let (row, size) = of.split_once(':').ok_or("no row and size")?;
    let bench = Bench::new()?;
    let model = bench.large_model(24)?;
    let rows = rows(&bench, &model);
    let row = rows.get(row.parse::<usize>()?).ok_or("no such row")?;
    let mut work = (row.make)(size.parse()?)?;
    let status = |key: &str| -> Option<f64> {
        let text = std::fs::read_to_string("/proc/self/status").ok()?;
        let line = text
            .lines()
            .find_map(|l| l.strip_prefix(key)?.strip_suffix("kB"))?;
        Some(line.trim().parse::<f64>().ok()? / 1024.0)
    };
    // Forgets the peak of making the inputs.
    let forgotten = std::fs::write("/proc/self/clear_refs", "5").is_ok();
    let before = status("VmRSS:").filter(|_| forgotten);
    work()?;
    if let (Some(before), Some(peak)) = (before, status("VmHWM:")) {
        println!("{}", peak - before);
    }
    Ok(())
}
