//! Wild inputs through the chain of crates: a typed error or a result, never a panic.
//!
//! Each crate has its own test of wild inputs. Here what one crate gives is what the next one gets, so that a result which
//! is only nearly good (an unstable pole, a singular covariance, a response of 1e300) is met where it hurts.
// Helpers of tests fail the test when something is wrong, as the tests themselves do.
#![allow(clippy::unwrap_used, clippy::panic)]

use frf_estimation::{PeriodicSettings, SkipRule, confidence_radius, estimate_records};
use lfr_realize::realize;
use lpv_core::{
    Discrete, Frf, FrfEstimate, MatrixFunction, Model, Position, Purpose, Record, RecordKind,
    SeriesExpansion, Signals, StateSpace,
};
use lpv_ident::{Interpolation, LocalFits, RegressionSettings, RigidTerm, Weighting, recommend, regress};
use lpv_report::{Axis, Cell, Figure, KeyFigure, Page, Panel, Section, Series};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use obf_basis::{FkcmSettings, MinimaxSettings, OrthonormalBasis, PoleSet, fkcm, polish_minimax};
use pole_fit::{Integrators, PoleFitSettings, fit};
use proptest::prelude::*;

type C64 = Complex<f64>;

/// Mostly tame, now and then anything.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        20 => -2.0..2.0f64,
        1 => Just(0.0),
        1 => Just(1e300),
        1 => Just(-1e-300),
        1 => any::<f64>(),
    ]
}

fn complex() -> impl Strategy<Value = C64> {
    (number(), number()).prop_map(|(re, im)| C64::new(re, im))
}

/// How the covariance of an estimate is made from random factors.
#[derive(Debug, Clone, Copy)]
enum Covariance {
    Unit,
    PositiveDefinite,
    Singular,
    Anything,
}

fn covariance(n: usize, kind: Covariance, draw: &[C64]) -> Vec<C64> {
    let at = |i: usize| draw.get(i % draw.len().max(1)).copied().unwrap_or_default();
    let m = DMatrix::from_fn(n, n, |i, j| at(i * n + j));
    let made = match kind {
        Covariance::Unit => DMatrix::identity(n, n),
        Covariance::PositiveDefinite => &m * m.adjoint() + DMatrix::identity(n, n),
        Covariance::Singular => {
            let one = DMatrix::from_fn(n, 1, |i, _| at(i));
            &one * one.adjoint()
        }
        Covariance::Anything => m,
    };
    made.as_slice().to_vec()
}

#[derive(Debug, Clone)]
struct Estimate {
    frequencies_hz: Vec<f64>,
    outputs: usize,
    inputs: usize,
    /// Gain of a tame response; `None`: the draws themselves.
    gain: Option<f64>,
    draw: Vec<C64>,
    kinds: (Covariance, Covariance),
    position: Option<Position>,
}

impl Estimate {
    fn build(&self) -> Option<FrfEstimate> {
        let (lines, size) = (self.frequencies_hz.len(), self.outputs * self.inputs);
        let at = |i: usize| self.draw.get(i % self.draw.len().max(1)).copied();
        let values = (0..lines * size).map(|i| match self.gain {
            Some(gain) => {
                let z = C64::from_polar(1.0, std::f64::consts::TAU * self.frequencies_hz[i / size] / 20.0);
                gain * (1.0 + (i % size) as f64) * (z + 1.0) / (z * z - z * 1.8 + 0.97)
                    + at(i).unwrap_or_default() * 1e-3
            }
            None => at(i).unwrap_or_default(),
        });
        let frf = Frf::new(
            self.frequencies_hz.clone(),
            self.outputs,
            self.inputs,
            values.collect(),
        );
        let each = |n, kind| {
            let shift = |k: usize| {
                self.draw
                    .iter()
                    .cycle()
                    .skip(k % 7)
                    .take(9)
                    .copied()
                    .collect::<Vec<_>>()
            };
            (0..lines).flat_map(|k| covariance(n, kind, &shift(k))).collect()
        };
        let (c, s) = (each(self.outputs, self.kinds.0), each(self.inputs, self.kinds.1));
        FrfEstimate::new(frf.ok()?, c, s, 12.0, self.position.clone()).ok()
    }
}

fn kind() -> impl Strategy<Value = Covariance> {
    prop_oneof![
        3 => Just(Covariance::Unit),
        5 => Just(Covariance::PositiveDefinite),
        1 => Just(Covariance::Singular),
        1 => Just(Covariance::Anything),
    ]
}

fn estimate(outputs: usize, inputs: usize) -> impl Strategy<Value = Estimate> {
    let equidistant = (0..40usize, 0..2usize)
        .prop_map(|(n, from)| (from..from + n).map(|k| 0.24 * k as f64).collect::<Vec<f64>>());
    let frequencies = prop_oneof![
        12 => equidistant,
        1 => prop::collection::vec(number(), 0..5),
    ];
    (
        frequencies,
        prop::option::weighted(0.8, number()),
        prop::collection::vec(complex(), 1..40),
        (kind(), kind()),
        prop::option::weighted(0.95, number()),
    )
        .prop_map(move |(frequencies_hz, gain, draw, kinds, position)| Estimate {
            frequencies_hz,
            outputs,
            inputs,
            gain,
            draw,
            kinds,
            position: position.map(Position::from),
        })
}

/// Estimates at several positions: mostly of one shape and in order, sometimes neither.
fn estimates() -> impl Strategy<Value = Vec<Estimate>> {
    let shape = || prop_oneof![8 => 1..3usize, 1 => Just(0usize)];
    let alike = (shape(), shape()).prop_flat_map(|(ny, nu)| prop::collection::vec(estimate(ny, nu), 0..7));
    let stray = (shape(), shape()).prop_flat_map(|(ny, nu)| estimate(ny, nu));
    (
        alike,
        prop::option::weighted(0.1, stray),
        prop::bool::weighted(0.8),
    )
        .prop_map(|(mut list, stray, in_order)| {
            if in_order {
                // Lines of one estimate for all: what comes of measurements.
                let lines = list.first().map(|e| e.frequencies_hz.clone());
                for (q, e) in list.iter_mut().enumerate() {
                    e.position = Some((0.1 * q as f64 - 0.2).into());
                    if let Some(lines) = &lines {
                        e.frequencies_hz.clone_from(lines);
                    }
                }
            }
            list.extend(stray);
            list
        })
}

fn basis() -> impl Strategy<Value = Option<StateSpace<Discrete>>> {
    let clock = Discrete::from_rate(20.0).unwrap();
    let from_poles = prop::collection::vec((0.0..1.1f64, 0.0..3.1f64), 1..4).prop_map(move |poles| {
        let poles: Vec<C64> = poles
            .iter()
            .map(|&(r, angle)| C64::from_polar(r, angle))
            .collect();
        let set = PoleSet::from_upper_half(&poles).ok()?;
        Some(
            OrthonormalBasis::takenaka_malmquist(&set, clock)
                .ok()?
                .state_space()
                .clone(),
        )
    });
    // Any filters at all: unstable ones, two inputs, no outputs.
    let any_filters = (
        0..3usize,
        0..3usize,
        0..3usize,
        prop::collection::vec(number(), 27),
    )
        .prop_map(move |(n, inputs, outputs, v)| {
            let m = |rows, columns, from: usize| {
                DMatrix::from_fn(rows, columns, |i, j| v[(from + 3 * i + j) % 27])
            };
            StateSpace::new(
                m(n, n, 0),
                m(n, inputs, 9),
                m(outputs, n, 18),
                m(outputs, inputs, 5),
                clock,
            )
            .ok()
        });
    prop_oneof![5 => from_poles, 1 => any_filters]
}

fn interpolations() -> [Interpolation; 6] {
    [
        Interpolation::Polynomial { order: 2 },
        Interpolation::Polynomial { order: 40 },
        Interpolation::Chebyshev { order: 4 },
        Interpolation::Spline,
        Interpolation::Linear,
        Interpolation::GaussianProcess { length_scale: 0.3 },
    ]
}

/// Everything that follows the regression.
fn downstream(fits: &LocalFits) {
    let frequencies = [0.0, 0.1, 1.0, 10.0];
    let positions = fits.positions();
    for q in 0..positions.len() {
        let _ = fits.coefficient_covariance(q);
        let _ = fits.response(q, &frequencies[1..]);
    }
    if let Ok(table) = fits.leave_one_out(&fits.candidates(5)) {
        let _ = recommend(&table, 1.1);
    }
    for kind in interpolations() {
        let Ok(model) = fits.interpolate(kind) else {
            continue;
        };
        let middle = 0.5 * (positions[0][0] + positions[positions.len() - 1][0]);
        for p in [middle, f64::NAN, 1e9] {
            let _ = model.response(&[p], &frequencies[1..]);
            let _ = model.response_deviation(&[p], &frequencies);
        }
        let Ok(series) = model.series() else { continue };
        realised(&series, middle);
    }
}

/// State space, LFR, JSON and simulation of an expansion.
fn realised(series: &SeriesExpansion, position: f64) {
    if let Ok(text) = Model::SeriesExpansion(series.clone()).to_json() {
        assert!(
            Model::from_json(&text).is_ok(),
            "a model of ours cannot be read back"
        );
    }
    let Ok(realization) = realize(series) else { return };
    let _ = realization.largest_difference(&[position], &[0.1, 1.0]);
    let _ = realization.largest_difference(&[f64::INFINITY], &[0.1]);
    let lfr = &realization.lfr;
    let rest = DVector::zeros(lfr.states());
    let inputs = DMatrix::from_element(lfr.inputs(), 5, 1.0);
    for p in [position, f64::NAN] {
        let _ = lfr.simulate(&rest, &inputs, &DMatrix::from_element(1, 5, p));
        let _ = realization
            .state_space
            .simulate(&rest, &inputs, &DMatrix::from_element(1, 5, p));
    }
    let _ = lfr.simulate(&rest, &inputs, &DMatrix::zeros(2, 3));
}

fn report(numbers: &[f64]) {
    let points: Vec<(f64, f64)> = numbers.iter().enumerate().map(|(k, &v)| (k as f64, v)).collect();
    let figure = Figure::new("Wild")
        .panel(Panel::new(Axis::linear("k"), Axis::log("v")).series(Series::line(points).label("v")));
    let first = numbers.first().copied().unwrap_or(f64::NAN);
    let section = Section::new("Numbers")
        .key_figures([KeyFigure::new(Cell::decibel(first, 1), "first")])
        .figure(figure);
    let _ = Page::new("Wild").section(section).to_html();
}

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn estimates_to_models(
        list in estimates(),
        basis in basis(),
        weighting in prop_oneof![
            3 => Just(Weighting::Covariance), 1 => Just(Weighting::Relative), 1 => Just(Weighting::Uniform)
        ],
        rigid in prop::collection::vec((0..3usize, 0..2usize), 0..3),
        model_error in prop_oneof![3 => Just(0.0), 1 => number()],
        band in prop::option::weighted(0.2, (number(), number())),
    ) {
        let Some(basis) = basis else { return Ok(()) };
        let list: Vec<FrfEstimate> = list.iter().filter_map(Estimate::build).collect();
        let rigid = rigid.into_iter().map(|(output, input)| RigidTerm { output, input }).collect();
        let mut settings = RegressionSettings { rigid_body: rigid, weighting, model_error, ..RegressionSettings::default() };
        if let Some((lower, upper)) = band {
            settings.band_hz = Some((lower, upper));
        }
        if let Ok(fits) = regress(&list, &basis, &settings) {
            downstream(&fits);
            report(&fits.fits().iter().map(|f| f.cost).collect::<Vec<_>>());
        }
    }

    #[test]
    fn estimates_to_poles_to_basis(
        list in estimates(),
        order in 0..9usize,
        integrators in 0..3usize,
        functions in 0..7usize,
        weighting in 0..4usize,
    ) {
        let clock = Discrete::from_rate(20.0).unwrap();
        let integrators = if integrators == 2 { Integrators::Free } else { Integrators::Fixed(integrators) };
        let weighting = [
            pole_fit::Weighting::Covariance,
            pole_fit::Weighting::DiagonalCovariance,
            pole_fit::Weighting::Relative,
            pole_fit::Weighting::Uniform,
        ][weighting];
        let settings = PoleFitSettings { integrators, weighting, ..PoleFitSettings::new(order) };
        let list: Vec<FrfEstimate> = list.iter().filter_map(Estimate::build).collect();
        let mut observed = Vec::new();
        for e in &list {
            let Ok(found) = fit(e, clock, &settings) else { continue };
            let _ = found.modes();
            let _ = found.state_space();
            let _ = found.response(e.frf().frequencies_hz());
            observed.extend(found.flexible_poles());
        }
        // Unstable poles are refused as a set, and must not stop those that are not.
        let _ = PoleSet::new(&observed);
        observed.retain(|z| z.norm() < 1.0);
        let Ok(set) = PoleSet::new(&observed) else { return Ok(()) };
        let search = FkcmSettings { starts: 2, max_iterations: 20, ..FkcmSettings::new(functions) };
        let Ok(found) = fkcm(&set, &search) else { return Ok(()) };
        let polish = MinimaxSettings { extra_starts: 1, max_iterations: 20, ..MinimaxSettings::default() };
        let poles = polish_minimax(&found.poles, set.as_slice(), &polish).map_or(found.poles, |r| r.poles);
        let Ok(basis) = OrthonormalBasis::takenaka_malmquist(&poles, clock) else { return Ok(()) };
        let relative = RegressionSettings { weighting: Weighting::Relative, ..RegressionSettings::default() };
        if let Ok(fits) = regress(&list, basis.state_space(), &relative) {
            downstream(&fits);
        }
    }

    #[test]
    fn records_to_models(
        shape in (1..3usize, 1..3usize),
        period in 3..24usize,
        periods in 1..5usize,
        positions in prop::collection::vec(prop::option::weighted(0.9, number()), 1..4),
        noise in prop::collection::vec(number(), 64),
        wild in prop::bool::weighted(0.3),
        skip in 0..3usize,
    ) {
        let clock = Discrete::from_rate(20.0).unwrap();
        let (ny, nu) = shape;
        let settings = PeriodicSettings { skip: SkipRule::Fixed(skip), ..PeriodicSettings::default() };
        let samples = period * periods;
        let draw = |i: usize| {
            let v = noise[i % noise.len()];
            if wild { v } else { v.clamp(-2.0, 2.0) }
        };
        let mut list = Vec::new();
        for (q, &position) in positions.iter().enumerate() {
            let records: Vec<Record> = (0..nu)
                .map(|experiment| {
                    let signal = |c: usize, repeats: bool| -> Vec<f64> {
                        let at = |k: usize| if repeats { k % period } else { k };
                        (0..samples).map(|k| draw(7 * c + 13 * experiment + at(k) * (c + 1) + q)).collect()
                    };
                    let columns = |from: usize, n: usize, repeats: bool| {
                        let names: Vec<String> = (0..n).map(|c| format!("c{from}{c}")).collect();
                        let names: Vec<&str> = names.iter().map(String::as_str).collect();
                        Signals::new(&names, (0..n).map(|c| signal(from + c, repeats)).collect())
                    };
                    Record {
                        name: format!("record-{experiment}"),
                        kind: RecordKind::Periodic { period },
                        purpose: Purpose::Estimation,
                        position: position.map(Position::from),
                        outputs: columns(0, ny, false),
                        inputs: columns(3, nu, true),
                        references: Signals::default(),
                        scheduling: Signals::default(),
                        auxiliary: Signals::default(),
                        injection: Signals::default(),
                    }
                })
                .collect();
            bundled(&records);
            let records: Vec<&Record> = records.iter().collect();
            if let Ok(found) = estimate_records(&records, clock, &settings) {
                if !found.estimate.frf().is_empty() {
                    let _ = confidence_radius(&found.estimate, 0, 0, 0, 0.95);
                }
                report(&found.output_snr);
                list.push(found.estimate);
            }
        }
        let basis = OrthonormalBasis::laguerre(0.5, 2, clock).unwrap();
        let settings = RegressionSettings { rigid_body: RigidTerm::diagonal(1), ..RegressionSettings::default() };
        if let Ok(fits) = regress(&list, basis.state_space(), &settings) {
            downstream(&fits);
        }
    }

    #[test]
    fn expansions_to_lfrs(
        shape in (0..3usize, 0..3usize, 0..3usize),
        terms in 0..4usize,
        v in prop::collection::vec(number(), 40),
        bounds in (number(), number()),
    ) {
        let clock = Discrete::from_rate(20.0).unwrap();
        let (ny, nu, ng) = shape;
        let m = |rows, columns, from: usize| DMatrix::from_fn(rows, columns, |i, j| v[(from + 5 * i + j) % 40]);
        let Ok(range) = lpv_core::SchedulingRange::interval(bounds.0, bounds.1) else { return Ok(()) };
        let (Ok(rigid), Ok(bank)) = (
            StateSpace::gain(m(ny, nu, 3), clock),
            StateSpace::new(m(ng, ng, 0), m(ng, 1, 9), m(ng, ng, 17), m(ng, 1, 23), clock),
        ) else { return Ok(()) };
        let (Ok(direct), Ok(weights)) = (
            MatrixFunction::constant(m(ny, nu, 11)),
            MatrixFunction::polynomial((0..terms).map(|t| m(ny, ng * nu, t)).collect()),
        ) else { return Ok(()) };
        let Ok(series) = SeriesExpansion::new(rigid, bank, direct, weights, range) else { return Ok(()) };
        realised(&series, 0.5 * (bounds.0 + bounds.1));
    }
}

/// A bundle either refuses the records or gives them back as they were.
fn bundled(records: &[Record]) {
    let Some(first) = records.first() else { return };
    let folder = tempfile::tempdir().unwrap();
    let names = |s: &Signals| s.names.clone();
    let (outputs, inputs) = (names(&first.outputs), names(&first.inputs));
    let description = experiment_data::Description::new(
        "wild",
        20.0,
        &outputs.iter().map(String::as_str).collect::<Vec<_>>(),
        &inputs.iter().map(String::as_str).collect::<Vec<_>>(),
    );
    let Ok(mut writer) =
        experiment_data::BundleWriter::create(folder.path(), description, experiment_data::RecordFormat::Npz)
    else {
        return;
    };
    for record in records {
        if writer.write(record).is_err() {
            return;
        }
    }
    if let Ok(bundle) = writer.finish() {
        for (back, record) in bundle.records().zip(records) {
            assert_eq!(back.unwrap().outputs.columns, record.outputs.columns);
        }
    }
}
