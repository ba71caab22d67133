//! The error of the frozen model over the positions.

use super::Subject;
use super::bode::plain;
use crate::verdict::number;
use lpv_core::{Frf, FrfEstimate};
use lpv_report::{Axis, Colour, Figure, Marker, Panel, Section, Series, Style};

/// Largest diameter of a circle on a map, px.
const LARGEST: f64 = 26.0;

/// Error and stated noise of a channel at a position, percent of the response of the channel.
struct Point {
    error: f64,
    noise: f64,
}

/// A curve a channel over one scheduling variable, a map an output over two; none for fewer positions than two.
pub(super) fn section(s: &Subject) -> Option<Section> {
    let measured: Vec<(&FrfEstimate, &Frf)> =
        s.evidence.estimates.iter().zip(&s.evidence.responses).collect();
    let parameters = measured.first()?.0.position()?.len();
    if measured.len() < 2
        || measured
            .iter()
            .any(|(e, _)| e.position().is_none_or(|p| p.len() != parameters))
    {
        return None;
    }
    let figure = match parameters {
        1 => curves(s, &measured),
        2 => {
            let worst = |e: &FrfEstimate, g: &Frf, i| {
                let each = (0..s.inputs.len()).map(|j| point(e, g, i, j).error);
                each.fold(0.0, f64::max)
            };
            let place = |(e, g): &(&FrfEstimate, &Frf)| {
                let p = e.position()?;
                let errors = (0..s.outputs.len()).map(|i| worst(e, g, i)).collect();
                Some(([p[0], p[1]], errors))
            };
            maps(&s.outputs, &measured.iter().filter_map(place).collect::<Vec<_>>())
        }
        _ => return None,
    };
    Some(Section::new("Errors over the positions").figure(figure))
}

fn point(estimate: &FrfEstimate, model: &Frf, i: usize, j: usize) -> Point {
    let truth = estimate.frf();
    let lines = || truth.channel(i, j).zip(model.channel(i, j)).enumerate();
    let size: f64 = lines().map(|(_, (f, _))| f.norm_sqr()).sum();
    let error: f64 = lines().map(|(_, (f, g))| (f - g).norm_sqr()).sum();
    let noise: f64 = lines().map(|(k, _)| estimate.variance(k, i, j)).sum();
    let percent = |square: f64| 100.0 * (square / size).sqrt();
    Point {
        error: percent(error),
        noise: percent(noise),
    }
}

fn curves(s: &Subject, measured: &[(&FrfEstimate, &Frf)]) -> Figure {
    let mut panel = Panel::new(Axis::linear("p"), Axis::log("Error (%)"));
    for (i, output) in s.outputs.iter().enumerate() {
        for (j, input) in s.inputs.iter().enumerate() {
            let along = |value: fn(&Point) -> f64| -> Vec<(f64, f64)> {
                let each = measured
                    .iter()
                    .filter_map(|(e, g)| Some((e.single_position()?, value(&point(e, g, i, j)))));
                let mut all: Vec<(f64, f64)> = each.collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0));
                all
            };
            let colour = Colour::Index(i * s.inputs.len() + j);
            let name = format!("{} to {}", plain(input), plain(output));
            panel = panel
                .series(Series::new(along(|p| p.noise), Style::Dotted).colour(colour))
                .series(Series::line(along(|p| p.error)).label(name).colour(colour))
                .series(Series::new(along(|p| p.error), Style::Dots).colour(colour));
        }
    }
    let panel = panel.series(
        Series::new(Vec::new(), Style::Dotted)
            .label("noise")
            .colour(Colour::Bound),
    );
    Figure::new("").panel(panel).caption(
        "Root of the power of the error of a channel over that of its response, all lines; dotted: the same of the stated noise.",
    )
}

/// Places with the error of every output there, percent.
fn maps(outputs: &[String], places: &[([f64; 2], Vec<f64>)]) -> Figure {
    let mut figure = Figure::new("").columns(2).plot_height(260.0).caption(
        "Circles: root of the power of the error of an output over that of its response, its worst input, all lines; the diameter goes \
         with the logarithm.",
    );
    for (i, output) in outputs.iter().enumerate() {
        let all = || places.iter().map(|(_, errors)| errors[i]);
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
        let mut panel = Panel::new(Axis::linear("p_{1}"), Axis::linear("p_{2}")).title(plain(output));
        for (&[x, y], error) in places.iter().map(|(p, _)| p).zip(all()) {
            let share = if low > 0.0 && high > low {
                (error / low).ln() / (high / low).ln()
            } else {
                1.0
            };
            let circle = Series::new(vec![(x, y)], Style::Circles)
                .width(LARGEST * (0.25 + 0.75 * share))
                .colour(Colour::Error);
            panel = panel
                .series(circle)
                .marker(Marker::text(x, y, format!("{} %", number(error))));
        }
        figure = figure.panel(panel);
    }
    figure
}

#[cfg(test)]
mod tests {
    use super::maps;

    #[test]
    fn a_map_has_a_circle_and_its_error_at_every_place() {
        let places = [
            ([0.0, 0.0], vec![0.5, 1.0]),
            ([0.1, 0.0], vec![5.0, 1.0]),
            ([0.0, 0.1], vec![0.0, 1.0]),
        ];
        let figure = maps(&["y1".to_owned(), "y2".to_owned()], &places);
        assert_eq!(figure.panels.len(), 2);
        let first = &figure.panels[0];
        assert_eq!((first.series.len(), first.markers.len()), (3, 3));
        assert!(
            figure
                .to_svg()
                .is_ok_and(|svg| svg.contains("5.00 %") && svg.contains("y2"))
        );
        let grown = maps(&["y1".to_owned()], &places[..2]);
        let widths: Vec<f64> = grown.panels[0].series.iter().map(|s| s.width).collect();
        assert_eq!(widths, [6.5, 26.0]);
    }
}
