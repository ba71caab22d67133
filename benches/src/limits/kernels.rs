//! The kernels beside the speeds that limit them.

use crate::works::{self, RUNS, Work, once};
use crate::{Failure, Kernel};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use lpv_benches::{Bench, median, refinement};
use lpv_core::{Discrete, StateSpace};
use std::hint::black_box;

/// Products of matrices, and the operations of one.
fn products() -> (Work<'static>, f64) {
    const N: usize = 1024;
    let a = Mat::<f64>::from_fn(N, N, |i, j| (i + 3 * j) as f64 * 1e-3);
    let mut c = Mat::<f64>::zeros(N, N);
    let run = move || {
        matmul(c.as_mut(), Accum::Replace, a.as_ref(), a.as_ref(), 1.0, Par::Seq);
        black_box(&c);
        Ok(())
    };
    (Box::new(run), 2.0 * (N as f64).powi(3))
}

/// Copies, and the bytes that one reads and writes.
fn copies() -> (Work<'static>, f64) {
    const N: usize = 1 << 25;
    let from = vec![1.0_f64; N];
    let mut to = vec![0.0_f64; N];
    let run = move || {
        to.copy_from_slice(black_box(&from));
        black_box(&to);
        Ok(())
    };
    (Box::new(run), 16.0 * N as f64)
}

/// The works that show the speeds of the machine, and what they told so far.
struct Limits {
    /// With the operations or bytes of one.
    works: [(Work<'static>, f64); 2],
    /// A second: operations, bytes.
    speeds: [Vec<f64>; 2],
}

impl Limits {
    fn new() -> Self {
        Self {
            works: [products(), copies()],
            speeds: [Vec::new(), Vec::new()],
        }
    }

    /// Operations and bytes a second, now.
    fn measure(&mut self) -> Result<[f64; 2], Failure> {
        let mut now = [0.0; 2];
        for (((work, amount), speeds), now) in self.works.iter_mut().zip(&mut self.speeds).zip(&mut now) {
            *now = *amount / once(work)?;
            speeds.push(*now);
        }
        Ok(now)
    }
}

/// What is to be measured.
struct Case<'a> {
    kernel: &'static str,
    /// Its time is a sum of those of works, each with a factor.
    works: Vec<(f64, Work<'a>)>,
    operations: f64,
    bytes: f64,
    bar: Option<f64>,
}

impl Case<'_> {
    /// Beside the speeds that limit it, which are measured again each time: what else a machine does changes them by the minute.
    fn measure(mut self, limits: &mut Limits) -> Result<Kernel, Failure> {
        for (_, work) in &mut self.works {
            work()?;
        }
        let (mut times, mut computing, mut moving) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..RUNS {
            let [operations, bytes] = limits.measure()?;
            let mut seconds = 0.0;
            for (factor, work) in &mut self.works {
                seconds += *factor * once(work)?;
            }
            times.push(seconds);
            computing.push(self.operations / operations / seconds);
            moving.push(self.bytes / bytes / seconds);
        }
        let (compute, memory) = (median(computing), median(moving));
        Ok(Kernel {
            kernel: self.kernel,
            seconds: median(times),
            operations: self.operations,
            bytes: self.bytes,
            limit: if compute > memory { "compute" } else { "memory" },
            fraction: compute.max(memory),
            bar: self.bar,
        })
    }
}

/// All kernels; operations a second of a product of matrices and bytes a second of a copy.
pub(crate) fn all(bench: &Bench) -> Result<(Vec<Kernel>, [f64; 2]), Failure> {
    let mut limits = Limits::new();
    let (model, case) = (bench.large_model(24)?, refinement::Case::new()?);
    let cases = cases(bench, &model, &case)?.into_iter();
    let kernels: Result<_, _> = cases.map(|case| case.measure(&mut limits)).collect();
    Ok((kernels?, limits.speeds.map(median)))
}

fn cases<'a>(
    bench: &'a Bench,
    model: &'a StateSpace<Discrete>,
    case: &'a refinement::Case,
) -> Result<Vec<Case<'a>>, Failure> {
    let of = |kernel, works, operations, bytes, bar| Case {
        kernel,
        works,
        operations,
        bytes,
        bar,
    };
    // Sums of products of 64 unknowns and two gains, weighted, and their right side.
    const LINES: usize = (1 << 14) - 1;
    const POSITIONS: usize = 21;
    let columns = 66.0;
    let a_line = columns * (columns + 1.0) + 4.0 * columns;
    let regression = of(
        "regression core: 21 positions, 16,383 lines, 16 functions, 2x2",
        vec![(1.0, works::regression(bench, POSITIONS, LINES, 16)?)],
        (POSITIONS * LINES) as f64 * a_line,
        // Response, covariances, and the responses of the functions.
        LINES as f64 * 16.0 * (POSITIONS as f64 * 12.0 + 16.0),
        Some(0.5),
    );
    const PERIOD: usize = 1 << 15;
    let n = PERIOD as f64;
    let transform = 2.5 * n * n.log2();
    // A record long enough reads its signals, and its sums no more.
    let bytes = n * 8.0 * 6.0;
    // Of four deviations: four squares and six complex products at each line.
    let products = 0.5 * n * (4.0 * 4.0 + 6.0 * 8.0);
    let accumulation = of(
        "FRF accumulation: a period of 32,768 samples, 2x2",
        vec![(1.0 / works::TOGETHER as f64, works::accumulation(PERIOD, 2)?)],
        4.0 * transform + products,
        bytes,
        Some(0.6),
    );
    let transforms = of(
        "beside it, transforms by realfft alone: four of 32,768 real samples",
        vec![(1.0, works::transforms(PERIOD, 4))],
        4.0 * transform,
        4.0 * n * 16.0,
        None,
    );
    let lines = bench.lines_hz(2000);
    let response = of(
        "frequency response: 24 states, 2,000 lines, 2x2",
        vec![(1.0, works::response(model, lines))],
        // Schur forms of two parts, of 8 and 16 states: real numbers times complex ones for two right sides, twelve blocks of two that
        // are turned over (35) and applied (28 a right side), and C.
        2000.0
            * (4.0 * 2.0 * 0.5 * (8.0 * 8.0 + 16.0 * 16.0) + 12.0 * (35.0 + 2.0 * 28.0) + 4.0 * 4.0 * 24.0),
        2000.0 * 4.0 * 16.0,
        None,
    );
    const SAMPLES: usize = 1 << 14;
    // Of a sample, so many as one step: A^K, both ways between the state and inputs or outputs, the triangle of the pulse response.
    let lifted = |k: f64| 2.0 * (24.0 * 24.0 + 2.0 * 24.0 * 2.0 * k + 4.0 * k * (k + 1.0) / 2.0) / k;
    let least = (1..=64_u32)
        .map(|k| lifted(f64::from(k)))
        .fold(f64::INFINITY, f64::min);
    let simulation = of(
        "simulation at constant p: 24 states, 16,384 samples",
        vec![(1.0, works::simulation(model, SAMPLES))],
        least * SAMPLES as f64,
        32.0 * SAMPLES as f64,
        None,
    );
    const MOVES: usize = 4000;
    // Terms of the Taylor series that rounding does not hide at the highest mode: (w T)^16 / 16! is 2e-16.
    const TERMS: f64 = 16.0;
    let motion = of(
        "simulation at moving p: the plant in its loop, 4,000 samples",
        vec![(1.0, works::motion(bench, MOVES)?)],
        // Of a term: three products with the polynomial of p, two forces, four accelerations, eight sums; three control laws.
        MOVES as f64 * (TERMS * 52.0 + 3.0 * 18.0),
        8.0 * 10.0 * MOVES as f64,
        None,
    );
    let (few, many) = (2, 8);
    let each = 1.0 / (many - few) as f64;
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
        vec![
            (each, works::refinement(case, many)?),
            (-each, works::refinement(case, few)?),
        ],
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
