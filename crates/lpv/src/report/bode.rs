//! Magnitude and phase of every channel, model and measurement.

use super::Subject;
use super::band::Known;
use crate::PipelineError;
use lpv_core::num_complex::Complex;
use lpv_core::{Clock, Frf, FrfEstimate};
use lpv_report::{Axis, Colour, Figure, Panel, Section, Series, Share, Style};

const FREQUENCY: &str = "Frequency (Hz)";

/// Points of a model's curve.
const POINTS: usize = 600;

pub(super) fn section(s: &Subject, known: &[Option<Known<'_>>]) -> Result<Section, PipelineError> {
    let frequencies = frequencies(s);
    let responses = s
        .frozen()?
        .iter()
        .map(|m| Ok(m.frequency_response(&frequencies)?))
        .collect::<Result<Vec<Frf>, PipelineError>>()?;
    let lines = if s.evidence.estimates.is_empty() {
        "The model alone: there is no frequency response to compare with."
    } else {
        "Lines: the frozen model. Dots: the estimated frequency response at the same positions."
    };
    let bands = if known.iter().any(Option::is_some) {
        " Bands: two standard deviations of the frozen model on either side, as the noise of the responses leaves them; \
         where none is seen, they are narrower than the line."
    } else {
        ""
    };
    let drawn = Drawn {
        subject: s,
        responses: &responses,
        known,
    };
    let magnitude = drawn
        .figure(
            "Magnitude",
            Axis::log("Magnitude"),
            f64::INFINITY,
            |v| v.norm(),
            |known, g, (i, j), n| vec![known.magnitude(g, i, j, n)],
        )
        .caption(format!("{lines}{bands}"));
    let phase = drawn
        .figure(
            "Phase",
            Axis::linear("Phase (degrees)").range(-180.0, 180.0).step(90.0),
            180.0,
            |v| v.arg().to_degrees(),
            |known, g, (i, j), n| known.phase(g, i, j, n),
        )
        .caption("The same, in degrees.");
    let section = Section::new("Frequency responses")
        .figure(magnitude)
        .figure(phase);
    Ok(residual(s, known).into_iter().fold(section, Section::figure))
}

/// What is known of the model at the positions that are drawn.
pub(super) fn known(s: &Subject) -> Result<Vec<Option<Known<'_>>>, PipelineError> {
    let at = |p: &Vec<f64>| p.first().map_or(Ok(None), |p| Known::new(s, *p));
    s.positions.iter().map(at).collect()
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

/// Which of the positions that are drawn a response belongs to; a model without scheduling has one, which is that of all.
fn place_of(s: &Subject, estimate: &FrfEstimate) -> Option<usize> {
    let own = estimate.position();
    let here = |p: &Vec<f64>| p.is_empty() || own.is_some_and(|own| **own == *p);
    s.positions.iter().position(here)
}

/// What all panels show.
struct Drawn<'a> {
    subject: &'a Subject,
    /// By position.
    responses: &'a [Frf],
    known: &'a [Option<Known<'a>>],
}

/// The bands of a channel (output, input) at the position with this index.
type Bands = fn(&Known<'_>, &Frf, (usize, usize), usize) -> Vec<Series>;

impl Drawn<'_> {
    /// `jump`: points further apart are not joined.
    fn figure(
        &self,
        title: &str,
        axis: Axis,
        jump: f64,
        value: fn(Complex<f64>) -> f64,
        bands: Bands,
    ) -> Figure {
        let s = self.subject;
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
                for (n, (response, known)) in self.responses.iter().zip(self.known).enumerate() {
                    if let Some(known) = known {
                        panel = bands(known, response, (i, j), n)
                            .into_iter()
                            .fold(panel, Panel::series);
                    }
                }
                for (n, (p, response)) in s.positions.iter().zip(self.responses).enumerate() {
                    for e in s.evidence.estimates.iter().filter(|e| place_of(s, e) == Some(n)) {
                        panel = panel.series(
                            Series::new(points(e.frf(), i, j), Style::Dots)
                                .colour(Colour::Index(n))
                                .width(2.0),
                        );
                    }
                    // A phase that passes 180 degrees goes on at -180.
                    let points = points(response, i, j);
                    for run in points.chunk_by(|a, b| (a.1 - b.1).abs() < jump) {
                        let line = Series::line(run.to_vec()).colour(Colour::Index(n));
                        panel = panel.series(match p.first() {
                            Some(p) => line.label(format!("p = {p:.4}")),
                            None => line.label("model"),
                        });
                    }
                }
                if self.known.iter().any(Option::is_some) {
                    panel = panel.series(
                        Series::band(&[])
                            .colour(Colour::Bound)
                            .label("two standard deviations"),
                    );
                }
                figure = figure.panel(panel);
            }
        }
        figure
    }
}

/// Column names are no mathematics.
pub(super) fn plain(name: &str) -> String {
    name.replace('_', " ")
}

/// What is left of the responses, beside what is known of them and of the model.
pub(super) fn residual(s: &Subject, known: &[Option<Known<'_>>]) -> Option<Figure> {
    let measured = !s.evidence.estimates.is_empty();
    let deviation = known.iter().any(Option::is_some);
    if !measured && !deviation {
        return None;
    }
    let mut panel = Panel::new(Axis::log(FREQUENCY), Axis::log("Relative error"));
    if measured {
        panel = measured_errors(s, panel);
    }
    for (n, known) in known.iter().enumerate() {
        if let Some(known) = known {
            panel = panel.series(Series::line(known.relative()).colour(Colour::Index(n)));
        }
    }
    let mut captions = Vec::new();
    if measured {
        captions.push(
            "Difference between response and frozen model relative to the response, whole matrix at a line; grey: the \
             stated deviation of the response.",
        );
    }
    if deviation {
        panel = panel.series(
            Series::line(Vec::new())
                .colour(Colour::Bound)
                .label("deviation of the model"),
        );
        captions.push(
            "Lines: what the noise leaves unknown of the model, which has far fewer parameters than the responses have \
             lines, relative to its response, whole matrix at a line.",
        );
    }
    let title = if measured {
        "Residual"
    } else {
        "Deviation of the model"
    };
    Some(Figure::new(title).panel(panel).caption(captions.join(" ")))
}

fn measured_errors(s: &Subject, panel: Panel) -> Panel {
    let mut noise = Vec::new();
    for e in &s.evidence.estimates {
        for (k, f) in e.frf().frequencies_hz().iter().enumerate() {
            noise.push((*f, e.relative_deviation(k)));
        }
    }
    let mut panel = panel.series(
        Series::new(noise, Style::Dots)
            .label("noise of the responses")
            .colour(Colour::Bound)
            .width(1.5),
    );
    for (e, g) in s.evidence.estimates.iter().zip(&s.evidence.responses) {
        let Some(n) = place_of(s, e) else { continue };
        let errors = g.relative_error(e.frf()).unwrap_or_default();
        let points = e.frf().frequencies_hz().iter().copied().zip(errors).collect();
        let series = Series::new(points, Style::Dots)
            .colour(Colour::Index(n))
            .width(2.0);
        panel = panel.series(match s.positions[n].first() {
            Some(p) => series.label(format!("p = {p:.4}")),
            None => series.label("residual"),
        });
    }
    panel
}
