//! Who is named where, and in how many rows.

use crate::figure::{Figure, Legend};
use crate::series::{Series, Style};
use crate::text;

/// Size of the names, px.
pub(crate) const SIZE: f64 = 10.5;
/// Height of a row, px.
pub(crate) const ROW: f64 = 16.0;
const BETWEEN: f64 = 16.0;

/// A name with its sample, at a distance from the left end of its row.
#[derive(Debug, Clone)]
pub(crate) struct Entry<'f> {
    pub(crate) series: &'f Series,
    pub(crate) label: String,
    pub(crate) size: f64,
    pub(crate) offset: f64,
}

/// Length of the sample left of a name, px.
pub(crate) fn sample(series: &Series) -> f64 {
    match series.style {
        Style::Dots | Style::Circles | Style::Crosses => series.drawn_width().max(8.0),
        _ => 24.0,
    }
}

/// The rows of a legend.
pub(crate) type Rows<'f> = Vec<Vec<Entry<'f>>>;

/// Named series of the whole figure and of each panel; one of the two is empty.
pub(crate) fn assign(figure: &Figure) -> (Vec<&Series>, Vec<Vec<&Series>>) {
    let panels: Vec<Vec<&Series>> = figure.panels.iter().map(|p| distinct(p.series.iter())).collect();
    let all = distinct(figure.panels.iter().flat_map(|p| p.series.iter()));
    let nobody = vec![Vec::new(); panels.len()];
    let together = match figure.legend {
        Legend::Hidden => return (Vec::new(), nobody),
        Legend::Figure => true,
        Legend::Panel => panels.len() == 1,
        Legend::Auto => panels.iter().any(|p| p.len() == all.len()),
    };
    if together {
        (all, nobody)
    } else {
        (Vec::new(), panels)
    }
}

/// The named series, one a label, style and colour.
pub(crate) fn distinct<'f>(series: impl Iterator<Item = &'f Series>) -> Vec<&'f Series> {
    let mut out: Vec<&Series> = Vec::new();
    let same = |a: &Series, b: &Series| {
        let styles = std::mem::discriminant(&a.style) == std::mem::discriminant(&b.style);
        a.label == b.label && styles && a.colour.slot() == b.colour.slot()
    };
    for s in series {
        let named = s.label.as_deref().is_some_and(|label| !label.is_empty());
        if named && !out.iter().any(|o| same(o, s)) {
            out.push(s);
        }
    }
    out
}

/// Breaks the names into rows of at most `room` px.
pub(crate) fn rows<'f>(series: &[&'f Series], room: f64) -> Rows<'f> {
    let mut out: Rows = Vec::new();
    let mut used = f64::INFINITY;
    for &s in series {
        let (label, size) = text::fit(
            s.label.as_deref().unwrap_or_default(),
            SIZE,
            (room - sample(s) - 5.0).max(20.0),
        );
        let length = sample(s) + 5.0 + text::width(&label, size);
        if used + BETWEEN + length > room {
            out.push(Vec::new());
            used = -BETWEEN;
        }
        let offset = used + BETWEEN;
        used = offset + length;
        if let Some(row) = out.last_mut() {
            row.push(Entry {
                series: s,
                label,
                size,
                offset,
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axis, Colour, Panel};

    fn panel(names: &[&str]) -> Panel {
        names
            .iter()
            .fold(Panel::new(Axis::linear(""), Axis::linear("")), |panel, name| {
                panel.series(Series::line(vec![(0.0, 0.0)]).label(*name))
            })
    }

    #[test]
    fn one_legend_if_a_panel_shows_all_names_else_one_a_panel() {
        let same = Figure::new("").panel(panel(&["a", "b"])).panel(panel(&["b"]));
        assert_eq!((assign(&same).0.len(), assign(&same).1[0].len()), (2, 0));
        let different = Figure::new("").panel(panel(&["a"])).panel(panel(&["b"]));
        assert_eq!(
            (assign(&different).0.len(), assign(&different).1[1].len()),
            (0, 1)
        );
    }

    #[test]
    fn a_name_in_two_styles_has_two_entries() {
        let line = Series::line(vec![]).label("a");
        let dots = Series::new(vec![], Style::Dots).label("a");
        let red = line.clone().colour(Colour::Error);
        assert_eq!(distinct([&line, &line.clone(), &dots, &red].into_iter()).len(), 3);
    }

    #[test]
    fn rows_break_at_the_room() {
        let series = Series::line(vec![]).label("a name");
        assert_eq!(rows(&[&series; 6], 1e4).len(), 1);
        let narrow = rows(&[&series; 6], 150.0);
        assert_eq!(narrow.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2, 2]);
        assert_eq!(rows(&[&series; 3], 10.0).len(), 3);
    }
}
