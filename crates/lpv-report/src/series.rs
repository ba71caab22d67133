//! One curve, cloud or band, and the marks beside it.

use crate::Colour;

/// Points drawn in one style and colour.
///
/// A point with a NaN or infinite coordinate, or with a coordinate that is not positive on a logarithmic axis,
/// is not drawn and breaks the line.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend; a series without one has no entry.
    pub label: Option<String>,
    /// `(x, y)` in the units of the axes, in drawing order. For a band, `y` is the upper edge.
    pub points: Vec<(f64, f64)>,
    /// How the points are drawn.
    pub style: Style,
    /// Colour from the palette.
    pub colour: Colour,
    /// Line width in px (lines), or diameter of the symbol in px (dots, circles, crosses).
    pub width: f64,
}

/// How the points of a [`Series`] are drawn.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Style {
    /// A continuous line, 1.4 px by default.
    #[default]
    Line,
    /// Dashes, 1.4 px by default.
    Dashed,
    /// Short dots along the line, 1.6 px by default.
    Dotted,
    /// Dash and dot in turn, 1.4 px by default.
    DashDot,
    /// Filled discs, 3.6 px by default.
    Dots,
    /// Open circles, 6.5 px by default.
    Circles,
    /// Diagonal crosses (the symbol of a pole), 6.5 px by default.
    Crosses,
    /// The area between `lower` and the points, in a light tint.
    Band {
        /// Lower edge, one value a point.
        lower: Vec<f64>,
    },
}

impl Style {
    fn default_width(&self) -> f64 {
        match self {
            Style::Line | Style::Dashed | Style::DashDot => 1.4,
            Style::Dotted => 1.6,
            Style::Dots => 3.6,
            Style::Circles | Style::Crosses => 6.5,
            Style::Band { .. } => 0.0,
        }
    }

    /// Whether the points are joined by a line.
    pub(crate) fn is_line(&self) -> bool {
        matches!(self, Style::Line | Style::Dashed | Style::Dotted | Style::DashDot)
    }
}

impl Series {
    /// Points in a given style, in the model's colour and the style's default width.
    pub fn new(points: Vec<(f64, f64)>, style: Style) -> Self {
        let width = style.default_width();
        Self {
            label: None,
            points,
            style,
            colour: Colour::default(),
            width,
        }
    }

    /// A continuous line.
    pub fn line(points: Vec<(f64, f64)>) -> Self {
        Self::new(points, Style::Line)
    }

    /// A line from two lists; the longer one is cut to the shorter.
    pub fn xy(x: &[f64], y: &[f64], style: Style) -> Self {
        Self::new(x.iter().copied().zip(y.iter().copied()).collect(), style)
    }

    /// The area between two curves over the same x, as `(x, lower, upper)`.
    pub fn band(edges: &[(f64, f64, f64)]) -> Self {
        let points = edges.iter().map(|&(x, _, upper)| (x, upper)).collect();
        let lower = edges.iter().map(|&(_, lower, _)| lower).collect();
        Self::new(points, Style::Band { lower })
    }

    /// Name in the legend.
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// Colour from the palette.
    pub fn colour(mut self, colour: Colour) -> Self {
        self.colour = colour;
        self
    }

    /// Line width or symbol diameter, px from 0.1 to 30; values outside are brought to the nearest end.
    pub fn width(mut self, width_px: f64) -> Self {
        self.width = width_px;
        self
    }

    /// The width that is drawn.
    pub(crate) fn drawn_width(&self) -> f64 {
        if self.width.is_finite() {
            self.width.clamp(0.1, 30.0)
        } else {
            self.style.default_width()
        }
    }
}

/// A line across a panel or a word in it: a bar to meet, a mode, the Nyquist frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// Where it stands.
    pub place: Place,
    /// Text beside it, if any.
    pub label: Option<String>,
    /// Colour from the palette, grey by default.
    pub colour: Colour,
}

/// Where a [`Marker`] stands, in the units of the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Place {
    /// A vertical line at this x.
    Vertical(f64),
    /// A horizontal line at this y.
    Horizontal(f64),
    /// No line, only the text, to the right of this point.
    Point(f64, f64),
}

impl Marker {
    /// A vertical line.
    pub fn vertical(x: f64) -> Self {
        Self {
            place: Place::Vertical(x),
            label: None,
            colour: Colour::Bound,
        }
    }

    /// A horizontal line.
    pub fn horizontal(y: f64) -> Self {
        Self {
            place: Place::Horizontal(y),
            label: None,
            colour: Colour::Bound,
        }
    }

    /// A word to the right of a point.
    pub fn text(x: f64, y: f64, text: impl Into<String>) -> Self {
        Self {
            place: Place::Point(x, y),
            label: Some(text.into()),
            colour: Colour::Bound,
        }
    }

    /// Text beside the line.
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// Colour from the palette.
    pub fn colour(mut self, colour: Colour) -> Self {
        self.colour = colour;
        self
    }
}
