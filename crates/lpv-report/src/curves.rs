//! The drawing of series: lines, bands and symbols.

use crate::layout::Placed;
use crate::series::{Series, Style};
use crate::svg::{Svg, path, px};
use crate::{decimate, ranges};

/// Dashes of a style.
pub(crate) fn dashes(style: &Style) -> &'static str {
    match style {
        Style::Dashed => " stroke-dasharray=\"6 3\"",
        Style::Dotted => " stroke-dasharray=\"1.6 2.4\"",
        Style::DashDot => " stroke-dasharray=\"7 2.4 1.6 2.4\"",
        _ => "",
    }
}

/// A series, thinned, at its place in the plot.
pub(crate) fn series(svg: &mut Svg, placed: &Placed, series: &Series) {
    let (width, height) = (placed.width, placed.height);
    let places = ranges::places(placed.panel, series);
    if let Style::Band { .. } = series.style {
        let edges: Vec<_> = places
            .map(|p| {
                p.ok()
                    .map(|(x, low, high)| (width * placed.x.unit(x), placed.y.unit(low), placed.y.unit(high)))
            })
            .collect();
        for run in edges.split(Option::is_none) {
            let line = |pick: fn(&(f64, f64, f64)) -> f64| -> Vec<(f64, f64)> {
                run.iter()
                    .flatten()
                    .map(|e| (e.0, height * (1.0 - pick(e))))
                    .collect()
            };
            let mut outline = decimate::edge(&line(|e| e.2), f64::min);
            outline.extend(decimate::edge(&line(|e| e.1), f64::max).into_iter().rev());
            if outline.len() > 2 {
                svg.fill(series.colour, 0.22, &(path(&outline) + "z"));
            }
        }
        return;
    }
    let points: Vec<Option<(f64, f64)>> = places
        .map(|p| {
            p.ok()
                .map(|(x, y, _)| (width * placed.x.unit(x), height * (1.0 - placed.y.unit(y))))
        })
        .collect();
    if series.style.is_line() {
        let lines = decimate::polylines(&points, width);
        let data: String = lines.iter().map(|line| path(line)).collect();
        svg.stroke(series.colour, series.drawn_width(), dashes(&series.style), &data);
    } else {
        symbols(svg, series, &decimate::cloud(&points, width, height));
    }
}

/// Dots, circles or crosses at these places, as one path.
pub(crate) fn symbols(svg: &mut Svg, series: &Series, at: &[(f64, f64)]) {
    let size = series.drawn_width();
    let half = px(0.5 * size);
    let whole = px(size);
    let each = |shape: &str| -> String { at.iter().map(|&p| path(&[p]) + shape).collect() };
    match series.style {
        Style::Circles => {
            let ring = format!("m-{half} 0a{half} {half} 0 1 0 {whole} 0a{half} {half} 0 1 0-{whole} 0z");
            svg.stroke(series.colour, 1.2, "", &each(&ring));
        }
        Style::Crosses => {
            let cross = format!("m-{half}-{half}l{whole} {whole}m-{whole} 0l{whole}-{whole}");
            svg.stroke(series.colour, 1.2, "", &each(&cross));
        }
        // A line of no length with round ends is a disc, in a third of the bytes of one.
        _ => svg.stroke(series.colour, size, " stroke-linecap=\"round\"", &each("h0")),
    }
}
