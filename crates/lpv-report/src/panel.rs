//! One pair of axes with what is drawn between them.

use crate::{Marker, Series};

/// One pair of axes, its series and its markers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Panel {
    /// Title above the axes; may be empty.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// What is drawn, first at the back.
    pub series: Vec<Series>,
    /// Lines and words across the panel.
    pub markers: Vec<Marker>,
    /// Whether a unit is as long on both axes.
    pub aspect: Aspect,
}

/// An axis: its name, its scale and, if fixed, its range and ticks.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `label` | empty | name and unit; `_{..}` and `^{..}` set sub- and superscripts | any text |
/// | `scale` | linear | | |
/// | `range` | from the data | lower and upper end, data units | within ±1e290, lower < upper; at least 1e-290 if log |
/// | `step` | from the size | distance between ticks (90 for a phase) | above 0, at most 100 ticks, linear only |
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// Name and unit.
    pub label: String,
    /// Linear or logarithmic.
    pub scale: Scale,
    /// Ends of the axis; from the data if absent.
    pub range: Option<(f64, f64)>,
    /// Distance between ticks; from the size if absent.
    pub step: Option<f64>,
}

/// Linear or logarithmic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scale {
    /// Equal distances.
    #[default]
    Linear,
    /// Equal ratios, base 10; only positive values can be shown.
    Log,
}

/// Whether a unit is as long on both axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Aspect {
    /// Each axis fills the panel.
    #[default]
    Free,
    /// One unit of x is as long as one unit of y, so that a circle is round; one range is widened for it.
    Equal,
}

impl Axis {
    /// A linear axis over the range of the data.
    pub fn linear(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..Self::default()
        }
    }

    /// A logarithmic axis over the range of the positive data.
    pub fn log(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            scale: Scale::Log,
            ..Self::default()
        }
    }

    /// Fixes the ends, in data units.
    pub fn range(mut self, lower: f64, upper: f64) -> Self {
        self.range = Some((lower, upper));
        self
    }

    /// Fixes the distance between ticks of a linear axis.
    pub fn step(mut self, step: f64) -> Self {
        self.step = Some(step);
        self
    }
}

impl Panel {
    /// A panel without title.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self {
            x,
            y,
            ..Self::default()
        }
    }

    /// Title above the axes.
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Adds a series on top of those before it.
    pub fn series(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Adds a marker.
    pub fn marker(mut self, marker: Marker) -> Self {
        self.markers.push(marker);
        self
    }

    /// Makes a unit as long on both axes; both must be linear and not shared.
    pub fn equal_aspect(mut self) -> Self {
        self.aspect = Aspect::Equal;
        self
    }
}
