//! The drawing of a layout.

use crate::curves::{dashes, symbols};
use crate::figure::{Account, Figure};
use crate::hooks::{self, Hooks};
use crate::layout::{
    FIGURE_TITLE_SIZE, Labels, Layout, NAME_SIZE, Placed, TICK_SIZE, TITLE_SIZE, factor_label,
};
use crate::legend::{self, Rows};
use crate::marks::{self, halo};
use crate::series::Style;
use crate::svg::{Anchor, FINE, FONTS, FRAME, GRID, INK, MUTED, PAPER, Svg, path, px};
use crate::{ReportError, curves, text};

/// Where the SVG goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mode {
    /// A file of its own.
    Standalone,
    /// Part of an HTML page, which may hold other drawings.
    Inline {
        /// Begins the ids of the drawing.
        id: &'static str,
        /// Number of the drawing on the page.
        number: usize,
    },
}

/// The whole SVG.
pub(crate) fn document(layout: &Layout, mode: Mode) -> String {
    let mut svg = Svg::default();
    let (width, height) = (px(layout.width), px(layout.height));
    let size = match mode {
        Mode::Standalone => {
            format!(" xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\"")
        }
        Mode::Inline { .. } => String::new(),
    };
    let name = text::escape(&layout.figure.spoken());
    svg.push(&format!(
        "<svg{size} viewBox=\"0 0 {width} {height}\" font-family=\"{FONTS}\" role=\"img\" aria-label=\"{name}\">"
    ));
    svg.rect(PAPER, 0.0, 0.0, layout.width, layout.height);
    let (title, title_size) = text::fit(&layout.figure.title, FIGURE_TITLE_SIZE, layout.width - 16.0);
    svg.text(
        (0.5 * layout.width, 21.0),
        Anchor::Middle,
        title_size,
        INK,
        &title,
        " font-weight=\"600\"",
    );
    let hooks = match mode {
        Mode::Standalone => Hooks::none(),
        Mode::Inline { .. } => Hooks::of(layout.figure),
    };
    legend(&mut svg, &hooks, &layout.legend, layout.legend_at);
    for (index, placed) in layout.panels.iter().enumerate() {
        let id = match mode {
            Mode::Standalone => format!("p{index}"),
            Mode::Inline { id, number } => format!("{id}{number}p{index}"),
        };
        panel(&mut svg, &hooks, placed, &id);
    }
    svg.push("</svg>");
    svg.body
}

fn panel(svg: &mut Svg, hooks: &Hooks, placed: &Placed, id: &str) {
    let (width, height) = (px(placed.width), px(placed.height));
    svg.push(&format!(
        "<g transform=\"translate({} {})\"{}>",
        px(placed.left),
        px(placed.top),
        hooks.panel(placed)
    ));
    hooks.group(svg, hooks::AXES, |svg| grid(svg, placed));
    svg.push(&format!(
        "<clipPath id=\"{id}\"><rect width=\"{width}\" height=\"{height}\"/></clipPath><g clip-path=\"url(#{id})\">"
    ));
    hooks.group(svg, hooks::LINES, |svg| marks::lines(svg, placed));
    for series in &placed.panel.series {
        hooks.group(svg, &hooks.series(series), |svg| {
            curves::series(svg, placed, series)
        });
    }
    svg.push("</g>");
    svg.furniture(FRAME, 0.8, &format!("M0 0H{width}V{height}H0Z"));
    hooks.group(svg, hooks::AXES, |svg| ticks(svg, placed));
    marks::texts(svg, hooks, placed);
    names(svg, hooks, placed);
    svg.push("</g>");
}

/// Lines at the ticks, fine ones first.
fn grid(svg: &mut Svg, placed: &Placed) {
    let (width, height) = (px(placed.width), px(placed.height));
    let vertical = |at: f64| format!("M{} 0V{height}", px(placed.width * placed.x.unit(at)));
    let horizontal = |at: f64| format!("M0 {}H{width}", px(placed.height * (1.0 - placed.y.unit(at))));
    let (x, y) = (&placed.x.ticks, &placed.y.ticks);
    let fine: String = x
        .minor
        .iter()
        .map(|&at| vertical(at))
        .chain(y.minor.iter().map(|&at| horizontal(at)))
        .collect();
    let main: String = x
        .major
        .iter()
        .map(|t| vertical(t.0))
        .chain(y.major.iter().map(|t| horizontal(t.0)))
        .collect();
    svg.furniture(FINE, 0.6, &fine);
    svg.furniture(GRID, 0.6, &main);
}

/// Tick marks inside the frame and the numbers outside.
fn ticks(svg: &mut Svg, placed: &Placed) {
    let (width, height) = (placed.width, placed.height);
    let mut data = String::new();
    for (places, length) in [
        (&placed.x.ticks.minor, 2.2),
        (&majors(&placed.x.ticks.major), 4.0),
    ] {
        for &at in places {
            data.push_str(&format!(
                "M{} {}v-{}",
                px(width * placed.x.unit(at)),
                px(height),
                px(length)
            ));
        }
    }
    for (places, length) in [
        (&placed.y.ticks.minor, 2.2),
        (&majors(&placed.y.ticks.major), 4.0),
    ] {
        for &at in places {
            data.push_str(&format!(
                "M0 {}h{}",
                px(height * (1.0 - placed.y.unit(at))),
                px(length)
            ));
        }
    }
    svg.furniture(FRAME, 0.7, &data);
    if placed.x_labels == Labels::Shown {
        for (at, label) in &placed.x.ticks.major {
            let x = width * placed.x.unit(*at);
            svg.text((x, height + 14.5), Anchor::Middle, TICK_SIZE, INK, label, "");
        }
    }
    if placed.y_labels == Labels::Shown {
        for (at, label) in &placed.y.ticks.major {
            let y = height * (1.0 - placed.y.unit(*at)) + 3.6;
            svg.text((-5.0, y), Anchor::End, TICK_SIZE, INK, label, "");
        }
    }
}

fn majors(major: &[(f64, String)]) -> Vec<f64> {
    major.iter().map(|(at, _)| *at).collect()
}

/// Title, legend, axis names, factors and the remark on what is not shown.
fn names(svg: &mut Svg, hooks: &Hooks, placed: &Placed) {
    let (panel, width, height) = (placed.panel, placed.width, placed.height);
    let factor_row = if placed.has_factor_row { 12.0 } else { 0.0 };
    let legend_top = -3.0 - factor_row - legend::ROW * placed.legend.len() as f64;
    legend(svg, hooks, &placed.legend, (0.0, legend_top));
    let (title, size) = text::fit(&panel.title, TITLE_SIZE, width + 12.0);
    svg.text(
        (0.5 * width, legend_top - 3.0),
        Anchor::Middle,
        size,
        INK,
        &title,
        "",
    );

    if let (Some(exponent), Labels::Shown) = (placed.y.ticks.factor, placed.y_labels) {
        hooks.group(svg, hooks::AXES, |svg| {
            let factor = factor_label(exponent);
            svg.text((0.0, -4.5), Anchor::Start, TICK_SIZE, INK, &factor, "");
        });
    }
    if placed.y_labels == Labels::Shown {
        let (name, size) = text::fit(&panel.y.label, NAME_SIZE, height + 20.0);
        let x = -placed.y_name;
        let turned = format!(" transform=\"rotate(-90 {} {})\"", px(x), px(0.5 * height));
        svg.text((x, 0.5 * height), Anchor::Middle, size, INK, &name, &turned);
    }
    if placed.x_labels == Labels::Shown {
        let factor = placed.x.ticks.factor.map(factor_label);
        let factor_width = factor.as_deref().map_or(0.0, |f| text::width(f, TICK_SIZE) + 8.0);
        let (name, size) = text::fit(&panel.x.label, NAME_SIZE, width + 20.0 - 2.0 * factor_width);
        svg.text((0.5 * width, height + 30.5), Anchor::Middle, size, INK, &name, "");
        let factor = factor.unwrap_or_default();
        hooks.group(svg, hooks::AXES, |svg| {
            svg.text((width, height + 30.5), Anchor::End, TICK_SIZE, INK, &factor, "")
        });
    }

    if placed.ranges.placed == 0 && !panel.series.is_empty() {
        svg.text(
            (0.5 * width, 0.5 * height),
            Anchor::Middle,
            NAME_SIZE,
            MUTED,
            "no point to show",
            "",
        );
    } else if placed.ranges.not_positive > 0 {
        let remark = format!("{} points ≤ 0 not shown", placed.ranges.not_positive);
        halo(svg, (width - 5.0, height - 7.0), Anchor::End, MUTED, &remark);
    }
}

/// Samples and names.
fn legend(svg: &mut Svg, hooks: &Hooks, rows: &Rows, at: (f64, f64)) {
    for (row, entries) in rows.iter().enumerate() {
        let y = at.1 + legend::ROW * (row as f64 + 0.5);
        for entry in entries {
            let at = (at.0 + entry.offset, y);
            hooks.group(svg, &hooks.entry(entry, at), |svg| sample(svg, entry, at));
        }
    }
}

fn sample(svg: &mut Svg, entry: &legend::Entry, (x, y): (f64, f64)) {
    let series = entry.series;
    let end = x + legend::sample(series);
    match series.style {
        Style::Band { .. } => {
            let box_of = [(x, y - 4.5), (end, y - 4.5), (end, y + 4.5), (x, y + 4.5)];
            svg.fill(series.colour, 0.22, &(path(&box_of) + "z"));
        }
        Style::Dots | Style::Circles | Style::Crosses => symbols(svg, series, &[(0.5 * (x + end), y)]),
        _ => svg.stroke(
            series.colour,
            series.drawn_width(),
            dashes(&series.style),
            &path(&[(x, y), (end, y)]),
        ),
    }
    let (at, label) = ((end + 5.0, y + 3.7), &entry.label);
    svg.text(at, Anchor::Start, entry.size, INK, label, "");
}

impl Figure {
    /// The drawing as a standalone SVG document on white ground.
    ///
    /// The same figure gives the same bytes. Lines are thinned to what the pixels can show.
    ///
    /// # Errors
    /// The figure has no panel, a panel has nothing to draw, or a size, range, tick step or band is
    /// inconsistent. Points without a place never fail.
    pub fn to_svg(&self) -> Result<String, ReportError> {
        Ok(document(&Layout::new(self)?, Mode::Standalone))
    }

    /// The drawing as a PNG of this width, from the same SVG, with an embedded font; in a build with the feature `png`.
    ///
    /// # Errors
    /// As [`Figure::to_svg`], and for a width outside 16 to 8192 px or a bitmap of more than 64 million pixels.
    #[cfg(feature = "png")]
    pub fn to_png(&self, width_px: u32) -> Result<Vec<u8>, ReportError> {
        crate::png::render(&self.title, &self.to_svg()?, width_px)
    }

    /// How many points were drawn, and why the others were not.
    ///
    /// # Errors
    /// As [`Figure::to_svg`].
    pub fn account(&self) -> Result<Account, ReportError> {
        let layout = Layout::new(self)?;
        let svg_bytes = document(&layout, Mode::Standalone).len();
        Ok(Account {
            svg_bytes,
            ..layout.account
        })
    }

    /// The drawing for a page, and one for a phone where the panels are not too many; `number` makes their ids unique there.
    pub(crate) fn to_inline_svg(&self, number: usize) -> Result<(String, Option<String>), ReportError> {
        let broad = document(&Layout::new(self)?, Mode::Inline { id: "f", number });
        let phone = self.for_phone();
        let narrow = Layout::new(&phone).map(|layout| document(&layout, Mode::Inline { id: "n", number }));
        Ok((broad, narrow.ok()))
    }
}
