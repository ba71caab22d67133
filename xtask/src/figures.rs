//! The paper's figures for our machine.

use crate::TaskError;
use crate::experiment::{Bench, Measured};
use crate::identification::{BAND_HZ, ObfStage, TestGrid};
use crate::size::NOISE;
use crate::time::TimeStage;
use lpv::PoleStage;
use lpv_core::Frf;
use lpv_core::num_complex::Complex;
use lpv_report::{Axis, Colour, Figure, Panel, Series, Share, Style};

/// File name and figure, in the order of the paper.
pub(crate) type Pictures = Vec<(&'static str, Figure)>;

pub(crate) fn all(
    bench: &Bench,
    measured: &Measured,
    poles: &PoleStage,
    obf: &ObfStage,
    grid: &TestGrid,
    time: &TimeStage,
    continuum: &[Complex<f64>],
) -> Result<Pictures, TaskError> {
    Ok(vec![
        ("fig3-plant", plant(bench, grid)?),
        ("fig5-frf", frf(bench, measured)?),
        ("poles", pole_map(poles, obf, continuum)),
        ("fig6-coefficients", coefficients(obf)?),
        ("fig7-obf", model(obf, grid)?),
        ("positions", over_positions(obf, grid)?),
        ("fig8-time", in_time(time)),
        ("inter-sample", inter_sample(measured)),
    ])
}

const FREQUENCY: &str = "Frequency (Hz)";

/// Magnitude of a channel, one point a line.
fn magnitude(frf: &Frf, i: usize, j: usize) -> Vec<(f64, f64)> {
    frf.frequencies_hz()
        .iter()
        .copied()
        .zip(frf.channel(i, j).map(|v| v.norm()))
        .collect()
}

fn difference(a: &Frf, b: &Frf, i: usize, j: usize) -> Vec<(f64, f64)> {
    a.frequencies_hz()
        .iter()
        .copied()
        .zip(a.channel(i, j).zip(b.channel(i, j)).map(|(x, y)| (x - y).norm()))
        .collect()
}

/// A two by two grid of magnitude panels.
fn bode(title: &str, mut panel: impl FnMut(usize, usize, Panel) -> Panel) -> Figure {
    let mut figure = Figure::new(title).columns(2).share(Share::X);
    for i in 0..2 {
        for j in 0..2 {
            let axes = Panel::new(Axis::log(FREQUENCY), Axis::log("Magnitude")).title(format!(
                "u_{{{}}} to y_{{{}}}",
                j + 1,
                i + 1
            ));
            figure = figure.panel(panel(i, j, axes));
        }
    }
    figure
}

fn plant(bench: &Bench, grid: &TestGrid) -> Result<Figure, TaskError> {
    let positions = [0.0, 0.1, 0.2, 0.3];
    let truth = positions
        .iter()
        .map(|&p| bench.truth(p, &grid.frequencies_hz))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(bode("Fig. 3: the plant at four positions", |i, j, axes| {
        truth.iter().zip(positions).enumerate().filter(|(_, (_, p))| i == j || *p != 0.0).fold(axes, |axes, (n, (t, p))| {
            axes.series(Series::line(magnitude(t, i, j)).label(format!("p = {p}")).colour(Colour::Index(n)))
        })
    })
    .caption("Frozen responses of the first-principles model. At p = 0 the off-diagonal channels vanish and are not drawn."))
}

fn frf(bench: &Bench, measured: &Measured) -> Result<Figure, TaskError> {
    let estimate = measured.estimates[0].frf();
    let truth = bench.truth(bench.positions[0], estimate.frequencies_hz())?;
    Ok(bode("Fig. 5: FRF estimate at the first position", |i, j, axes| {
        axes.series(
            Series::new(difference(estimate, &truth, i, j), Style::Dots)
                .label("error")
                .colour(Colour::Error),
        )
        .series(
            Series::line(magnitude(estimate, i, j))
                .label("estimate")
                .colour(Colour::Model),
        )
        .series(
            Series::new(magnitude(&truth, i, j), Style::Dashed)
                .label("plant")
                .colour(Colour::Reference),
        )
    })
    .caption("Estimate (15) from two experiments with the paper's noise, the plant, and their difference."))
}

fn pole_map(poles: &PoleStage, obf: &ObfStage, continuum: &[Complex<f64>]) -> Figure {
    let upper = |z: &Complex<f64>| (z.im > 0.0).then_some((z.re, z.im));
    let estimated: Vec<_> = poles
        .fits
        .iter()
        .flat_map(pole_fit::PoleFit::flexible_poles)
        .filter_map(|z| upper(&z))
        .collect();
    let basis = lpv_core::linalg::eigenvalues(obf.recommended.fits().basis().a()).unwrap_or_default();
    let arc: Vec<_> = (0..=200)
        .map(|k| 0.42 + 0.3 * f64::from(k) / 200.0)
        .map(|a| (a.cos(), a.sin()))
        .collect();
    Figure::new("Poles over positions, and those of the basis")
        .panel(
            Panel::new(Axis::linear("Real part"), Axis::linear("Imaginary part"))
                .series(Series::line(arc).label("unit circle").colour(Colour::Bound))
                .series(
                    Series::new(continuum.iter().filter_map(upper).collect(), Style::Dots)
                        .label("plant, all positions")
                        .colour(Colour::Reference),
                )
                .series(
                    Series::new(estimated, Style::Circles)
                        .label("estimated")
                        .colour(Colour::Model),
                )
                .series(
                    Series::new(basis.iter().filter_map(upper).collect(), Style::Crosses)
                        .label("basis, n_{g} = 16")
                        .colour(Colour::Error),
                ),
        )
        .caption("Upper half plane. The basis covers both loci, not only the estimated points.")
}

fn coefficients(obf: &ObfStage) -> Result<Figure, TaskError> {
    let fits = obf.paper.fits();
    let dense: Vec<f64> = obf.paper.range().grid(241).into_iter().flatten().collect();
    let functions = fits.functions();
    let mut figure = Figure::new("Fig. 6: coefficient functions from u_{1} to y_{1}")
        .columns(4)
        .share(Share::X);
    for i in 0..functions {
        let column = i * 2;
        let curve = |m: &lpv_ident::LpvObfModel| {
            dense
                .iter()
                .map(|&p| (p, m.weights().evaluate(&[p])[(0, column)]))
                .collect::<Vec<_>>()
        };
        let samples: Vec<_> = fits
            .fits()
            .iter()
            .filter_map(|f| Some((f.position.single()?, f.weights[(0, column)])))
            .collect();
        let size = samples
            .iter()
            .map(|s| s.1.abs())
            .fold(0.0, f64::max)
            .max(f64::MIN_POSITIVE);
        figure = figure.panel(
            Panel::new(
                Axis::linear("Position p"),
                Axis::linear("").range(-1.6 * size, 1.6 * size),
            )
            .title(format!("W_{{{}}}", i + 1))
            .series(
                Series::new(curve(&obf.paper), Style::Dashed)
                    .label(obf.paper.interpolation().name())
                    .colour(Colour::Error),
            )
            .series(
                Series::line(curve(&obf.recommended))
                    .label(obf.recommended.interpolation().name())
                    .colour(Colour::Model),
            )
            .series(
                Series::new(samples, Style::Circles)
                    .label("samples")
                    .colour(Colour::Reference),
            ),
        );
    }
    Ok(figure.plot_height(120.0).caption(
        "Samples of W_{i}(p) from the regression, the paper's polynomial and the recommended interpolation.",
    ))
}

fn model(obf: &ObfStage, grid: &TestGrid) -> Result<Figure, TaskError> {
    let p = grid.positions[0];
    let response = obf.recommended.response(&[p], &grid.frequencies_hz)?;
    // The band is drawn on fewer lines: its price is a triangular solve a line, channel and position.
    let few: Vec<f64> = grid.frequencies_hz.iter().copied().step_by(6).collect();
    let deviation = obf.recommended.response_deviation(&[p], &few)?;
    Ok(bode("Fig. 7: frozen response of the LPV-OBF model at the first position", |i, j, axes| {
        let band: Vec<_> = few.iter().zip(&deviation).map(|(&f, d)| (f, 2.0 * d[(i, j)])).collect();
        axes.series(Series::new(difference(&response, &grid.truth[0], i, j), Style::Dashed).label("error").colour(Colour::Error))
            .series(Series::new(band, Style::Dotted).label("two deviations of the noise").colour(Colour::Bound))
            .series(Series::line(magnitude(&response, i, j)).label("model").colour(Colour::Model))
            .series(Series::new(magnitude(&grid.truth[0], i, j), Style::Dashed).label("plant").colour(Colour::Reference))
    })
    .caption("n_{g} = 16. The error between model and plant is the truncation of the basis, not the noise, which leaves the dotted band."))
}

fn over_positions(obf: &ObfStage, grid: &TestGrid) -> Result<Figure, TaskError> {
    let curve = |m: &lpv_ident::LpvObfModel| -> Result<Vec<(f64, f64)>, TaskError> {
        let responses = m.responses(grid.positions.iter().copied(), &grid.frequencies_hz)?;
        let mut points = Vec::with_capacity(responses.len());
        for ((r, t), &p) in responses.iter().zip(&grid.truth).zip(&grid.positions) {
            let band = |f: &Frf| f.select(|_, f| f <= BAND_HZ);
            points.push((
                p,
                band(r).relative_error(&band(t))?.into_iter().fold(0.0, f64::max),
            ));
        }
        Ok(points)
    };
    let axes = Panel::new(
        Axis::linear("Position p"),
        Axis::log("Largest relative error over [0.01, 3]"),
    );
    Ok(Figure::new("Frozen error over positions, n_{g} = 16")
        .panel(
            axes.series(Series::new(curve(&obf.paper)?, Style::Dashed).label(obf.paper.interpolation().name()).colour(Colour::Error))
                .series(Series::new(curve(&obf.chebyshev)?, Style::DashDot).label(obf.chebyshev.interpolation().name()).colour(Colour::Index(3)))
                .series(Series::line(curve(&obf.recommended)?).label(obf.recommended.interpolation().name()).colour(Colour::Model)),
        )
        .caption("A polynomial through equidistant positions oscillates between the outer ones (Runge); a spline does not."))
}

fn in_time(time: &TimeStage) -> Figure {
    let t = |k: usize| k as f64 * time.clock.sample_time();
    let xy = |values: &mut dyn Iterator<Item = f64>| {
        values.enumerate().map(|(k, v)| (t(k), v)).collect::<Vec<_>>()
    };
    let record = &time.record;
    let mut figure = Figure::new("Fig. 8: time domain")
        .columns(1)
        .share(Share::X)
        .plot_height(130.0);
    for (i, (unit, noise)) in ["m", "rad"].into_iter().zip(NOISE).enumerate() {
        let y = &record.outputs.columns[i];
        let error =
            |m: &lpv_core::nalgebra::DMatrix<f64>| xy(&mut y.iter().enumerate().map(|(k, y)| m[(i, k)] - y));
        let axis = |label: String| Panel::new(Axis::linear("Time"), Axis::linear(label));
        figure = figure
            .panel(
                axis(format!("y_{{{}}} ({unit})", i + 1))
                    .series(
                        Series::line(xy(&mut y.iter().copied()))
                            .label("plant")
                            .colour(Colour::Reference),
                    )
                    .series(
                        Series::new(xy(&mut time.closed.row(i).iter().copied()), Style::Dashed)
                            .label("model, closed loop")
                            .colour(Colour::Model),
                    ),
            )
            .panel(
                axis(format!("error of y_{{{}}} ({unit})", i + 1))
                    .series(
                        Series::new(error(&time.open), Style::Line)
                            .label("open loop")
                            .colour(Colour::Error),
                    )
                    .series(
                        Series::new(error(&time.closed), Style::Dashed)
                            .label("closed loop")
                            .colour(Colour::Model),
                    )
                    .marker(lpv_report::Marker::horizontal(3.0 * noise))
                    .marker(lpv_report::Marker::horizontal(-3.0 * noise)),
            );
    }
    figure
        .panel(
            Panel::new(Axis::linear("Time"), Axis::linear("Position p"))
                .series(Series::line(xy(&mut record.scheduling.columns[0].iter().copied())).colour(Colour::Reference)),
        )
        .caption("Noise-free response of the plant to a step-like setpoint of y_{1} while the carriage sweeps the range, and the errors of the LFR. The thin lines are three deviations of the measurement noise.")
}

fn inter_sample(measured: &Measured) -> Figure {
    Figure::new("Continuous controllers: what the held-input model misses")
        .panel(
            Panel::new(Axis::log(FREQUENCY), Axis::log("Relative difference"))
                .series(Series::line(measured.continuous_error.clone()).colour(Colour::Error)),
        )
        .caption("FRF from noise-free records with continuous controllers, against the zero-order-hold plant, first position: between samples the input moves, which the samples do not show.")
}
