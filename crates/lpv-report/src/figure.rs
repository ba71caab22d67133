//! A figure: a grid of panels with one title, one caption and one legend policy.

use crate::{Panel, ReportError, text};

/// A grid of panels.
///
/// | setting | default | meaning | range |
/// |---|---|---|---|
/// | `columns` | 1 | panels side by side, filled row by row | 1 to 8 |
/// | `width` | 620, 760, 920, 1040 for 1, 2, 3, more columns | of the drawing, px | 160 to 4000 |
/// | `plot_height` | 300 alone; 190, 165, 140 for 2, 3, more columns; 130 stacked | of each plot, px | 40 to 2000 |
/// | `share` | nothing | axes in common along columns and rows | |
/// | `legend` | automatic | where series are named, never over the data | |
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Title above the panels; may be empty.
    pub title: String,
    /// Explanation under the figure on a page; not part of the drawing.
    pub caption: String,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Number of panels side by side.
    pub columns: usize,
    /// Width of the drawing in px.
    pub width: Option<f64>,
    /// Height of each plot in px.
    pub plot_height: Option<f64>,
    /// Axes in common.
    pub share: Share,
    /// Where series are named.
    pub legend: Legend,
}

/// Which axes panels have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Share {
    /// Every panel has its own axes.
    #[default]
    Nothing,
    /// One x range a column; its numbers and name only at the bottom.
    X,
    /// Also one y range a row; its numbers and name only at the left.
    Both,
}

/// Where series are named.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Legend {
    /// Once above all panels if one panel shows every named series, else above each panel.
    #[default]
    Auto,
    /// Once above all panels.
    Figure,
    /// Above each panel.
    Panel,
    /// Nowhere.
    Hidden,
}

/// What became of the points of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Account {
    /// Points of all series.
    pub points: usize,
    /// Points left out because a coordinate is NaN, infinite or beyond 1e290.
    pub not_finite: usize,
    /// Points left out because a coordinate is not positive (below 1e-290) on a logarithmic axis.
    pub not_positive: usize,
    /// Points with a place on both axes but outside a fixed range.
    pub outside: usize,
    /// Length of the SVG in bytes.
    pub svg_bytes: usize,
}

impl Figure {
    /// A figure of one column without panels.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            caption: String::new(),
            panels: Vec::new(),
            columns: 1,
            width: None,
            plot_height: None,
            share: Share::default(),
            legend: Legend::default(),
        }
    }

    /// Explanation under the figure on a page.
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Adds a panel; the grid is filled row by row.
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Number of panels side by side.
    pub fn columns(mut self, columns: usize) -> Self {
        self.columns = columns;
        self
    }

    /// Width of the drawing in px.
    pub fn width(mut self, width_px: f64) -> Self {
        self.width = Some(width_px);
        self
    }

    /// Height of each plot in px.
    pub fn plot_height(mut self, height_px: f64) -> Self {
        self.plot_height = Some(height_px);
        self
    }

    /// Axes in common.
    pub fn share(mut self, share: Share) -> Self {
        self.share = share;
        self
    }

    /// Where series are named.
    pub fn legend(mut self, legend: Legend) -> Self {
        self.legend = legend;
        self
    }

    /// What it shows, for those who do not see it: its title, else what its panels show.
    pub(crate) fn spoken(&self) -> String {
        if !self.title.is_empty() {
            return text::plain(&self.title);
        }
        let of = |p: &Panel| {
            let axes = [&p.y.label, &p.x.label].map(|label| text::plain(label));
            let axes = axes
                .into_iter()
                .filter(|a| !a.is_empty())
                .collect::<Vec<_>>()
                .join(" over ");
            match p.title.is_empty() {
                true => axes,
                false => format!("{}: {axes}", text::plain(&p.title)),
            }
        };
        let mut all: Vec<String> = self.panels.iter().map(of).collect();
        all.dedup();
        all.join("; ")
    }

    /// The same for a phone: panels below each other, or in pairs where they were small.
    pub(crate) fn for_phone(&self) -> Self {
        /// Width of a column of text on a phone, px.
        const WIDTH: f64 = 350.0;
        let alone = self.panels.len() == 1;
        let height = self.plot_height.unwrap_or(if alone { 220.0 } else { 130.0 });
        Self {
            columns: if self.columns > 2 { 2 } else { 1 },
            width: Some(WIDTH),
            plot_height: Some(height.min(260.0)),
            share: match self.columns {
                1 => self.share,
                _ => Share::Nothing,
            },
            ..self.clone()
        }
    }

    pub(crate) fn size_error(&self, what: &'static str, value: f64, lower: f64, upper: f64) -> ReportError {
        ReportError::Size {
            figure: self.title.clone(),
            what,
            value,
            lower,
            upper,
        }
    }
}
