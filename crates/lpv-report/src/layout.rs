//! Where everything stands, in px of the drawing, before anything is drawn.

use crate::figure::{Account, Figure, Share};
use crate::legend::{self, Rows};
use crate::panel::{Aspect, Axis, Panel};
use crate::ranges::{self, Ranges};
use crate::ticks::{self, Ticks};
use crate::view::View;
use crate::{ReportError, text};

/// Size of tick labels, axis names, panel titles and the figure's title, px.
pub(crate) const TICK_SIZE: f64 = 10.0;
pub(crate) const NAME_SIZE: f64 = 11.0;
pub(crate) const TITLE_SIZE: f64 = 11.5;
pub(crate) const FIGURE_TITLE_SIZE: f64 = 13.5;
/// Outer margin and room right of a plot, where half a tick label may stand out.
const EDGE: f64 = 8.0;
const RIGHT: f64 = 16.0;
/// Distance per labelled tick, px.
const X_TICK_EVERY: f64 = 62.0;
const Y_TICK_EVERY: f64 = 34.0;
/// Room of the rows of text around a plot, px.
const FACTOR_ROW: f64 = 12.0;
const TITLE_ROW: f64 = 18.0;
const TICK_ROW: f64 = 19.0;
const NAME_ROW: f64 = 17.0;
const GAP: f64 = 9.0;

/// Whether numbers and name stand at an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Labels {
    Shown,
    Hidden,
}

/// One panel with the rectangle of its plot.
#[derive(Debug)]
pub(crate) struct Placed<'f> {
    pub(crate) panel: &'f Panel,
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(crate) x: View,
    pub(crate) y: View,
    pub(crate) x_labels: Labels,
    pub(crate) y_labels: Labels,
    /// Distance from the left of the plot to the baseline of the y axis' name.
    pub(crate) y_name: f64,
    pub(crate) legend: Rows<'f>,
    pub(crate) has_factor_row: bool,
    pub(crate) ranges: Ranges,
}

/// The whole drawing.
#[derive(Debug)]
pub(crate) struct Layout<'f> {
    pub(crate) figure: &'f Figure,
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(crate) legend: Rows<'f>,
    /// Where the figure's legend begins: left end and top.
    pub(crate) legend_at: (f64, f64),
    pub(crate) panels: Vec<Placed<'f>>,
    pub(crate) account: Account,
}

impl<'f> Layout<'f> {
    /// Checks the figure and places its parts.
    pub(crate) fn new(figure: &'f Figure) -> Result<Self, ReportError> {
        let count = figure.panels.len();
        if count == 0 {
            return Err(ReportError::EmptyFigure {
                figure: figure.title.clone(),
            });
        }
        if !(1..=8).contains(&figure.columns) {
            return Err(figure.size_error("the number of columns", figure.columns as f64, 1.0, 8.0));
        }
        if count > 200 {
            return Err(figure.size_error("the number of panels", count as f64, 1.0, 200.0));
        }
        let (width, plot_height) = sizes(figure)?;
        let columns = figure.columns.min(count);
        let (ranges, account) = ranges::of_figure(figure)?;

        let most_y = ((plot_height / Y_TICK_EVERY) as usize).max(2);
        let y_view = |index: usize, range| View::new(&figure.panels[index].y, range, most_y);
        let y_views: Vec<View> = (0..count).map(|i| y_view(i, ranges[i].y)).collect();
        let y_labels = |index: usize| match figure.share {
            Share::Both if !index.is_multiple_of(figure.columns) => Labels::Hidden,
            _ => Labels::Shown,
        };
        let x_labels = |index: usize| match figure.share {
            Share::X | Share::Both if index + figure.columns < count => Labels::Hidden,
            _ => Labels::Shown,
        };

        // Columns: what stands left of each plot decides what is left for the plots.
        let left_of = |index: usize| -> (f64, f64) {
            if y_labels(index) == Labels::Hidden {
                return (6.0, 0.0);
            }
            let panel = &figure.panels[index];
            let numbers =
                widest(&y_views[index].ticks).max(if panel.aspect == Aspect::Equal { 28.0 } else { 0.0 });
            let name = if panel.y.label.is_empty() { 0.0 } else { 17.0 };
            (numbers + 8.0 + name, numbers + 13.0)
        };
        let mut column_left = vec![0.0_f64; columns];
        let mut column_name = vec![0.0_f64; columns];
        for index in 0..count {
            let (left, name) = left_of(index);
            let column = index % figure.columns;
            column_left[column] = column_left[column].max(left);
            column_name[column] = column_name[column].max(name);
        }
        let taken = 2.0 * EDGE + column_left.iter().sum::<f64>() + RIGHT * columns as f64;
        let plot_width = (width - taken) / columns as f64;
        if plot_width < 48.0 {
            return Err(ReportError::TooNarrow {
                figure: figure.title.clone(),
                columns,
                plot_px: plot_width,
            });
        }

        // Rows: text above and below each plot decides the height.
        let (for_figure, for_panels) = legend::assign(figure);
        let first_left = EDGE + column_left[0];
        let legend_rows = legend::rows(&for_figure, width - first_left - EDGE);
        let mut top = EDGE + if figure.title.is_empty() { 0.0 } else { 22.0 };
        let legend_at = (first_left, top);
        if !legend_rows.is_empty() {
            top += legend::ROW * legend_rows.len() as f64 + 4.0;
        }

        let mut panels = Vec::with_capacity(count);
        for row in (0..count).step_by(figure.columns) {
            let members = row..(row + figure.columns).min(count);
            let mut placed: Vec<Placed> = Vec::new();
            let mut header = 3.0_f64;
            let mut footer = 0.0_f64;
            let mut left = EDGE;
            for index in members {
                let panel = &figure.panels[index];
                let column = index % figure.columns;
                left += column_left[column];
                let mut ranges = ranges[index];
                let mut y = y_views[index].clone();
                if panel.aspect == Aspect::Equal {
                    (ranges.x, ranges.y) = ranges::equalise(ranges.x, ranges.y, plot_width, plot_height);
                    y = y_view(index, ranges.y);
                }
                let x = x_view(&panel.x, ranges.x, plot_width);
                let legend = legend::rows(&for_panels[index], plot_width);
                let has_factor_row = factor_needs_row(panel, &y, y_labels(index), &legend, plot_width);
                let title = if panel.title.is_empty() { 0.0 } else { TITLE_ROW };
                let factor = if has_factor_row { FACTOR_ROW } else { 0.0 };
                header = header.max(3.0 + title + legend::ROW * legend.len() as f64 + factor);
                footer = footer.max(match x_labels(index) {
                    Labels::Hidden => 0.0,
                    Labels::Shown if panel.x.label.is_empty() && x.ticks.factor.is_none() => TICK_ROW,
                    Labels::Shown => TICK_ROW + NAME_ROW,
                });
                placed.push(Placed {
                    panel,
                    left,
                    top: 0.0,
                    width: plot_width,
                    height: plot_height,
                    x,
                    y,
                    x_labels: x_labels(index),
                    y_labels: y_labels(index),
                    y_name: column_name[column],
                    legend,
                    has_factor_row,
                    ranges,
                });
                left += plot_width + RIGHT;
            }
            for mut panel in placed {
                panel.top = top + header;
                panels.push(panel);
            }
            top += header + plot_height + footer + GAP;
        }
        let height = top - GAP + EDGE;
        Ok(Self {
            figure,
            width,
            height,
            legend: legend_rows,
            legend_at,
            panels,
            account,
        })
    }
}

/// Width of the drawing and height of a plot, checked.
fn sizes(figure: &Figure) -> Result<(f64, f64), ReportError> {
    let alone = figure.panels.len() == 1;
    let (width, height) = match figure.columns {
        1 => (620.0, if alone { 300.0 } else { 130.0 }),
        2 => (760.0, 190.0),
        3 => (920.0, 165.0),
        _ => (1040.0, 140.0),
    };
    let (width, height) = (
        figure.width.unwrap_or(width),
        figure.plot_height.unwrap_or(height),
    );
    if !(160.0..=4000.0).contains(&width) {
        return Err(figure.size_error("the width in px", width, 160.0, 4000.0));
    }
    if !(40.0..=2000.0).contains(&height) {
        return Err(figure.size_error("the plot height in px", height, 40.0, 2000.0));
    }
    Ok((width, height))
}

/// The x axis with as many ticks as its labels leave room for.
fn x_view(axis: &Axis, range: (f64, f64), width: f64) -> View {
    let mut most = ((width / X_TICK_EVERY) as usize).max(2);
    loop {
        let view = View::new(axis, range, most);
        let places: Vec<f64> = view
            .ticks
            .major
            .iter()
            .map(|(at, _)| width * view.unit(*at))
            .collect();
        let room = places
            .windows(2)
            .map(|w| w[1] - w[0])
            .fold(f64::INFINITY, f64::min);
        if most <= 2 || widest(&view.ticks) + 6.0 <= room {
            return view;
        }
        most -= 1;
    }
}

fn widest(ticks: &Ticks) -> f64 {
    ticks
        .major
        .iter()
        .map(|(_, label)| text::width(label, TICK_SIZE))
        .fold(0.0, f64::max)
}

/// What all labels are to be multiplied by.
pub(crate) fn factor_label(exponent: i32) -> String {
    format!("×{}", ticks::power(exponent))
}

/// Whether the factor of the y axis needs a row of its own above the plot.
fn factor_needs_row(panel: &Panel, y: &View, labels: Labels, legend: &Rows, width: f64) -> bool {
    let (Some(exponent), Labels::Shown) = (y.ticks.factor, labels) else {
        return false;
    };
    let own = text::width(&factor_label(exponent), TICK_SIZE);
    let title = text::width(&panel.title, TITLE_SIZE);
    panel.title.is_empty() || !legend.is_empty() || 0.5 * (width - title) < own + 6.0
}
