//! The SVG as a bitmap, with a font that travels with the program.

use std::sync::Arc;

use resvg::{tiny_skia, usvg};

use crate::ReportError;

/// Largest number of pixels of a bitmap.
const MOST_PIXELS: u64 = 64_000_000;

/// Renders an SVG to a PNG of this width.
pub(crate) fn render(figure: &str, svg: &str, width_px: u32) -> Result<Vec<u8>, ReportError> {
    let name = || figure.to_owned();
    if !(16..=8192).contains(&width_px) {
        let (value, what) = (f64::from(width_px), "the width of the PNG in pixels");
        return Err(ReportError::Size {
            figure: name(),
            what,
            value,
            lower: 16.0,
            upper: 8192.0,
        });
    }
    let tree = usvg::Tree::from_str(svg, &options()).map_err(|source| ReportError::Svg {
        figure: name(),
        source,
    })?;
    let scale = width_px as f32 / tree.size().width();
    let height_px = (scale * tree.size().height()).ceil().max(1.0) as u32;
    let no_bitmap = || ReportError::Bitmap {
        figure: name(),
        width_px,
        height_px,
    };
    if u64::from(width_px) * u64::from(height_px) > MOST_PIXELS {
        return Err(no_bitmap());
    }
    let mut pixels = tiny_skia::Pixmap::new(width_px, height_px).ok_or_else(no_bitmap)?;
    pixels.fill(tiny_skia::Color::WHITE);
    resvg::render(
        &tree,
        tiny_skia::Transform::from_scale(scale, scale),
        &mut pixels.as_mut(),
    );
    pixels.encode_png().map_err(|source| ReportError::Encode {
        figure: name(),
        source: Box::new(source),
    })
}

/// Only the embedded fonts: what a machine has installed must not change a picture.
fn options() -> usvg::Options<'static> {
    let mut options = usvg::Options::default();
    let fonts = options.fontdb_mut();
    for font in [
        epaint_default_fonts::UBUNTU_LIGHT,
        epaint_default_fonts::HACK_REGULAR,
    ] {
        fonts.load_font_source(usvg::fontdb::Source::Binary(Arc::new(font)));
    }
    let family = fonts
        .faces()
        .next()
        .and_then(|face| face.families.first())
        .map(|(name, _)| name.clone());
    if let Some(family) = family {
        fonts.set_sans_serif_family(family);
    }
    options
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What labels of this field use beyond ASCII.
    const NEEDED: &str = "αβγδεζηθκλμνξπρστφχψωΓΔΘΛΣΦΨΩ°²³±×·−–—…‖∞≤≥≈≠√∂∑∈→‰µéöü";

    fn glyphs(text: &str) -> Vec<(String, u32)> {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9\" height=\"9\"><text font-family=\"sans-serif\">{text}</text></svg>"
        );
        let tree = usvg::Tree::from_str(&svg, &options()).unwrap();
        let mut out = Vec::new();
        for node in tree.root().children() {
            if let usvg::Node::Text(text) = node {
                for glyph in text.layouted().iter().flat_map(|span| &span.positioned_glyphs) {
                    out.push((glyph.text.clone(), glyph.id.0));
                }
            }
        }
        out
    }

    #[test]
    fn the_embedded_fonts_hold_the_characters_of_the_field() {
        for c in NEEDED.chars() {
            let drawn = glyphs(&c.to_string());
            assert_eq!(drawn.len(), 1, "{c}");
            assert_ne!(drawn[0].1, 0, "no glyph for {c}");
        }
        // The check can fail: no embedded font has this one.
        assert!(glyphs("漢").iter().all(|(_, id)| *id == 0));
    }

    #[test]
    fn a_width_that_makes_no_picture_is_refused() {
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1\" height=\"90000\"/>";
        assert!(matches!(render("f", svg, 0), Err(ReportError::Size { .. })));
        assert!(matches!(render("f", svg, 100_000), Err(ReportError::Size { .. })));
        assert!(matches!(render("f", svg, 8000), Err(ReportError::Bitmap { .. })));
        assert!(matches!(render("f", "<svg", 100), Err(ReportError::Svg { .. })));
    }
}
