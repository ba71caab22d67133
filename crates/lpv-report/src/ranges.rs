//! The range of every axis: fixed, from the data, shared or widened for equal aspect.

use crate::ReportError;
use crate::figure::{Account, Figure, Share};
use crate::panel::{Aspect, Axis, Panel, Scale};
use crate::series::{Place, Series, Style};
use crate::view::{self, Padding, Range, Refused, coordinate};

/// Ranges of one panel, in axis coordinates, and what its data are like.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ranges {
    pub(crate) x: Range,
    pub(crate) y: Range,
    /// Points that have a place on both axes.
    pub(crate) placed: usize,
    /// Points that a logarithmic axis cannot show.
    pub(crate) not_positive: usize,
}

/// Checks every panel and finds its ranges.
pub(crate) fn of_figure(figure: &Figure) -> Result<(Vec<Ranges>, Account), ReportError> {
    let mut account = Account::default();
    let mut ranges = Vec::with_capacity(figure.panels.len());
    for (index, panel) in figure.panels.iter().enumerate() {
        ranges.push(of_panel(figure, index, panel, &mut account)?);
    }
    if figure.share != Share::Nothing {
        share(figure, &mut ranges, Which::X)?;
    }
    if figure.share == Share::Both {
        share(figure, &mut ranges, Which::Y)?;
    }
    for (index, (panel, ranges)) in figure.panels.iter().zip(&ranges).enumerate() {
        check_step(figure, index, 'x', &panel.x, ranges.x)?;
        check_step(figure, index, 'y', &panel.y, ranges.y)?;
    }
    Ok((ranges, account))
}

fn of_panel(
    figure: &Figure,
    index: usize,
    panel: &Panel,
    account: &mut Account,
) -> Result<Ranges, ReportError> {
    let name = || figure.title.clone();
    if panel.series.is_empty() && panel.markers.is_empty() {
        return Err(ReportError::EmptyPanel {
            figure: name(),
            panel: index,
        });
    }
    let shared = figure.share != Share::Nothing;
    let linear = panel.x.scale == Scale::Linear && panel.y.scale == Scale::Linear;
    if panel.aspect == Aspect::Equal && (shared || !linear) {
        return Err(ReportError::EqualAspect {
            figure: name(),
            panel: index,
        });
    }

    let mut xs = Vec::new();
    let mut ys = Vec::new();
    let mut not_positive = 0;
    let mut placed = 0;
    for (number, series) in panel.series.iter().enumerate() {
        if let Style::Band { lower } = &series.style
            && lower.len() != series.points.len()
        {
            let (points, lower) = (series.points.len(), lower.len());
            return Err(ReportError::BandLength {
                figure: name(),
                panel: index,
                series: number,
                points,
                lower,
            });
        }
        account.points += series.points.len();
        for place in places(panel, series) {
            match place {
                Ok((x, low, high)) => {
                    xs.push(x);
                    ys.extend([if low.is_finite() { low } else { high }, high]);
                    placed += 1;
                }
                Err(Refused::NotFinite) => account.not_finite += 1,
                Err(Refused::NotPositive) => not_positive += 1,
            }
        }
    }
    account.not_positive += not_positive;
    let data = (xs.len(), ys.len());
    for marker in &panel.markers {
        match marker.place {
            Place::Vertical(x) => xs.extend(coordinate(panel.x.scale, x)),
            Place::Horizontal(y) => ys.extend(coordinate(panel.y.scale, y)),
            Place::Point(x, y) => {
                if let (Ok(x), Ok(y)) = (coordinate(panel.x.scale, x), coordinate(panel.y.scale, y)) {
                    xs.push(x);
                    ys.push(y);
                }
            }
        }
    }

    let joined = panel
        .series
        .iter()
        .any(|s| s.style.is_line() || matches!(s.style, Style::Band { .. }));
    let tight = joined && panel.aspect == Aspect::Free;
    let padding = if tight { Padding::Tight } else { Padding::Loose };
    let x = range(figure, index, 'x', &panel.x, &xs, padding)?;
    let y = range(figure, index, 'y', &panel.y, &ys, Padding::Loose)?;
    let within = |v: f64, (lower, upper): Range| v >= lower && v <= upper;
    let pairs = xs[..data.0].iter().zip(ys[..data.1].chunks(2));
    account.outside += pairs
        .filter(|(px, py)| !within(**px, x) || !py.iter().any(|&v| within(v, y)))
        .count();
    Ok(Ranges {
        x,
        y,
        placed,
        not_positive,
    })
}

/// The points of a series as `(x, low, high)` in axis coordinates; `low` and `high` differ only for a band.
///
/// The lower edge of a confidence band is often negative; on a logarithmic axis the band then reaches down to
/// minus infinity, which is what it means.
pub(crate) fn places<'s>(
    panel: &Panel,
    series: &'s Series,
) -> impl Iterator<Item = Result<(f64, f64, f64), Refused>> + use<'s> {
    let (x_scale, y_scale) = (panel.x.scale, panel.y.scale);
    let lower: &[f64] = match &series.style {
        Style::Band { lower } => lower,
        _ => &[],
    };
    series.points.iter().enumerate().map(move |(index, &(x, y))| {
        let b = coordinate(y_scale, y)?;
        let a = match lower.get(index).map_or(Ok(b), |&low| coordinate(y_scale, low)) {
            Err(Refused::NotPositive) => f64::NEG_INFINITY,
            other => other?,
        };
        Ok((coordinate(x_scale, x)?, a.min(b), a.max(b)))
    })
}

fn range(
    figure: &Figure,
    panel: usize,
    name: char,
    axis: &Axis,
    values: &[f64],
    padding: Padding,
) -> Result<Range, ReportError> {
    match axis.range {
        Some((lower, upper)) => view::fixed(axis, (lower, upper)).ok_or_else(|| ReportError::AxisRange {
            figure: figure.title.clone(),
            panel,
            axis: name,
            lower,
            upper,
        }),
        None => Ok(view::automatic(values.iter().copied(), axis.scale, padding).unwrap_or((0.0, 1.0))),
    }
}

/// The direction along which an axis is shared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Which {
    X,
    Y,
}

/// Gives all panels of a column one x range, or all panels of a row one y range.
fn share(figure: &Figure, ranges: &mut [Ranges], which: Which) -> Result<(), ReportError> {
    let group = |index: usize| match which {
        Which::X => index % figure.columns,
        Which::Y => index / figure.columns,
    };
    let axis = |index: usize| match which {
        Which::X => &figure.panels[index].x,
        Which::Y => &figure.panels[index].y,
    };
    // A panel without data stands at (0, 1) and must not widen the others, unless its range is fixed.
    let speaks = |ranges: &[Ranges], index: usize| ranges[index].placed > 0 || axis(index).range.is_some();
    for index in 0..ranges.len() {
        let members: Vec<usize> = (0..ranges.len())
            .filter(|&other| group(other) == group(index))
            .collect();
        if members[0] != index {
            continue;
        }
        for &other in &members {
            if axis(other).scale != axis(index).scale {
                let name = if which == Which::X { 'x' } else { 'y' };
                return Err(ReportError::SharedScale {
                    figure: figure.title.clone(),
                    panel: other,
                    axis: name,
                });
            }
        }
        let get = |r: &Ranges| if which == Which::X { r.x } else { r.y };
        let common = members
            .iter()
            .filter(|&&m| speaks(ranges, m))
            .map(|&m| get(&ranges[m]))
            .reduce(view::union);
        if let Some(common) = common {
            for member in members {
                match which {
                    Which::X => ranges[member].x = common,
                    Which::Y => ranges[member].y = common,
                }
            }
        }
    }
    Ok(())
}

fn check_step(
    figure: &Figure,
    panel: usize,
    name: char,
    axis: &Axis,
    range: Range,
) -> Result<(), ReportError> {
    let Some(step) = axis.step else { return Ok(()) };
    let count = (range.1 - range.0) / step;
    if axis.scale == Scale::Linear && step > 0.0 && count <= 100.0 && step.is_finite() {
        return Ok(());
    }
    Err(ReportError::TickStep {
        figure: figure.title.clone(),
        panel,
        axis: name,
        step,
        count,
    })
}

/// Widens one of two ranges so that a unit has the same length on a plot of this size.
pub(crate) fn equalise(x: Range, y: Range, width: f64, height: f64) -> (Range, Range) {
    let unit = ((x.1 - x.0) / width).max((y.1 - y.0) / height);
    let widen = |(lower, upper): Range, length: f64| {
        let (middle, half) = (lower + 0.5 * (upper - lower), 0.5 * unit * length);
        (middle - half, middle + half)
    };
    (widen(x, width), widen(y, height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_equal_aspect_widens_one_range_about_its_middle() {
        let (x, y) = equalise((0.0, 1.0), (-1.0, 1.0), 200.0, 100.0);
        assert_eq!(y, (-1.0, 1.0));
        assert_eq!(x, (-1.5, 2.5));
    }
}
