//! How near the hot kernels are to what the machine can do, and how their times grow.
//!
//! `cargo xtask limits` runs this, on one thread. Operations and bytes are the least that the method of a kernel needs, not those that
//! the code happens to do.

use clap::Parser;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use lpv_benches::{Bench, accumulator};
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{PeriodBlock, StateSpace};
use lpv_ident::{RegressionSettings, regress};
use serde::Serialize;
use std::error::Error;
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

type Failure = Box<dyn Error + Send + Sync>;

/// Measures roofline fractions and growth, and writes limits.json and the tables of docs/limits.md.
#[derive(Parser)]
#[command(name = "cargo xtask limits")]
struct Arguments {
    /// Write docs/limits.md too.
    #[arg(long)]
    bless: bool,
    /// Where limits.json goes.
    #[arg(long, default_value = "target/limits")]
    output: PathBuf,
}

/// A kernel beside the speed that limits it.
#[derive(Debug, Serialize)]
struct Kernel {
    kernel: &'static str,
    seconds: f64,
    /// Floating-point operations that it needs.
    operations: f64,
    /// Bytes that it must read or write.
    bytes: f64,
    /// `compute` or `memory`, whichever takes longer at the limit.
    limit: &'static str,
    /// Time at the limit over the time that it takes.
    fraction: f64,
    bar: Option<f64>,
}

/// Times against a size.
#[derive(Debug, Serialize)]
struct Growth {
    what: &'static str,
    sizes: Vec<usize>,
    seconds: Vec<f64>,
    /// Slope of the logarithms, least squares.
    exponent: f64,
    bar: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Account {
    /// Operations a second of a product of matrices, one thread.
    gemm: f64,
    /// Bytes a second that a copy reads and writes, one thread.
    copy: f64,
    kernels: Vec<Kernel>,
    growth: Vec<Growth>,
}

fn main() -> ExitCode {
    match measure(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Median time of several runs, of which the first does not count.
fn time(mut run: impl FnMut() -> Result<(), Failure>) -> Result<f64, Failure> {
    const RUNS: usize = 7;
    /// A run is repeated until it takes so long, seconds.
    const LEAST: f64 = 0.01;
    run()?;
    let mut times = Vec::new();
    for _ in 0..RUNS {
        let (start, mut count) = (Instant::now(), 0.0);
        while count == 0.0 || start.elapsed().as_secs_f64() < LEAST {
            run()?;
            count += 1.0;
        }
        times.push(start.elapsed().as_secs_f64() / count);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[RUNS / 2])
}

fn gemm_speed() -> Result<f64, Failure> {
    const N: usize = 1024;
    let a = Mat::<f64>::from_fn(N, N, |i, j| (i + 3 * j) as f64 * 1e-3);
    let mut c = Mat::<f64>::zeros(N, N);
    let seconds = time(|| {
        matmul(c.as_mut(), Accum::Replace, a.as_ref(), a.as_ref(), 1.0, Par::Seq);
        black_box(&c);
        Ok(())
    })?;
    Ok(2.0 * (N as f64).powi(3) / seconds)
}

fn copy_speed() -> Result<f64, Failure> {
    const N: usize = 1 << 25;
    let from = vec![1.0_f64; N];
    let mut to = vec![0.0_f64; N];
    let seconds = time(|| {
        to.copy_from_slice(black_box(&from));
        black_box(&to);
        Ok(())
    })?;
    Ok(16.0 * N as f64 / seconds)
}

fn regression(bench: &Bench, positions: usize, lines: usize, functions: usize) -> Result<f64, Failure> {
    let (estimates, basis) = (bench.estimates(positions, lines)?, bench.basis(functions)?);
    let settings = RegressionSettings::new().diagonal_rigid_body(2).check()?;
    time(|| {
        black_box(regress(&estimates, &basis, &settings)?);
        Ok(())
    })
}

/// Signals of a period: no kernel asks what they mean.
fn period(length: usize, channels: usize, seed: usize) -> Vec<Vec<f64>> {
    (0..channels)
        .map(|c| {
            (0..length)
                .map(|k| ((k * (seed + 2 * c + 3)) % 1009) as f64 - 504.0)
                .collect()
        })
        .collect()
}

/// Seconds a period pushed, for one experiment of many.
fn accumulation(length: usize, channels: usize) -> Result<f64, Failure> {
    let mut sums = accumulator(length, channels, None)?;
    let (outputs, inputs, references) = (
        period(length, channels, 1),
        period(length, channels, 2),
        period(length, channels, 5),
    );
    let mut count = 0;
    time(|| {
        sums.push(&PeriodBlock {
            experiment: 0,
            period: count,
            outputs: &outputs,
            inputs: &inputs,
            references: &references,
        })?;
        count += 1;
        Ok(())
    })
}

fn simulation(model: &StateSpace<lpv_core::Discrete>, samples: usize) -> Result<f64, Failure> {
    let inputs = DMatrix::from_fn(model.inputs(), samples, |i, k| ((k * (i + 2)) % 17) as f64 - 8.0);
    let rest = DVector::zeros(model.states());
    time(|| {
        black_box(model.simulate(&rest, &inputs)?);
        Ok(())
    })
}

fn kernels(bench: &Bench, gemm: f64, copy: f64) -> Result<Vec<Kernel>, Failure> {
    let of = |kernel, seconds: f64, operations: f64, bytes: f64, bar| {
        let (compute, memory) = (operations / gemm, bytes / copy);
        Kernel {
            kernel,
            seconds,
            operations,
            bytes,
            limit: if compute > memory { "compute" } else { "memory" },
            fraction: compute.max(memory) / seconds,
            bar,
        }
    };
    // Sums of products of 64 unknowns and two gains, weighted; and, twice, the gradient of what is left, once with a model.
    const LINES: usize = (1 << 14) - 1;
    const POSITIONS: usize = 21;
    let columns = 66.0;
    let a_line = columns * (columns + 1.0) + 2.0 * 4.0 * columns + 4.0 * columns;
    let regression = of(
        "regression core: 21 positions, 16,383 lines, 16 functions, 2x2",
        regression(bench, POSITIONS, LINES, 16)?,
        (POSITIONS * LINES) as f64 * a_line,
        // Response and covariances are read twice, the responses of the functions once.
        LINES as f64 * 16.0 * (POSITIONS as f64 * 2.0 * 12.0 + 16.0),
        Some(0.5),
    );
    const PERIOD: usize = 1 << 15;
    let n = PERIOD as f64;
    let transform = 2.5 * n * n.log2();
    let accumulation = of(
        "FRF accumulation: a period of 32,768 samples, 2x2",
        accumulation(PERIOD, 2)?,
        // Four transforms of real signals, sums of ten products of the spectra.
        4.0 * transform + 0.5 * n * 8.0 * 10.0,
        // Signals in; sums of the means and of the products in and out.
        n * (8.0 * 6.0 + 0.5 * 2.0 * 8.0 * 24.0),
        Some(0.6),
    );
    let model = bench.large_model(24)?;
    let lines = bench.lines_hz(2000);
    let response = of(
        "frequency response: 24 states, 2,000 lines, 2x2",
        time(|| {
            black_box(model.frequency_response(&lines)?);
            Ok(())
        })?,
        // A Hessenberg matrix is eliminated and solved with two right sides, complex numbers of eight operations.
        2000.0 * 8.0 * (0.5 * 24.0 * 24.0 + 2.0 * (0.5 * 24.0 * 24.0 + 24.0) + 2.0 * 2.0 * 24.0),
        2000.0 * 4.0 * 16.0,
        None,
    );
    const SAMPLES: usize = 1 << 14;
    let simulation = of(
        "simulation at constant p: 24 states, 16,384 samples",
        simulation(&model, SAMPLES)?,
        2.0 * 26.0 * 26.0 * SAMPLES as f64,
        32.0 * SAMPLES as f64,
        None,
    );
    Ok(vec![regression, accumulation, response, simulation])
}

fn growth(bench: &Bench) -> Result<Vec<Growth>, Failure> {
    let over = |what,
                sizes: Vec<usize>,
                bar,
                run: &dyn Fn(usize) -> Result<f64, Failure>|
     -> Result<Growth, Failure> {
        let seconds = sizes.iter().map(|n| run(*n)).collect::<Result<Vec<f64>, _>>()?;
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
        })
    };
    let model = bench.large_model(24)?;
    Ok(vec![
        over(
            "regression against positions (1,023 lines, 16 functions)",
            vec![21, 84, 336, 1344],
            Some(1.05),
            &|n| regression(bench, n, 1023, 16),
        )?,
        over(
            "regression against lines (one position, 16 functions)",
            (10..=18).map(|i| (1 << i) - 1).collect(),
            Some(1.05),
            &|n| regression(bench, 1, n, 16),
        )?,
        over(
            "regression against functions (one position, 4,095 lines)",
            vec![4, 8, 16, 32, 64],
            None,
            &|n| regression(bench, 1, 4095, n),
        )?,
        over(
            "FRF accumulation against the length of the period (2x2)",
            (10..=18).map(|i| 1 << i).collect(),
            Some(1.05),
            &|n| accumulation(n, 2),
        )?,
        over(
            "FRF accumulation against channels (period 8,192)",
            vec![2, 4, 8, 16],
            None,
            &|n| accumulation(1 << 13, n),
        )?,
        over(
            "simulation against samples (24 states)",
            (12..=20).map(|i| 1 << i).collect(),
            Some(1.05),
            &|n| simulation(&model, n),
        )?,
    ])
}

fn measure(arguments: &Arguments) -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let bench = Bench::new()?;
    let (gemm, copy) = (gemm_speed()?, copy_speed()?);
    let account = Account {
        gemm,
        copy,
        kernels: kernels(&bench, gemm, copy)?,
        growth: growth(&bench)?,
    };
    let page = page(&account);
    print!("{page}");
    std::fs::create_dir_all(&arguments.output)?;
    std::fs::write(
        arguments.output.join("limits.json"),
        serde_json::to_string_pretty(&account)?,
    )?;
    if arguments.bless {
        std::fs::write("docs/limits.md", page)?;
    }
    Ok(())
}

fn page(account: &Account) -> String {
    let mut out = format!(
        "# Limits and growth\n\nMade by `cargo xtask limits --bless`, on one thread; medians of 7. This machine multiplies matrices at \
         {:.1} Gflop/s and copies at {:.1} GB/s (read and written).\n\n\
         ## How near the limit\n\nThe time that the operations (at the speed of that product) or the bytes (at the speed of that copy) \
         need, whichever is longer, over the time taken.\n\n\
         | kernel | time | Mflop | MB | limited by | fraction | bar |\n|---|---|---|---|---|---|---|\n",
        1e-9 * account.gemm,
        1e-9 * account.copy
    );
    let verdict = |bar: Option<f64>, met: bool| match bar {
        Some(bar) => format!("{bar}: {}", if met { "met" } else { "MISSED" }),
        None => "-".to_owned(),
    };
    for k in &account.kernels {
        let _ = writeln!(
            out,
            "| {} | {:.3} ms | {:.1} | {:.2} | {} | {:.0} % | {} |",
            k.kernel,
            1e3 * k.seconds,
            1e-6 * k.operations,
            1e-6 * k.bytes,
            k.limit,
            100.0 * k.fraction,
            verdict(k.bar, k.bar.is_none_or(|b| k.fraction >= b))
        );
    }
    out += "\nFRF: what a period taken alone brings, and what is kept of it, in and out; four are taken together, so that less goes by than is \
            counted. Regression: the sums of products themselves, two fifths of the time, run at half the speed of the matrix product; the \
            correction by what the equations leave takes three tenths, weights from the covariances the rest. Without the correction the \
            result would lose twice as many digits to the condition of the functions.\n\
            \n## Growth\n\nA transform of N samples takes N log N operations: from 2^10 to 2^18 that alone is an exponent of 1.11; what is kept of an \
            experiment (192 bytes a line) no longer fits the second cache from 2^15 on.\n\n| time | sizes | milliseconds | exponent | bar |\n|---|---|---|---|---|\n";
    for g in &account.growth {
        let list = |v: Vec<String>| v.join(", ");
        let _ = writeln!(
            out,
            "| {} | {} | {} | {:.2} | {} |",
            g.what,
            list(g.sizes.iter().map(usize::to_string).collect()),
            list(g.seconds.iter().map(|s| format!("{:.3}", 1e3 * s)).collect()),
            g.exponent,
            verdict(g.bar, g.bar.is_none_or(|b| g.exponent <= b))
        );
    }
    out
}
