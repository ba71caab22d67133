//! Lines and words across a panel.

use crate::hooks::Hooks;
use crate::layout::{Placed, TICK_SIZE};
use crate::series::Place;
use crate::svg::{Anchor, INK, MUTED, PAPER, Svg, Tone, px};
use crate::text;

/// The lines, under the data.
pub(crate) fn lines(svg: &mut Svg, placed: &Placed) {
    for marker in &placed.panel.markers {
        let data = match marker.place {
            Place::Vertical(x) => placed
                .x
                .place(x)
                .map(|u| format!("M{} 0V{}", px(placed.width * u), px(placed.height))),
            Place::Horizontal(y) => placed
                .y
                .place(y)
                .map(|u| format!("M0 {}H{}", px(placed.height * (1.0 - u)), px(placed.width))),
            Place::Point(..) => continue,
        };
        if let Ok(data) = data {
            svg.stroke(marker.colour, 1.0, " stroke-dasharray=\"4.5 2.5\"", &data);
        }
    }
}

/// The words, over the data; neighbours stand one below the other.
pub(crate) fn texts(svg: &mut Svg, hooks: &Hooks, placed: &Placed) {
    let within = |u: f64| (0.0..=1.0).contains(&u);
    let (width, height) = (placed.width, placed.height);
    let mut taken: Vec<(f64, f64, f64)> = Vec::new();
    for marker in &placed.panel.markers {
        let Some(label) = marker.label.as_deref() else {
            continue;
        };
        let length = text::width(label, TICK_SIZE);
        let (x, mut y, anchor) = match marker.place {
            Place::Vertical(x) => match placed.x.place(x) {
                Ok(u) if within(u) && width * u + length + 5.0 > width => {
                    (width * u - 4.0, 12.0, Anchor::End)
                }
                Ok(u) if within(u) => (width * u + 4.0, 12.0, Anchor::Start),
                _ => continue,
            },
            Place::Horizontal(y) => match placed.y.place(y) {
                Ok(u) if within(u) => {
                    let line = height * (1.0 - u);
                    (
                        width - 5.0,
                        if line < 16.0 { line + 12.0 } else { line - 4.0 },
                        Anchor::End,
                    )
                }
                _ => continue,
            },
            Place::Point(x, y) => match (placed.x.place(x), placed.y.place(y)) {
                (Ok(u), Ok(v)) if within(u) && within(v) => {
                    let right = width * u + 6.0 + length <= width;
                    let x = if right { width * u + 6.0 } else { width * u - 6.0 };
                    (
                        x,
                        height * (1.0 - v) + 3.5,
                        if right { Anchor::Start } else { Anchor::End },
                    )
                }
                _ => continue,
            },
        };
        let left = if anchor == Anchor::End { x - length } else { x };
        // Names of neighbouring vertical lines stand one below the other.
        while matches!(marker.place, Place::Vertical(_))
            && y + 12.0 < height
            && taken
                .iter()
                .any(|&(l, r, t)| left < r && left + length > l && (t - y).abs() < 11.0)
        {
            y += 12.0;
        }
        taken.push((left - 3.0, left + length + 3.0, y));
        let tone = if matches!(marker.place, Place::Point(..)) {
            INK
        } else {
            MUTED
        };
        hooks.group(svg, &hooks.note(placed, marker.place), |svg| {
            halo(svg, (x, y), anchor, tone, label)
        });
    }
}

/// Text over data: with a rim in the colour of the paper.
pub(crate) fn halo(svg: &mut Svg, at: (f64, f64), anchor: Anchor, tone: Tone, content: &str) {
    let Tone(_, paper, _) = PAPER;
    let rim =
        format!(" stroke=\"{paper}\" stroke-width=\"3\" stroke-linejoin=\"round\" paint-order=\"stroke\"");
    svg.text(at, anchor, TICK_SIZE, tone, content, &rim);
}
