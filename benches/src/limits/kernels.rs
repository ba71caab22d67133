//! The kernels beside the speeds that limit them.

use crate::works::{self, time};
use crate::{Failure, Kernel};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use lpv_benches::Bench;
use lpv_benches::refinement::{self, Case};
use std::hint::black_box;

/// Operations a second of a product of matrices.
pub(crate) fn gemm_speed() -> Result<f64, Failure> {
    const N: usize = 1024;
    let a = Mat::<f64>::from_fn(N, N, |i, j| (i + 3 * j) as f64 * 1e-3);
    let mut c = Mat::<f64>::zeros(N, N);
    let seconds = time(Box::new(|| {
        matmul(c.as_mut(), Accum::Replace, a.as_ref(), a.as_ref(), 1.0, Par::Seq);
        black_box(&c);
        Ok(())
    }))?;
    Ok(2.0 * (N as f64).powi(3) / seconds)
}

/// Bytes a second that a copy reads and writes.
pub(crate) fn copy_speed() -> Result<f64, Failure> {
    const N: usize = 1 << 25;
    let from = vec![1.0_f64; N];
    let mut to = vec![0.0_f64; N];
    let seconds = time(Box::new(|| {
        to.copy_from_slice(black_box(&from));
        black_box(&to);
        Ok(())
    }))?;
    Ok(16.0 * N as f64 / seconds)
}

pub(crate) fn all(bench: &Bench, gemm: f64, copy: f64) -> Result<Vec<Kernel>, Failure> {
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
    // Sums of products of 64 unknowns and two gains, weighted, and their right side.
    const LINES: usize = (1 << 14) - 1;
    const POSITIONS: usize = 21;
    let columns = 66.0;
    let a_line = columns * (columns + 1.0) + 4.0 * columns;
    let regression = of(
        "regression core: 21 positions, 16,383 lines, 16 functions, 2x2",
        time(works::regression(bench, POSITIONS, LINES, 16)?)?,
        (POSITIONS * LINES) as f64 * a_line,
        // Response, covariances, and the responses of the functions.
        LINES as f64 * 16.0 * (POSITIONS as f64 * 12.0 + 16.0),
        Some(0.5),
    );
    const PERIOD: usize = 1 << 15;
    let n = PERIOD as f64;
    let transform = 2.5 * n * n.log2();
    let accumulation = of(
        "FRF accumulation: a period of 32,768 samples, 2x2",
        time(works::accumulation(PERIOD, 2)?)? / works::TOGETHER as f64,
        // Four transforms of real signals, sums of ten products of the spectra.
        4.0 * transform + 0.5 * n * 8.0 * 10.0,
        // Signals in; sums of the means and of the products in and out, once for two periods.
        n * (8.0 * 6.0 + 0.5 * 2.0 * 8.0 * 24.0 / 2.0),
        Some(0.6),
    );
    let transforms = of(
        "its transforms alone: four of 32,768 real samples",
        time(works::transforms(PERIOD, 4))?,
        4.0 * transform,
        4.0 * n * 16.0,
        None,
    );
    let model = bench.large_model(24)?;
    let lines = bench.lines_hz(2000);
    let response = of(
        "frequency response: 24 states, 2,000 lines, 2x2",
        time(works::response(&model, lines))?,
        // A Hessenberg matrix is eliminated and solved with two right sides, complex numbers of eight operations.
        2000.0 * 8.0 * (0.5 * 24.0 * 24.0 + 2.0 * (0.5 * 24.0 * 24.0 + 24.0) + 2.0 * 2.0 * 24.0),
        2000.0 * 4.0 * 16.0,
        None,
    );
    const SAMPLES: usize = 1 << 14;
    let simulation = of(
        "simulation at constant p: 24 states, 16,384 samples",
        time(works::simulation(&model, SAMPLES))?,
        2.0 * 26.0 * 26.0 * SAMPLES as f64,
        32.0 * SAMPLES as f64,
        None,
    );
    const MOVES: usize = 4000;
    // Terms of the Taylor series that rounding does not hide at the highest mode: (w T)^16 / 16! is 2e-16.
    const TERMS: f64 = 16.0;
    let motion = of(
        "simulation at moving p: the plant in its loop, 4,000 samples",
        time(works::motion(bench, MOVES)?)?,
        // Of a term: three products with the polynomial of p, two forces, four accelerations, eight sums; three control laws.
        MOVES as f64 * (TERMS * 52.0 + 3.0 * 18.0),
        8.0 * 10.0 * MOVES as f64,
        None,
    );
    let case = Case::new()?;
    let (few, many) = (2, 8);
    let steps = time(works::refinement(&case, many)?)? - time(works::refinement(&case, few)?)?;
    let (n, channels) = (refinement::STATES as f64, 4.0);
    // What a change of the state coordinates does not show needs no column; one more for the residual.
    let columns = (n + 2.0) * (n + 2.0) - n * n + 1.0;
    let rows = 2.0 * channels * refinement::LINES as f64;
    let (entries, positions) = (
        case.start.free_entries().len() as f64,
        refinement::POSITIONS as f64,
    );
    // Nor does one of the coordinates of the whole: states and deltas.
    let free = entries - n * n - (refinement::DELTAS * refinement::DELTAS) as f64;
    let triangles = positions * (columns - 1.0);
    let jacobian = of(
        "LFR refinement, a step with its Jacobian: 8 states, 5 deltas, 21 positions, 160 lines, 2x2",
        steps / (many - few) as f64,
        // Both sides of a response at each line, once more for a trial, a product an entry, reflections of all rows; how the entries
        // at a position move with those of the LFR; the triangles of all positions, reflected.
        positions
            * (2.0 * refinement::LINES as f64 * 8.0 * (0.5 * n * n + 4.0 * (0.5 * n * n + n))
                + 3.0 * rows * columns
                + 2.0 * rows * columns * columns
                + 2.0 * (columns - 1.0) * (n + 2.0) * (n + 2.0) * entries)
            + 2.0 * triangles * entries * free
            + 2.0 * triangles * free * free,
        refinement::POSITIONS as f64 * refinement::LINES as f64 * channels * 16.0,
        None,
    );
    Ok(vec![
        regression,
        accumulation,
        transforms,
        response,
        simulation,
        motion,
        jacobian,
    ])
}
