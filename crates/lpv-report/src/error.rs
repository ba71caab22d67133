//! What can be wrong with a figure, a table or a page.

/// Every refusal of this crate. The fields carry the facts; the text says what to do about them.
///
/// Points that are NaN, infinite or not positive on a logarithmic axis are no error: they break the line
/// and are counted in [`crate::Account`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A figure without any panel.
    #[error("figure \"{figure}\" has no panel; add one with Figure::panel before drawing it")]
    EmptyFigure {
        /// Title of the figure.
        figure: String,
    },
    /// A panel with neither series nor markers.
    #[error("figure \"{figure}\", panel {panel}: no series and no marker; add one or leave the panel out")]
    EmptyPanel {
        /// Title of the figure.
        figure: String,
        /// Index of the panel, from 0.
        panel: usize,
    },
    /// An axis range that encloses nothing.
    #[error(
        "figure \"{figure}\", panel {panel}, {axis} axis: [{lower}, {upper}] is not a range; give numbers between \
         -1e290 and 1e290, lower < upper, and lower >= 1e-290 on a logarithmic axis"
    )]
    AxisRange {
        /// Title of the figure.
        figure: String,
        /// Index of the panel, from 0.
        panel: usize,
        /// Which axis, `x` or `y`.
        axis: char,
        /// Lower end given.
        lower: f64,
        /// Upper end given.
        upper: f64,
    },
    /// A distance between ticks that makes no ticks or far too many.
    #[error(
        "figure \"{figure}\", panel {panel}, {axis} axis: a tick every {step} gives {count:.3e} ticks; \
         give a positive step that gives at most 100, and none on a logarithmic axis"
    )]
    TickStep {
        /// Title of the figure.
        figure: String,
        /// Index of the panel, from 0.
        panel: usize,
        /// Which axis, `x` or `y`.
        axis: char,
        /// The step given.
        step: f64,
        /// Number of ticks that it asks for.
        count: f64,
    },
    /// Two panels are to share an axis but one is linear and the other logarithmic.
    #[error(
        "figure \"{figure}\", panel {panel}: its {axis} axis is shared but has another scale than its neighbour's"
    )]
    SharedScale {
        /// Title of the figure.
        figure: String,
        /// Index of the panel, from 0.
        panel: usize,
        /// Which axis, `x` or `y`.
        axis: char,
    },
    /// Equal aspect is asked for where it has no meaning.
    #[error("figure \"{figure}\", panel {panel}: equal aspect needs two linear axes that are not shared")]
    EqualAspect {
        /// Title of the figure.
        figure: String,
        /// Index of the panel, from 0.
        panel: usize,
    },
    /// The lower edge of a band does not have one value a point.
    #[error(
        "figure \"{figure}\", panel {panel}, series {series}: {points} points but {lower} lower values; \
         a band needs one lower value a point"
    )]
    BandLength {
        /// Title of the figure.
        figure: String,
        /// Index of the panel, from 0.
        panel: usize,
        /// Index of the series, from 0.
        series: usize,
        /// Number of points (upper edge).
        points: usize,
        /// Number of lower values.
        lower: usize,
    },
    /// A size or a count of the figure that cannot be drawn.
    #[error("figure \"{figure}\": {what} is {value}; give a number from {lower} to {upper}")]
    Size {
        /// Title of the figure.
        figure: String,
        /// The setting.
        what: &'static str,
        /// The value given.
        value: f64,
        /// Smallest value.
        lower: f64,
        /// Largest value.
        upper: f64,
    },
    /// The panels need more room than the figure has.
    #[error(
        "figure \"{figure}\": {columns} columns leave {plot_px:.0} px for a panel; use fewer columns or a wider figure"
    )]
    TooNarrow {
        /// Title of the figure.
        figure: String,
        /// Number of columns.
        columns: usize,
        /// Width that remains for a panel's plot.
        plot_px: f64,
    },
    /// The renderer refused the drawing.
    #[cfg(feature = "png")]
    #[error("figure \"{figure}\": the SVG could not be read back for the PNG")]
    Svg {
        /// Title of the figure.
        figure: String,
        /// What the renderer says.
        source: resvg::usvg::Error,
    },
    /// The bitmap could not be made.
    #[error(
        "figure \"{figure}\": no bitmap of {width_px} x {height_px} pixels can be made; ask for a smaller width"
    )]
    Bitmap {
        /// Title of the figure.
        figure: String,
        /// Width in pixels.
        width_px: u32,
        /// Height in pixels.
        height_px: u32,
    },
    /// The PNG encoder failed.
    #[error("figure \"{figure}\": the PNG could not be encoded")]
    Encode {
        /// Title of the figure.
        figure: String,
        /// What the encoder says.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A table without columns.
    #[error("table \"{table}\" has no columns; give it a head")]
    EmptyTable {
        /// Caption of the table.
        table: String,
    },
    /// A row with another number of cells than the head.
    #[error("table \"{table}\", row {row}: {found} cells under {expected} columns; give one cell a column")]
    RowWidth {
        /// Caption of the table.
        table: String,
        /// Index of the row, from 0.
        row: usize,
        /// Number of columns of the head.
        expected: usize,
        /// Number of cells of the row.
        found: usize,
    },
    /// A page without sections.
    #[error("page \"{page}\" has no section; add one with Page::section")]
    EmptyPage {
        /// Title of the page.
        page: String,
    },
}
