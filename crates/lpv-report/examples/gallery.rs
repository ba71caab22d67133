//! Writes the kinds of picture that a report needs, and a page with all of them, to a folder:
//! `cargo run -p lpv-report --example gallery -- <folder>`.

use std::error::Error;
use std::f64::consts::TAU;
use std::path::PathBuf;

use lpv_report::{
    Axis, Bar, Cell, Colour, Figure, Format, KeyFigure, Marker, Page, Panel, Section, Series, Share, Style,
    Table,
};

/// Magnitude of a double integrator with one flexible mode.
fn magnitude(frequency: f64, mode: f64, gain: f64) -> f64 {
    let w = TAU * frequency;
    let wn = TAU * mode;
    let flexible = 1.0 / ((wn * wn - w * w).hypot(0.03 * wn * w));
    (gain / (w * w) - 0.6 * flexible).abs() + 1e-3 * flexible
}

/// A reproducible scatter between -0.5 and 0.5.
fn scatter(index: usize) -> f64 {
    ((index as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0) - 0.5
}

fn bode() -> Figure {
    let frequencies: Vec<f64> = (1..=16_000).map(|k| 10.0 * f64::from(k) / 16_000.0).collect();
    let mut figure = Figure::new("Frozen frequency responses at p = 0.24")
        .caption(
            "Measured response with its 95 % region, the LPV model and the error between them; 16 000 lines.",
        )
        .columns(2)
        .share(Share::X);
    for (row, column) in [(1, 1), (1, 2), (2, 1), (2, 2)] {
        let gain = if row == column { 1.0 } else { 0.0 };
        let mode = 1.45 + 0.35 * f64::from(row) - 0.1 * f64::from(column);
        let truth: Vec<f64> = frequencies.iter().map(|&f| magnitude(f, mode, gain)).collect();
        let noise = |k: usize| 4e-4 * scatter(k + 7 * row as usize);
        let measured: Vec<f64> = truth
            .iter()
            .enumerate()
            .map(|(k, m)| (m + noise(k)).abs())
            .collect();
        let error: Vec<f64> = truth
            .iter()
            .enumerate()
            .map(|(k, m)| 0.01 * m + 0.2 * noise(k).abs())
            .collect();
        let band: Vec<_> = frequencies
            .iter()
            .zip(&truth)
            .map(|(&f, m)| (f, m - 1.5e-4, m + 3e-4))
            .collect();
        figure = figure.panel(
            Panel::new(
                Axis::log("Frequency (1/s)").range(0.05, 10.0),
                Axis::log(format!("|G_{{{row}{column}}}|")).range(1e-6, 1e2),
            )
            .title(format!("From u'_{{{column}}} to y'_{{{row}}}"))
            .series(Series::band(&band).label("95 % region").colour(Colour::Bound))
            .series(
                Series::xy(&frequencies, &measured, Style::Line)
                    .label("measured")
                    .colour(Colour::Reference)
                    .width(0.9),
            )
            .series(
                Series::xy(&frequencies, &truth, Style::Dashed)
                    .label("LPV-OBF model")
                    .colour(Colour::Model),
            )
            .series(
                Series::xy(&frequencies, &error, Style::Dotted)
                    .label("error")
                    .colour(Colour::Error),
            )
            .marker(Marker::vertical(mode).label("mode")),
        );
    }
    figure
}

fn poles() -> Figure {
    let circle: Vec<(f64, f64)> = (0..=2000)
        .map(|k| (TAU * f64::from(k) / 2000.0).sin_cos())
        .map(|(s, c)| (c, s))
        .collect();
    let mut estimated = Vec::new();
    let mut local = Vec::new();
    for k in 0..21 {
        let p = (f64::from(k) - 10.0) / 10.0;
        for base in [1.45 + 0.18 * p * p, 2.0 + 0.15 * p * p] {
            let angle = TAU * base / 20.0;
            let radius = 1.0 - 0.015 * angle;
            estimated.push((radius * angle.cos(), radius * angle.sin()));
            local.push((
                radius * angle.cos() + 4e-4 * scatter(k as usize),
                radius * angle.sin(),
            ));
        }
    }
    let basis = [(0.884, 0.436), (0.872, 0.458), (0.80, 0.575), (0.79, 0.592)];
    Figure::new("Poles and basis")
        .caption(
            "Sampled poles at 21 positions, the basis poles chosen from them, and a part of the unit circle.",
        )
        .plot_height(340.0)
        .panel(
            Panel::new(
                Axis::linear("Re z").range(0.74, 0.93),
                Axis::linear("Im z").range(0.42, 0.61),
            )
            .equal_aspect()
            .series(
                Series::line(circle)
                    .colour(Colour::Bound)
                    .width(1.0)
                    .label("unit circle"),
            )
            .series(
                Series::new(local, Style::Dots)
                    .colour(Colour::Index(5))
                    .label("true poles"),
            )
            .series(
                Series::new(estimated, Style::Crosses)
                    .colour(Colour::Reference)
                    .label("estimated poles"),
            )
            .series(
                Series::new(basis.to_vec(), Style::Circles)
                    .colour(Colour::Error)
                    .width(9.0)
                    .label("basis poles"),
            )
            .marker(Marker::text(0.884, 0.436, "λ_{1}")),
        )
}

fn coefficients() -> Figure {
    let fine: Vec<f64> = (0..=300).map(|k| f64::from(k) / 150.0 - 1.0).collect();
    let coarse: Vec<f64> = (0..21).map(|k| f64::from(k) / 10.0 - 1.0).collect();
    let mut figure = Figure::new("Coefficient functions W_{i}(p)")
        .caption("Local estimates (dots) and the interpolating polynomial (line).")
        .columns(4)
        .share(Share::X);
    for i in 0..8 {
        let order = f64::from(i) + 1.0;
        let scale = [1.0, 1e-3, 2.5, 40.0, 1e-5, 0.1, 3e5, 1.0][i as usize];
        let w = |p: f64| scale * (order * p + 0.3 * order).cos() / order;
        let line: Vec<_> = fine.iter().map(|&p| (p, w(p))).collect();
        let dots: Vec<_> = coarse.iter().map(|&p| (p, w(p))).collect();
        figure = figure.panel(
            Panel::new(Axis::linear("p"), Axis::linear(""))
                .title(format!("W_{{{}}}", i + 1))
                .series(Series::line(line).label("polynomial"))
                .series(
                    Series::new(dots, Style::Dots)
                        .colour(Colour::Error)
                        .label("local estimate"),
                ),
        );
    }
    figure
}

fn responses() -> Figure {
    let time: Vec<f64> = (0..16_000).map(|k| f64::from(k) / 200.0).collect();
    let position: Vec<f64> = time.iter().map(|t| 0.3 * (0.2 * t).sin()).collect();
    let setpoint: Vec<f64> = time.iter().map(|t| 1e-2 / (1.0 + (-(t - 20.0)).exp())).collect();
    let error: Vec<f64> = time
        .iter()
        .enumerate()
        .map(|(k, t)| 2e-6 * (-((t - 20.0) / 8.0).powi(2)).exp() * (9.0 * t).sin() + 2e-7 * scatter(k))
        .collect();
    let mut gap = error.clone();
    gap[9_000..9_600].fill(f64::NAN);
    let x = || Axis::linear("Time (s)");
    Figure::new("Closed loop along a moving position")
        .caption("Scheduling, set-point and tracking error; the gap in the error is a lost record.")
        .share(Share::X)
        .panel(
            Panel::new(x(), Axis::linear("p (m)"))
                .series(Series::xy(&time, &position, Style::Line).colour(Colour::Reference)),
        )
        .panel(
            Panel::new(x(), Axis::linear("y'_{1} (m)"))
                .series(
                    Series::xy(&time, &setpoint, Style::Line)
                        .colour(Colour::Reference)
                        .label("set-point"),
                )
                .series(
                    Series::xy(
                        &time,
                        &setpoint
                            .iter()
                            .zip(&error)
                            .map(|(r, e)| r + 100.0 * e)
                            .collect::<Vec<_>>(),
                        Style::Dashed,
                    )
                    .label("model, error × 100"),
                ),
        )
        .panel(
            Panel::new(x(), Axis::linear("Error (m)"))
                .series(
                    Series::xy(&time, &gap, Style::Line)
                        .colour(Colour::Error)
                        .width(0.8)
                        .label("y'_{1} − model"),
                )
                .marker(Marker::horizontal(1e-6).label("1 μm"))
                .marker(Marker::horizontal(-1e-6)),
        )
}

fn page(figures: [Figure; 4]) -> Page {
    let [bode, poles, coefficients, responses] = figures;
    let errors = Table::new(
        "Strict error: largest over frequency and position.",
        ["Model", "States", "Error", "Worst line (1/s)"],
    )
    .row([
        Cell::text("LPV-OBF, n_{g} = 16"),
        Cell::count(36),
        Cell::decibel(-13.8, 1).bar(Bar::AtMost(-40.0)),
        Cell::number(1.6213, Format::Fixed(3)),
    ])
    .row([
        Cell::text("LFR, 5 deltas"),
        Cell::count(8),
        Cell::decibel(-62.1, 1).bar(Bar::AtMost(-40.0)),
        Cell::number(2.1, Format::Fixed(3)),
    ])
    .row([
        Cell::text("LFR, failed start"),
        Cell::count(8),
        Cell::decibel(f64::NAN, 1).bar(Bar::AtMost(-40.0)),
        Cell::Empty,
    ]);
    Page::new("Gallery")
        .subtitle("Invented numbers in the form of a report")
        .section(
            Section::new("Summary")
                .key_figures([
                    KeyFigure::new(
                        Cell::decibel(-62.1, 1).bar(Bar::AtMost(-40.0)),
                        "strict frozen error",
                    )
                    .remark("41 positions"),
                    KeyFigure::new(Cell::decibel(-13.8, 1).bar(Bar::AtMost(-40.0)), "OBF model"),
                    KeyFigure::new(
                        Cell::number(1.4e-6, Format::Scientific(1)).unit("m"),
                        "tracking error, rms",
                    ),
                    KeyFigure::new(Cell::count(8), "states"),
                ])
                .paragraph("Text is plain & escaped: 3 < 4, and H_{∞} or 10^{-3} are set as they should be.")
                .table(errors)
                .note("The start from data alone failed once in three runs."),
        )
        .section(Section::new("Frequency responses").figure(bode))
        .section(
            Section::new("Poles and coefficients")
                .figure(poles)
                .heading("Coefficients")
                .figure(coefficients),
        )
        .section(
            Section::new("Time domain")
                .figure(responses)
                .list(["first point", "second point"])
                .code("lpv run --seed 42 > out.txt"),
        )
        .fact("seed", "42")
        .fact(
            "data",
            "sha256 9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
        )
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os()
        .nth(1)
        .map_or_else(|| std::env::temp_dir().join("gallery"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let figures = [bode(), poles(), coefficients(), responses()];
    for (name, figure) in ["bode", "poles", "coefficients", "responses"]
        .into_iter()
        .zip(&figures)
    {
        let account = figure.account()?;
        std::fs::write(folder.join(format!("{name}.svg")), figure.to_svg()?)?;
        std::fs::write(folder.join(format!("{name}.png")), figure.to_png(1600)?)?;
        println!(
            "{name}: {} points in {} kB of SVG; {} not finite",
            account.points,
            account.svg_bytes / 1000,
            account.not_finite
        );
    }
    let html = page(figures).to_html()?;
    std::fs::write(folder.join("page.html"), &html)?;
    println!("page: {} kB in {}", html.len() / 1000, folder.display());
    Ok(())
}
