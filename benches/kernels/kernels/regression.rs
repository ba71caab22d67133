//! The regression of (13), the interpolations and leave-one-out.

use criterion::{BenchmarkId, Criterion, Throughput};
use lpv_benches::Bench;
use lpv_ident::{Interpolation, RegressionSettings, RigidTerm, regress};
use rayon::ThreadPoolBuilder;
use std::hint::black_box;
use std::sync::LazyLock;

const FUNCTIONS: usize = 16;
const POSITIONS: usize = 21;

pub(crate) fn regression(c: &mut Criterion) {
    let bench = Bench::new().unwrap();
    let basis = bench.basis(FUNCTIONS).unwrap();
    let settings = RegressionSettings {
        rigid_body: RigidTerm::diagonal(2),
        ..RegressionSettings::default()
    };
    let pool = |threads| ThreadPoolBuilder::new().num_threads(threads).build().unwrap();

    let mut group = c.benchmark_group("regression, one position");
    for lines in [(1 << 11) - 1, (1 << 14) - 1] {
        let estimates = [bench.estimate(0.2, lines).unwrap()];
        group.throughput(Throughput::Elements(lines as u64));
        group.bench_function(BenchmarkId::new("lines", lines), |b| {
            b.iter(|| regress(black_box(&estimates), &basis, &settings).unwrap());
        });
    }
    group.finish();

    // With as few lines as the unknowns allow, what is left is the elimination of the gains, the condition numbers and
    // the back-substitution.
    let mut group = c.benchmark_group("regression, 21 positions");
    let few = bench.estimates(POSITIONS, 31).unwrap();
    group.bench_function("31 lines: elimination and back-substitution", |b| {
        pool(1).install(|| b.iter(|| regress(black_box(&few), &basis, &settings).unwrap()));
    });
    // Made when it is measured: a list of the benches takes no time.
    let estimates = LazyLock::new(|| bench.estimates(POSITIONS, (1 << 14) - 1).unwrap());
    for threads in [1, 2] {
        group.bench_function(BenchmarkId::new("16383 lines, threads", threads), |b| {
            pool(threads).install(|| b.iter(|| regress(black_box(&estimates), &basis, &settings).unwrap()));
        });
    }
    group.finish();

    let fits = regress(&bench.estimates(POSITIONS, 255).unwrap(), &basis, &settings).unwrap();
    let kinds = [
        Interpolation::Polynomial { order: 17 },
        Interpolation::Chebyshev { order: 17 },
        Interpolation::Spline,
        Interpolation::Linear,
        Interpolation::GaussianProcess { length_scale: 0.1 },
    ];
    let mut group = c.benchmark_group("interpolation, 21 positions");
    for kind in kinds {
        group.bench_function(kind.name(), |b| {
            b.iter(|| fits.interpolate(black_box(kind)).unwrap())
        });
    }
    group.finish();
    let candidates = fits.candidates(19);
    let name = format!("leave-one-out, {} candidates", candidates.len());
    c.bench_function(&name, |b| {
        b.iter(|| fits.leave_one_out(black_box(&candidates)).unwrap())
    });
}
