//! The few SVG primitives that a figure is made of.
//!
//! Every element carries its colour as an attribute, so that the file stands alone, and a class, so that the
//! style sheet of a page can give it the dark value.

use crate::Colour;
use crate::text::{self, px2};

/// Fonts asked for; the PNG renderer answers with its embedded sans-serif font.
pub(crate) const FONTS: &str = "Helvetica Neue, Helvetica, Arial, sans-serif";

/// A colour of the figure's furniture: class, value on white, value on dark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Tone(
    pub(crate) &'static str,
    pub(crate) &'static str,
    pub(crate) &'static str,
);

/// The ground.
pub(crate) const PAPER: Tone = Tone("pp", "#ffffff", "#17191d");
/// Titles and numbers.
pub(crate) const INK: Tone = Tone("tx", "#1f1f1f", "#e6e6e6");
/// Remarks inside a panel.
pub(crate) const MUTED: Tone = Tone("mu", "#5f5f5f", "#a8a8a8");
/// Frame and ticks.
pub(crate) const FRAME: Tone = Tone("fr", "#4a4a4a", "#8a8d92");
/// Lines at labelled ticks.
pub(crate) const GRID: Tone = Tone("gr", "#d9d9d9", "#393d44");
/// Lines at ticks without label.
pub(crate) const FINE: Tone = Tone("gf", "#eeeeee", "#272a2f");

/// All furniture, for the style sheet of a page.
pub(crate) const TONES: [Tone; 6] = [PAPER, INK, MUTED, FRAME, GRID, FINE];

/// A length with at most one decimal.
pub(crate) fn px(value: f64) -> String {
    tenths((value * 10.0).round() as i64)
}

fn tenths(value: i64) -> String {
    let (whole, rest) = (value.unsigned_abs() / 10, value.unsigned_abs() % 10);
    let sign = if value < 0 { "-" } else { "" };
    match (whole, rest) {
        (_, 0) => format!("{sign}{whole}"),
        (0, _) => format!("{sign}.{rest}"),
        _ => format!("{sign}{whole}.{rest}"),
    }
}

/// Appends ` x y` in path syntax: a minus sign separates by itself.
fn pair(out: &mut String, x: i64, y: i64) {
    out.push_str(&tenths(x));
    let y = tenths(y);
    if !y.starts_with('-') {
        out.push(' ');
    }
    out.push_str(&y);
}

/// Path data through points, closed or open. Differences are taken between rounded points, so that rounding
/// does not add up along a long line.
pub(crate) fn path(points: &[(f64, f64)]) -> String {
    let mut out = String::with_capacity(8 * points.len());
    let mut last = (0_i64, 0_i64);
    for (index, &(x, y)) in points.iter().enumerate() {
        let here = ((x * 10.0).round() as i64, (y * 10.0).round() as i64);
        if index == 0 {
            out.push('M');
            pair(&mut out, here.0, here.1);
        } else if here != last || points.len() == 2 {
            out.push('l');
            pair(&mut out, here.0 - last.0, here.1 - last.1);
        }
        last = here;
    }
    out
}

/// Drawing text: where the point given lies in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A drawing under construction.
#[derive(Debug, Default)]
pub(crate) struct Svg {
    pub(crate) body: String,
}

impl Svg {
    pub(crate) fn push(&mut self, markup: &str) {
        self.body.push_str(markup);
    }

    /// A stroked path of the furniture.
    pub(crate) fn furniture(&mut self, tone: Tone, width: f64, data: &str) {
        if !data.is_empty() {
            let (Tone(class, colour, _), width) = (tone, px2(width));
            self.push(&format!(
                "<path class=\"{class}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" d=\"{data}\"/>"
            ));
        }
    }

    /// A stroked path of a series.
    pub(crate) fn stroke(&mut self, colour: Colour, width: f64, more: &str, data: &str) {
        if !data.is_empty() {
            let (slot, value, width) = (colour.slot(), colour.light(), px2(width));
            self.push(&format!(
                "<path class=\"s{slot}\" fill=\"none\" stroke=\"{value}\" stroke-width=\"{width}\" \
                 stroke-linejoin=\"round\"{more} d=\"{data}\"/>"
            ));
        }
    }

    /// A filled area of a series.
    pub(crate) fn fill(&mut self, colour: Colour, opacity: f64, data: &str) {
        if !data.is_empty() {
            let (slot, value, opacity) = (colour.slot(), colour.light(), px2(opacity));
            self.push(&format!(
                "<path class=\"f{slot}\" fill=\"{value}\" fill-opacity=\"{opacity}\" d=\"{data}\"/>"
            ));
        }
    }

    /// A filled rectangle of the furniture.
    pub(crate) fn rect(&mut self, tone: Tone, x: f64, y: f64, width: f64, height: f64) {
        let Tone(class, colour, _) = tone;
        let (x, y, width, height) = (px(x), px(y), px(width), px(height));
        self.push(&format!(
            "<rect class=\"{class}\" fill=\"{colour}\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>"
        ));
    }

    /// A line of text; `more` are further attributes.
    pub(crate) fn text(
        &mut self,
        at: (f64, f64),
        anchor: Anchor,
        size: f64,
        tone: Tone,
        content: &str,
        more: &str,
    ) {
        if content.is_empty() {
            return;
        }
        let Tone(class, colour, _) = tone;
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let (x, y, size_px, content) = (px(at.0), px(at.1), px2(size), text::to_tspans(content, size));
        self.push(&format!(
            "<text class=\"{class}\" fill=\"{colour}\" x=\"{x}\" y=\"{y}\" font-size=\"{size_px}\"{anchor}{more}>\
             {content}</text>"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_short() {
        assert_eq!(px(12.34), "12.3");
        assert_eq!(px(-0.04), "0");
        assert_eq!(px(-0.26), "-.3");
        assert_eq!(px(3.0), "3");
        assert_eq!(px2(-0.001), "0");
        assert_eq!(px2(1.5), "1.5");
        assert_eq!(px(f64::NAN), "0");
    }

    #[test]
    fn a_path_ends_where_its_last_point_is() {
        assert_eq!(
            path(&[(1.0, 2.0), (3.5, 1.0), (3.5, 1.0), (4.0, 2.0)]),
            "M1 2l2.5-1l.5 1"
        );
        // A thousand steps of 0.14 px round to 0.1 each; the sum must still arrive at 140.
        let points: Vec<_> = (0..=1000).map(|k| (0.14 * f64::from(k), 0.0)).collect();
        let sum: f64 = path(&points)
            .split(['M', 'l'])
            .filter(|part| !part.is_empty())
            .map(|part| part.split_whitespace().next().unwrap().parse::<f64>().unwrap())
            .sum();
        assert!((sum - 140.0).abs() < 1e-9, "{sum}");
    }
}
