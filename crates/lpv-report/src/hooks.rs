//! What the script of a page finds in a drawing: groups and data attributes. A drawing of its own has none.
//!
//! A panel says its size in px, its axes as `scale low high` in axis coordinates, their names, and which of them have numbers.
//! A series says its kind and the entries of the legend that turn it off; a word beside a line says its place in px.

use crate::figure::Figure;
use crate::layout::{Labels, Placed};
use crate::legend::{self, Entry, ROW};
use crate::panel::Scale;
use crate::series::{Place, Series, Style};
use crate::svg::{Svg, px};
use crate::text;
use crate::view::View;

/// A part that a zoom replaces.
pub(crate) const AXES: &str = " class=\"ax\"";
/// Lines across a panel, which zoom with the data.
pub(crate) const LINES: &str = " data-t=\"mark\"";

/// The attributes of a drawing.
#[derive(Debug)]
pub(crate) struct Hooks<'f> {
    /// What the legend of the figure names, one series an entry; none in a drawing of its own.
    entries: Option<Vec<&'f Series>>,
}

impl<'f> Hooks<'f> {
    /// Of a drawing that no script reads.
    pub(crate) fn none() -> Self {
        Self { entries: None }
    }

    /// Of a figure on a page.
    pub(crate) fn of(figure: &'f Figure) -> Self {
        let all = legend::distinct(figure.panels.iter().flat_map(|p| p.series.iter()));
        Self { entries: Some(all) }
    }

    /// Draws within a group with these attributes; without a group in a drawing of its own, or where nothing is drawn.
    pub(crate) fn group(&self, svg: &mut Svg, attributes: &str, draw: impl FnOnce(&mut Svg)) {
        if self.entries.is_none() {
            return draw(svg);
        }
        let before = svg.body.len();
        svg.push(&format!("<g{attributes}>"));
        let opened = svg.body.len();
        draw(svg);
        if svg.body.len() == opened {
            svg.body.truncate(before);
        } else {
            svg.push("</g>");
        }
    }

    /// Attributes of a panel.
    pub(crate) fn panel(&self, placed: &Placed) -> String {
        if self.entries.is_none() {
            return String::new();
        }
        let axis = |view: &View| {
            let scale = match view.scale {
                Scale::Linear => "linear",
                Scale::Log => "log",
            };
            format!("{scale} {:e} {:e}", view.range.0, view.range.1)
        };
        let numbers = |labels, name| if labels == Labels::Shown { name } else { "" };
        format!(
            " data-size=\"{} {}\" data-x=\"{}\" data-y=\"{}\" data-xl=\"{}\" data-yl=\"{}\" data-n=\"{}{}\"",
            px(placed.width),
            px(placed.height),
            axis(&placed.x),
            axis(&placed.y),
            text::plain(&placed.panel.x.label),
            text::plain(&placed.panel.y.label),
            numbers(placed.x_labels, "x"),
            numbers(placed.y_labels, "y"),
        )
    }

    /// Attributes of an entry of the legend, with its box: left, top, width and height.
    pub(crate) fn entry(&self, entry: &Entry, (left, middle): (f64, f64)) -> String {
        let own = self.number(|e| e.label == entry.series.label);
        let width = legend::sample(entry.series) + text::width(&entry.label, entry.size) + 11.0;
        own.map_or(String::new(), |n| {
            let [x, y, width, height] = [left - 3.0, middle - 0.5 * ROW, width, ROW].map(px);
            format!(" class=\"entry\" data-k=\"{n}\" data-box=\"{x} {y} {width} {height}\"")
        })
    }

    /// Attributes of a series. One without a name goes with the entries of its colour, and with those of its style that have
    /// no points: they name what all such series are.
    pub(crate) fn series(&self, series: &Series) -> String {
        let kind = match series.style {
            Style::Band { .. } => "band",
            Style::Dots => "dots",
            Style::Circles | Style::Crosses => "sign",
            _ => "line",
        };
        let named = series.label.as_deref().is_some_and(|label| !label.is_empty());
        let style = std::mem::discriminant(&series.style);
        let goes_with = |e: &Series| match named {
            true => e.label == series.label,
            false => {
                e.colour.slot() == series.colour.slot()
                    || (e.points.is_empty() && std::mem::discriminant(&e.style) == style)
            }
        };
        let mut keys: Vec<usize> = self
            .entries
            .iter()
            .flatten()
            .filter(|e| goes_with(e))
            .flat_map(|e| self.number(|o| o.label == e.label))
            .collect();
        keys.sort_unstable();
        keys.dedup();
        let keys: Vec<String> = keys.iter().map(usize::to_string).collect();
        format!(" data-t=\"{kind}\" data-k=\"{}\"", keys.join(" "))
    }

    /// Attributes of a word; `x` or `y` for a coordinate that it has none of.
    pub(crate) fn note(&self, placed: &Placed, place: Place) -> String {
        let x = |x| {
            placed
                .x
                .place(x)
                .map_or(String::from("x"), |u| px(placed.width * u))
        };
        let y = |y| {
            placed
                .y
                .place(y)
                .map_or(String::from("y"), |u| px(placed.height * (1.0 - u)))
        };
        let (x, y) = match place {
            Place::Vertical(at) => (x(at), String::from("y")),
            Place::Horizontal(at) => (String::from("x"), y(at)),
            Place::Point(h, v) => (x(h), y(v)),
        };
        format!(" data-at=\"{x} {y}\"")
    }

    /// Entries of one name, in several styles, have the number of the first.
    fn number(&self, is: impl Fn(&Series) -> bool) -> Option<usize> {
        self.entries.as_ref()?.iter().position(|e| is(e))
    }
}
