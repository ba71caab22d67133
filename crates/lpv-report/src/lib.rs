//! Results in, pictures and one self-contained page out. It computes nothing about models.
//!
//! # The problem
//!
//! A panel maps data to the unit square by `u = (c(v) - c(a)) / (c(b) - c(a))` on each axis, with `c(v) = v` on a linear and
//! `c(v) = log10 v` on a logarithmic axis from `a` to `b`. Ticks are the multiples of `m 10^k`, m in {1, 2, 5}, on a
//! linear axis and the powers of ten on a logarithmic one. A record of N samples is drawn on a few hundred pixel
//! columns: of the samples in one column only the lowest and the highest are kept, then the line is simplified
//! (Douglas and Peucker, 1973) to within 0.08 px. So a resonance one sample wide keeps its height, and the size of
//! the drawing does not grow with N.
//!
//! # Glossary
//!
//! - *Figure*: a grid of *panels* with one title and a caption. *Panel*: two axes and what is drawn between them.
//! - *Series*: points in one style. *Marker*: a line across a panel, or a word in it.
//! - *Bar*: the requirement that a number is held against; the page shows whether it is met.
//! - *Page*: sections with text, key figures, tables and figures, in one HTML file.
//!
//! Labels, captions and text set `W_{17}` and `10^{-3}` with sub- and superscripts; everything is escaped.
//!
//! # What it does not do
//!
//! It never sees a model, a record or a file: no decibels, no statistics, no fits, so that no number on a page can differ
//! from the one that was computed elsewhere. It never reads the machine's fonts, the clock or the network: the same
//! input gives the same bytes, a page opens without a connection, and a PNG is drawn with an embedded font. It has no
//! three-dimensional plots or second y axes.
//! It writes its few SVG elements itself: a plotting library of general purpose would decide about ticks, legends and
//! thinning, which is all that there is to decide here.
//!
//! # The script of a page
//!
//! A page with figures holds one script, `page.js`, which its content policy names by its hash; nothing else runs, and nothing is
//! loaded. It reads values under the cursor, zooms (panels of one x axis together), and turns series off by their entry in the
//! legend, by mouse, touch and keyboard. It draws nothing that is not there without it: the figures are whole on paper and where
//! scripts are off. Every figure is drawn twice, for a wide window and for a phone; the style sheet shows the one that fits.
//!
//! | keys, on a panel | |
//! |---|---|
//! | left, right | value at the point before, after |
//! | up, down | next series |
//! | `+`, `-` | zoom |
//! | Shift and arrows | move |
//! | `0`, Escape | as it was |
//!
//! # A run
//!
//! ```
//! use lpv_report::{Axis, Bar, Cell, Figure, KeyFigure, Page, Panel, Section, Series};
//!
//! let gain: Vec<(f64, f64)> = (1..=1000).map(|k| 0.01 * f64::from(k)).map(|f| (f, 1.0 / (f * f))).collect();
//! let figure = Figure::new("Rigid body").caption("Magnitude of the double integrator.").panel(
//!     Panel::new(Axis::log("Frequency (1/s)"), Axis::log("|G_{11}|")).series(Series::line(gain).label("1/f^{2}")),
//! );
//! let error = Cell::decibel(-62.1, 1).bar(Bar::AtMost(-40.0));
//! let page = Page::new("Identification")
//!     .fact("seed", "42")
//!     .section(Section::new("Result").key_figures([KeyFigure::new(error, "strict error")]).figure(figure));
//! let html = page.to_html()?;
//! assert!(html.contains("<svg") && !html.contains("://"));
//! # Ok::<(), lpv_report::ReportError>(())
//! ```

mod cell;
mod colour;
mod curves;
mod decimate;
mod draw;
mod error;
mod figure;
mod hooks;
mod layout;
mod legend;
mod marks;
mod page;
mod panel;
#[cfg(feature = "png")]
mod png;
mod policy;
mod ranges;
mod series;
mod style;
mod svg;
mod table;
mod text;
mod ticks;
mod view;

pub use cell::{Bar, Cell, Format, Verdict};
pub use colour::Colour;
pub use error::ReportError;
pub use figure::{Account, Figure, Legend, Share};
pub use page::{Block, GENERATOR, KeyFigure, Page, Section, Tone};
pub use panel::{Aspect, Axis, Panel, Scale};
pub use series::{Marker, Place, Series, Style};
pub use table::Table;
