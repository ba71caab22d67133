//! Poles of the frozen model in the plane, and modes along the positions.

use super::{Subject, to_continuous};
use crate::PipelineError;
use lpv_core::Model;
use lpv_core::num_complex::Complex;
use lpv_report::{Axis, Colour, Figure, Panel, Section, Series, Style};
use lpv_simulate::Frozen;
use std::f64::consts::TAU;

/// Sampled poles nearer to 1 are integrators: rounding parts a double one into a pair.
const INTEGRATOR: f64 = 1e-4;

/// Points along the scheduling range.
const POINTS: usize = 41;

pub(super) fn section(s: &Subject) -> Result<Section, PipelineError> {
    let mut section = Section::new("Poles").figure(map(s)?);
    if let Some([low, high]) = s
        .machine
        .range()
        .filter(|r| r.parameters() == 1)
        .map(|r| r.bounds()[0])
    {
        section = section.figure(along(s, low, high)?);
    }
    Ok(section)
}

fn map(s: &Subject) -> Result<Figure, PipelineError> {
    let circle: Vec<(f64, f64)> = (0..=200)
        .map(|k| {
            let (y, x) = (TAU * f64::from(k) / 200.0).sin_cos();
            (x, y)
        })
        .collect();
    let mut panel = Panel::new(Axis::linear("Real part"), Axis::linear("Imaginary part"))
        .equal_aspect()
        .series(Series::new(circle, Style::Dotted).colour(Colour::Bound));
    for (n, (p, frozen)) in s.positions.iter().zip(s.frozen()?).enumerate() {
        let points: Vec<(f64, f64)> = frozen.poles()?.iter().map(|z| (z.re, z.im)).collect();
        if points.is_empty() {
            continue;
        }
        let series = Series::new(points, Style::Crosses).colour(Colour::Index(n));
        panel = panel.series(match p.first() {
            Some(p) => series.label(format!("p = {p:.4}")),
            None => series.label("poles"),
        });
    }
    Ok(Figure::new("Poles of the frozen model")
        .panel(panel)
        .plot_height(420.0)
        .caption("Poles of the sampled model; the circle is the limit of stability."))
}

/// Whether the poles of the model are those of a basis, whatever p is: the exact LFR of a series expansion, or the
/// expansion.
fn has_basis(s: &Subject) -> bool {
    let account = s.file.identification.as_ref();
    let lpv = account
        .and_then(|a| a.summary.frequency.as_ref())
        .and_then(|f| f.lpv.as_ref());
    match &s.file.model {
        Model::SeriesExpansion(_) => true,
        Model::DiscreteLfr(_) => lpv.is_some(),
        _ => false,
    }
}

/// Frequency and damping of the estimated modes and of the model's, over the range.
fn along(s: &Subject, low: f64, high: f64) -> Result<Figure, PipelineError> {
    let (mut frequency, mut damping) = (Vec::new(), Vec::new());
    let mode = |z: &Complex<f64>| z.im > 1e-9 && (z - 1.0).norm() > INTEGRATOR;
    for k in 0..POINTS {
        let p = low + (high - low) * k as f64 / (POINTS - 1) as f64;
        for z in s.machine.at(&[p])?.poles()?.into_iter().filter(mode) {
            let continuous: Complex<f64> = to_continuous(z, s.clock);
            frequency.push((p, continuous.norm() / TAU));
            damping.push((p, -continuous.re / continuous.norm()));
        }
    }
    let model = |points: Vec<(f64, f64)>| {
        Series::new(points, Style::Dots)
            .label("poles of the model")
            .colour(Colour::Model)
    };
    let mut panels = [
        Panel::new(Axis::linear("Scheduling p"), Axis::linear("Frequency, Hz"))
            .title("Frequency")
            .series(model(frequency)),
        Panel::new(Axis::linear("Scheduling p"), Axis::log("Damping ratio"))
            .title("Damping")
            .series(model(damping)),
    ];
    let account = s.file.identification.as_ref();
    if let Some(lpv) = account
        .and_then(|a| a.summary.frequency.as_ref())
        .and_then(|f| f.lpv.as_ref())
    {
        for (which, panel) in panels.iter_mut().enumerate() {
            let points: Vec<(f64, f64)> = lpv
                .positions
                .iter()
                .zip(&lpv.modes)
                .flat_map(|(p, modes)| modes.iter().map(|m| (*p, m[which])))
                .filter(|(_, v)| *v > 0.0)
                .collect();
            if !points.is_empty() {
                *panel = panel.clone().series(
                    Series::new(points, Style::Circles)
                        .label("modes fitted at the positions")
                        .colour(Colour::Reference),
                );
            }
        }
    }
    let [a, b] = panels;
    let figure = Figure::new("Modes along the scheduling range")
        .columns(2)
        .panel(a)
        .panel(b);
    let caption = "Poles of the frozen model, and those of the fits at the positions.".to_owned();
    let basis = if has_basis(s) {
        " A model in orthonormal basis functions has the poles of its basis everywhere; the functions between them move the \
         response."
    } else {
        ""
    };
    Ok(figure.caption(caption + basis))
}
