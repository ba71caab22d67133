//! Text: escaping, sub- and superscripts, estimated widths.

/// Height of a run against the line it stands on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Level {
    Base,
    Sub,
    Super,
}

/// Size of a sub- or superscript against the text around it.
const SCRIPT: f64 = 0.74;

/// Escapes text for an XML or HTML element or attribute; characters that XML forbids, and those that turn the direction of
/// writing, become U+FFFD.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' => out.push(c),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            // They would turn the order of what follows, up to the end of its paragraph.
            '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => out.push('\u{fffd}'),
            c if c.is_control() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// Splits `W_{17}^{2}` into runs; an opening without its closing brace stays as it is.
fn runs(text: &str) -> Vec<(Level, &str)> {
    let mut out = Vec::new();
    let mut rest = text;
    let mut base = text;
    let mut base_length = 0;
    while let Some(found) = rest.find(['_', '^']) {
        let level = if rest[found..].starts_with('_') {
            Level::Sub
        } else {
            Level::Super
        };
        let after = &rest[found + 1..];
        let end = if after.starts_with('{') {
            after.find('}')
        } else {
            None
        };
        let Some(end) = end else {
            base_length += found + 1;
            rest = after;
            continue;
        };
        base_length += found;
        if base_length > 0 {
            out.push((Level::Base, &base[..base_length]));
        }
        out.push((level, &after[1..end]));
        rest = &after[end + 1..];
        base = rest;
        base_length = 0;
    }
    if !base.is_empty() {
        out.push((Level::Base, base));
    }
    out
}

/// Escapes a run; a hyphen that leads a script is a minus sign, as in `10^{-3}`.
fn escape_run(level: Level, run: &str) -> String {
    match run.strip_prefix('-') {
        Some(rest) if level != Level::Base => format!("−{}", escape(rest)),
        _ => escape(run),
    }
}

/// The text for HTML, escaped, with `<sub>` and `<sup>`.
pub(crate) fn to_html(text: &str) -> String {
    let mut out = String::new();
    for (level, run) in runs(text) {
        let run = escape_run(level, run);
        match level {
            Level::Base => out.push_str(&run),
            Level::Sub => out.push_str(&format!("<sub>{run}</sub>")),
            Level::Super => out.push_str(&format!("<sup>{run}</sup>")),
        }
    }
    out
}

/// The text for an attribute, escaped, without sub- and superscripts.
pub(crate) fn plain(text: &str) -> String {
    runs(text)
        .into_iter()
        .map(|(level, run)| escape_run(level, run))
        .collect()
}

/// The content of an SVG `<text>` of this size, escaped, with shifted `<tspan>`s.
pub(crate) fn to_tspans(text: &str, size: f64) -> String {
    let mut out = String::new();
    let mut height = 0.0;
    for (level, run) in runs(text) {
        let (target, run_size) = match level {
            Level::Base => (0.0, size),
            Level::Sub => (0.22 * size, SCRIPT * size),
            Level::Super => (-0.38 * size, SCRIPT * size),
        };
        let run = escape_run(level, run);
        if target == height && level == Level::Base {
            out.push_str(&run);
        } else {
            let (shift, run_size) = (px2(target - height), px2(run_size));
            out.push_str(&format!(
                "<tspan dy=\"{shift}\" font-size=\"{run_size}\">{run}</tspan>"
            ));
        }
        height = target;
    }
    out
}

/// Fonts that viewers put in Helvetica's place are up to a seventh wider; half of that is kept free.
const RESERVE: f64 = 1.07;

/// Advance widths of the ASCII characters from the space on, in thousandths of the size (Helvetica's metrics).
const ASCII: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 222, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556,
    556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778, 722, 278,
    500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469,
    556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500,
    278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];

fn advance(c: char) -> f64 {
    let index = (c as usize).wrapping_sub(32);
    match ASCII.get(index) {
        Some(&width) => f64::from(width),
        None if c as u32 >= 0x2e80 => 1000.0,
        None => 600.0,
    }
}

/// Estimated width of a text in the units of `size`.
pub(crate) fn width(text: &str, size: f64) -> f64 {
    let thousandths: f64 = runs(text)
        .into_iter()
        .map(|(level, run)| {
            let factor = if level == Level::Base { 1.0 } else { SCRIPT };
            factor * run.chars().map(advance).sum::<f64>()
        })
        .sum();
    RESERVE * thousandths * size / 1000.0
}

/// Shrinks a text to `room` by its size, down to 70 %, then by cutting its end; gives text and size.
pub(crate) fn fit(text: &str, size: f64, room: f64) -> (String, f64) {
    let full = width(text, size);
    if full <= room {
        return (text.to_owned(), size);
    }
    let small = size * (room / full).max(0.7);
    if width(text, small) <= room * 1.001 {
        return (text.to_owned(), small);
    }
    let mut kept = String::new();
    let per_unit = RESERVE * small / 1000.0;
    let mut used = advance('…') * per_unit;
    // A cut inside a script would leave its brace open, so a text that must be cut loses its scripts.
    for c in runs(text).into_iter().flat_map(|(_, run)| run.chars()) {
        used += advance(c) * per_unit;
        if used > room {
            break;
        }
        kept.push(c);
    }
    kept.push('…');
    (kept, small)
}

/// A length with at most two decimals.
pub(crate) fn px2(value: f64) -> String {
    let rounded = format!("{value:.2}");
    let trimmed = rounded.trim_end_matches('0').trim_end_matches('.');
    if trimmed == "-0" {
        "0".to_owned()
    } else {
        trimmed.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn scripts_become_elements() {
        assert_eq!(to_html("W_{17}(p)^{2}"), "W<sub>17</sub>(p)<sup>2</sup>");
        assert_eq!(to_html("rms_error ^ {a}"), "rms_error ^ {a}");
        assert_eq!(to_html("open_{x"), "open_{x");
        assert_eq!(to_html("-10^{-3}"), "-10<sup>−3</sup>");
        assert_eq!(
            to_html("a<b & \"c\"_{<}"),
            "a&lt;b &amp; &quot;c&quot;<sub>&lt;</sub>"
        );
        assert_eq!(
            to_tspans("10^{2}x", 10.0),
            "10<tspan dy=\"-3.8\" font-size=\"7.4\">2</tspan><tspan dy=\"3.8\" font-size=\"10\">x</tspan>"
        );
    }

    #[test]
    fn widths_by_hand() {
        assert!((width("10", 10.0) - RESERVE * 11.12).abs() < 1e-12);
        assert!((width("1^{0}", 10.0) - RESERVE * (5.56 + 0.74 * 5.56)).abs() < 1e-12);
        assert_eq!(width("", 10.0), 0.0);
    }

    #[test]
    fn a_text_is_shrunk_before_it_is_cut() {
        let text = "mmmmmmmmmm";
        let full = width(text, 10.0);
        assert_eq!(fit(text, 10.0, full), (text.to_owned(), 10.0));
        assert_eq!(fit(text, 10.0, 0.8 * full).0, text);
        let (cut, size) = fit(text, 10.0, 0.3 * full);
        assert!(cut.ends_with('…') && width(&cut, size) <= 0.3 * full);
    }

    proptest! {
        #[test]
        fn no_text_escapes_its_element(text in any::<String>(), size in 1.0..20.0f64, room in 0.0..100.0f64) {
            for markup in [to_html(&text), to_tspans(&text, size), to_tspans(&fit(&text, size, room).0, size)] {
                let document = format!("<a>{markup}</a>");
                prop_assert!(resvg::usvg::roxmltree::Document::parse(&document).is_ok(), "{document:?}");
            }
        }

        #[test]
        fn nothing_but_braces_is_lost(text in "[a-z_^{}]{0,12}") {
            let kept: usize = runs(&text).iter().map(|(_, run)| run.len()).sum();
            let scripts = runs(&text).iter().filter(|(level, _)| *level != Level::Base).count();
            prop_assert_eq!(kept + 3 * scripts, text.len());
        }
    }
}
