//! Poles from an FRF, and the choice of basis poles.

use criterion::Criterion;
use lpv_benches::Bench;
use lpv_core::FrfEstimate;
use obf_basis::{FkcmSettings, MinimaxSettings, fkcm, polish_minimax};
use pole_fit::{Integrators, NumeratorDegree, PoleFitSettings, Weighting, fit};
use std::cell::LazyCell;
use std::hint::black_box;

pub(crate) fn pole_fit(c: &mut Criterion) {
    let bench = Bench::new().unwrap();
    let settings = |order| PoleFitSettings {
        integrators: Integrators::Fixed(2),
        numerator: NumeratorDegree::StrictlyProper,
        ..PoleFitSettings::new(order)
    };
    let mut group = c.benchmark_group("pole fit");

    let estimate = bench.estimate(0.2, 5000).unwrap();
    let six = settings(6);
    group.bench_function("5000 lines, order 6, covariance weights", |b| {
        b.iter(|| fit(black_box(&estimate), bench.clock, &six).unwrap());
    });

    // The plant's denominator of order 6 and six more poles of a basis.
    let model = bench.large_model(14).unwrap();
    let frf = model.frequency_response(&bench.lines_hz(401)).unwrap();
    let estimate = FrfEstimate::with_unit_covariance(frf, None).unwrap();
    let twelve = PoleFitSettings {
        weighting: Weighting::Relative,
        ..settings(12)
    };
    group.bench_function("401 lines, order 12, relative weights", |b| {
        b.iter(|| fit(black_box(&estimate), bench.clock, &twelve).unwrap());
    });
    group.finish();
}

pub(crate) fn basis_poles(c: &mut Criterion) {
    let bench = Bench::new().unwrap();
    let observed = bench.observed_poles(21).unwrap();
    let mut group = c.benchmark_group("basis poles, 16 functions for 21 positions");
    let settings = FkcmSettings::new(16);
    group.bench_function("fuzzy search, 8 starts", |b| {
        b.iter(|| fkcm(black_box(&observed), &settings).unwrap());
    });
    let found = LazyCell::new(|| fkcm(&observed, &settings).unwrap().poles);
    let polish = MinimaxSettings::default();
    group.bench_function("minimax descent, 4 starts", |b| {
        b.iter(|| polish_minimax(black_box(&found), observed.as_slice(), &polish).unwrap());
    });
    group.finish();
}
