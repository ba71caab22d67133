//! Magnitude and phase of every channel, model and measurement.

use super::Subject;
use crate::PipelineError;
use lpv_core::{Clock, Frf};
use lpv_report::{Axis, Colour, Figure, Panel, Section, Series, Share, Style};

const FREQUENCY: &str = "Frequency (cycles per unit of time)";

/// Points of a model's curve.
const POINTS: usize = 600;

pub(super) fn section(s: &Subject) -> Result<Section, PipelineError> {
    let frequencies = frequencies(s);
    let responses = s
        .frozen()?
        .iter()
        .map(|m| Ok(m.frequency_response(&frequencies)?))
        .collect::<Result<Vec<Frf>, PipelineError>>()?;
    let magnitude = figure(s, &responses, "Magnitude", Axis::log("Magnitude"), |v| v.norm()).caption(
        if s.evidence.estimates.is_empty() {
            "The model alone: there is no frequency response to compare with."
        } else {
            "Lines: the frozen model. Dots: the estimated frequency response at the same positions."
        },
    );
    let phase = figure(
        s,
        &responses,
        "Phase",
        Axis::linear("Phase (degrees)").range(-180.0, 180.0).step(90.0),
        |v| v.arg().to_degrees(),
    )
    .caption("The same, in degrees.");
    let mut section = Section::new("Frequency responses")
        .figure(magnitude)
        .figure(phase);
    if !s.evidence.estimates.is_empty() {
        section = section.figure(residual(s));
    }
    Ok(section)
}

/// Where the measurement is, else three decades below Nyquist; rounded so that no line lies outside the model's domain.
fn frequencies(s: &Subject) -> Vec<f64> {
    let nyquist = s.clock.nyquist_hz();
    let measured = |pick: fn(&[f64]) -> Option<&f64>| {
        s.evidence
            .estimates
            .iter()
            .filter_map(move |e| pick(e.frf().frequencies_hz()).copied())
    };
    let low = measured(<[f64]>::first).fold(f64::INFINITY, f64::min);
    let high = measured(<[f64]>::last).fold(0.0, f64::max);
    let (low, high) = if high > low {
        (low, high)
    } else {
        (1e-3 * nyquist, 0.999 * nyquist)
    };
    (0..POINTS)
        .map(|k| low * (high / low).powf(k as f64 / (POINTS - 1) as f64))
        .collect()
}

fn figure(
    s: &Subject,
    responses: &[Frf],
    title: &str,
    axis: Axis,
    value: fn(lpv_core::num_complex::Complex<f64>) -> f64,
) -> Figure {
    let mut figure = Figure::new(title).columns(s.inputs.len().min(4)).share(Share::X);
    let points = |frf: &Frf, i: usize, j: usize| -> Vec<(f64, f64)> {
        frf.frequencies_hz()
            .iter()
            .copied()
            .zip(frf.channel(i, j).map(value))
            .collect()
    };
    for (i, output) in s.outputs.iter().enumerate() {
        for (j, input) in s.inputs.iter().enumerate() {
            let mut panel = Panel::new(Axis::log(FREQUENCY), axis.clone()).title(format!(
                "{} to {}",
                plain(input),
                plain(output)
            ));
            for (n, (p, response)) in s.positions.iter().zip(responses).enumerate() {
                if let Some(e) = s
                    .evidence
                    .estimates
                    .iter()
                    .find(|e| e.position() == p.first().copied())
                {
                    panel = panel.series(
                        Series::new(points(e.frf(), i, j), Style::Dots)
                            .colour(Colour::Index(n))
                            .width(2.0),
                    );
                }
                let line = Series::line(points(response, i, j)).colour(Colour::Index(n));
                panel = panel.series(match p.first() {
                    Some(p) => line.label(format!("p = {p:.4}")),
                    None => line.label("model"),
                });
            }
            figure = figure.panel(panel);
        }
    }
    figure
}

/// Column names are no mathematics.
pub(super) fn plain(name: &str) -> String {
    name.replace('_', " ")
}

fn residual(s: &Subject) -> Figure {
    let mut panel = Panel::new(Axis::log(FREQUENCY), Axis::log("Relative error"));
    let mut noise = Vec::new();
    for e in &s.evidence.estimates {
        for (k, f) in e.frf().frequencies_hz().iter().enumerate() {
            noise.push((*f, e.relative_deviation(k)));
        }
    }
    panel = panel.series(
        Series::new(noise, Style::Dots)
            .label("noise of the responses")
            .colour(Colour::Bound)
            .width(1.5),
    );
    for (n, p) in s.positions.iter().enumerate() {
        let at = s
            .evidence
            .estimates
            .iter()
            .position(|e| e.position() == p.first().copied());
        let Some((e, g)) = at.and_then(|i| Some((&s.evidence.estimates[i], s.evidence.responses.get(i)?)))
        else {
            continue;
        };
        let errors = g.relative_error(e.frf()).unwrap_or_default();
        let points = e.frf().frequencies_hz().iter().copied().zip(errors).collect();
        let series = Series::new(points, Style::Dots)
            .colour(Colour::Index(n))
            .width(2.0);
        panel = panel.series(match p.first() {
            Some(p) => series.label(format!("p = {p:.4}")),
            None => series.label("residual"),
        });
    }
    Figure::new("Residual").panel(panel).caption(
        "Difference between response and frozen model relative to the response, whole matrix at a line; grey: the stated \
         deviation of the response.",
    )
}
