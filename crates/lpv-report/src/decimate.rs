//! No more points than the pixels can show.
//!
//! Input and output are pixel positions. A line keeps the lowest and highest point of every pixel column, so a
//! resonance peak one sample wide stays as high as it is; a cloud keeps one point a cell.

/// Width of the columns and cells, px.
const COLUMN_PX: f64 = 0.8;
/// Largest distance between the line and its drawing, px, until [`MOST_VERTICES`] is exceeded.
const TOLERANCE_PX: f64 = 0.08;
/// Vertices of one line above which the tolerance is doubled. Only a line that runs to and fro and inks its panel
/// gets there; its outermost points are the last to go.
const MOST_VERTICES: usize = 5000;
/// Symbols of one cloud above which the cells are doubled.
const MOST_SYMBOLS: usize = 3000;

/// Splits a line where points are missing and thins what remains. `width` is that of the panel, from 0 on.
pub(crate) fn polylines(points: &[Option<(f64, f64)>], width: f64) -> Vec<Vec<(f64, f64)>> {
    let mut out = Vec::new();
    for run in points.split(Option::is_none) {
        let run: Vec<(f64, f64)> = run.iter().copied().flatten().collect();
        for piece in inside(&run, width) {
            let columns = columns(piece);
            let mut tolerance = TOLERANCE_PX;
            let mut thin = simplify(&columns, tolerance);
            while thin.len() > MOST_VERTICES && tolerance < width {
                tolerance *= 2.0;
                thin = simplify(&columns, tolerance);
            }
            out.push(thin);
        }
    }
    out
}

/// The pieces of a line that are not wholly left or right of the panel, with the neighbours that lead there.
fn inside(run: &[(f64, f64)], width: f64) -> Vec<&[(f64, f64)]> {
    let side = |x: f64| if x < 0.0 { -1 } else { i32::from(x > width) };
    let hidden = |a: (f64, f64), b: (f64, f64)| side(a.0) != 0 && side(a.0) == side(b.0);
    let mut out = Vec::new();
    let mut start = 0;
    for index in 1..run.len() {
        if hidden(run[index - 1], run[index]) {
            if index - start > 1 {
                out.push(&run[start..index]);
            }
            start = index;
        }
    }
    if run.len() - start > 1 || (run.len() == 1 && side(run[0].0) == 0) {
        out.push(&run[start..]);
    }
    out
}

/// Keeps, of consecutive points in one pixel column, the lowest and the highest in their order, and both ends
/// of the line.
pub(crate) fn columns(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let column = |p: &(f64, f64)| (p.0 / COLUMN_PX).floor();
    let mut out: Vec<(f64, f64)> = Vec::new();
    for group in points.chunk_by(|a, b| column(a) == column(b)) {
        if group.len() <= 2 {
            out.extend_from_slice(group);
            continue;
        }
        let mut low = 0;
        let mut high = 0;
        for (index, point) in group.iter().enumerate() {
            if point.1 < group[low].1 {
                low = index;
            }
            if point.1 > group[high].1 {
                high = index;
            }
        }
        out.push(group[low.min(high)]);
        if low != high {
            out.push(group[low.max(high)]);
        }
    }
    if let (Some(&first), Some(&last)) = (points.first(), points.last()) {
        if out.first() != Some(&first) {
            out.insert(0, first);
        }
        if out.last() != Some(&last) {
            out.push(last);
        }
    }
    out
}

/// Douglas and Peucker's simplification (1973): the farthest point from a chord is kept as long as it is farther
/// than the tolerance.
fn simplify(points: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    if points.len() < 3 {
        return points.to_vec();
    }
    let mut keep = vec![false; points.len()];
    keep[0] = true;
    keep[points.len() - 1] = true;
    let mut stack = vec![(0, points.len() - 1)];
    while let Some((from, to)) = stack.pop() {
        let mut farthest = (from, tolerance);
        for index in from + 1..to {
            let distance = distance(points[index], points[from], points[to]);
            if distance > farthest.1 {
                farthest = (index, distance);
            }
        }
        if farthest.0 != from {
            keep[farthest.0] = true;
            stack.push((from, farthest.0));
            stack.push((farthest.0, to));
        }
    }
    points
        .iter()
        .zip(keep)
        .filter(|(_, keep)| *keep)
        .map(|(p, _)| *p)
        .collect()
}

/// Distance of a point from the segment between two others.
fn distance(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length2 = dx * dx + dy * dy;
    let t = if length2 > 0.0 {
        ((p.0 - a.0) * dx + (p.1 - a.1) * dy) / length2
    } else {
        0.0
    };
    let t = t.clamp(0.0, 1.0);
    (p.0 - a.0 - t * dx).hypot(p.1 - a.1 - t * dy)
}

/// One point a cell, and always the outermost four; points outside the panel are left out.
pub(crate) fn cloud(points: &[Option<(f64, f64)>], width: f64, height: f64) -> Vec<(f64, f64)> {
    let visible: Vec<(f64, f64)> = points
        .iter()
        .flatten()
        .copied()
        .filter(|p| p.0 >= -0.5 && p.0 <= width + 0.5 && p.1 >= -0.5 && p.1 <= height + 0.5)
        .collect();
    let mut outermost = [0; 4];
    for (index, p) in visible.iter().enumerate() {
        for (slot, beats) in [
            p.0 < visible[outermost[0]].0,
            p.0 > visible[outermost[1]].0,
            p.1 < visible[outermost[2]].1,
            p.1 > visible[outermost[3]].1,
        ]
        .into_iter()
        .enumerate()
        {
            if beats {
                outermost[slot] = index;
            }
        }
    }
    let mut cell = 0.5;
    loop {
        let mut taken = std::collections::BTreeSet::new();
        let kept: Vec<(f64, f64)> = visible
            .iter()
            .enumerate()
            .filter(|(index, p)| {
                let fresh = taken.insert(((p.0 / cell).floor() as i64, (p.1 / cell).floor() as i64));
                fresh || outermost.contains(index)
            })
            .map(|(_, p)| *p)
            .collect();
        if kept.len() <= MOST_SYMBOLS || cell > 8.0 {
            return kept;
        }
        cell *= 2.0;
    }
}

/// One edge of a band, thinned: a point a column, the highest or lowest as `outer` chooses.
pub(crate) fn edge(points: &[(f64, f64)], outer: fn(f64, f64) -> f64) -> Vec<(f64, f64)> {
    let column = |p: &(f64, f64)| (p.0 / COLUMN_PX).floor();
    let thin: Vec<(f64, f64)> = points
        .chunk_by(|a, b| column(a) == column(b))
        .map(|group| (group[0].0, group.iter().map(|p| p.1).fold(group[0].1, outer)))
        .collect();
    simplify(&thin, TOLERANCE_PX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn range(points: impl Iterator<Item = f64>) -> (f64, f64) {
        points.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        })
    }

    #[test]
    fn a_peak_one_sample_wide_survives() {
        let points: Vec<_> = (0..16_000)
            .map(|k| Some((f64::from(k) * 0.02, if k == 7777 { 5.0 } else { 150.0 })))
            .collect();
        let lines = polylines(&points, 320.0);
        assert_eq!(lines.len(), 1);
        assert!(lines[0].contains(&(7777.0 * 0.02, 5.0)));
        assert!(lines[0].len() < 10, "{}", lines[0].len());
    }

    #[test]
    fn a_gap_breaks_the_line() {
        let points = [
            Some((0.0, 0.0)),
            Some((1.0, 5.0)),
            None,
            Some((2.0, 1.0)),
            Some((9.0, 1.0)),
            None,
            None,
        ];
        assert_eq!(
            polylines(&points, 10.0),
            [vec![(0.0, 0.0), (1.0, 5.0)], vec![(2.0, 1.0), (9.0, 1.0)]]
        );
    }

    #[test]
    fn what_lies_beside_the_panel_is_left_out_but_its_neighbours_stay() {
        let points: Vec<_> = (-100..200).map(|k| (f64::from(k), f64::from(k % 7))).collect();
        let pieces = inside(&points, 50.0);
        assert_eq!(pieces.len(), 1);
        assert_eq!((pieces[0][0].0, pieces[0][pieces[0].len() - 1].0), (-1.0, 51.0));
        let beside: Vec<_> = points.iter().map(|p| (p.0 + 1000.0, p.1)).collect();
        assert!(inside(&beside, 50.0).is_empty());
    }

    proptest! {
        #[test]
        fn columns_keep_the_extremes(y in prop::collection::vec(-100.0..100.0f64, 1..2000), step in 0.001..3.0f64) {
            let points: Vec<_> = y.iter().enumerate().map(|(k, &y)| (k as f64 * step, y)).collect();
            let thin = columns(&points);
            prop_assert_eq!(range(thin.iter().map(|p| p.1)), range(points.iter().map(|p| p.1)));
            prop_assert!(thin.len() as f64 <= 2.0 * (step * y.len() as f64 / COLUMN_PX + 2.0) + 2.0);
        }

        #[test]
        fn a_simplified_line_stays_within_its_tolerance(y in prop::collection::vec(-9.0..9.0f64, 3..60)) {
            let points: Vec<_> = y.iter().enumerate().map(|(k, &y)| (k as f64, y)).collect();
            let thin = simplify(&points, 0.5);
            for &p in &points {
                let nearest = thin.windows(2).map(|w| distance(p, w[0], w[1])).fold(f64::INFINITY, f64::min);
                prop_assert!(nearest <= 0.5 + 1e-12, "{nearest}");
            }
        }

        #[test]
        fn a_cloud_keeps_its_outline(points in prop::collection::vec((0.0..300.0f64, 0.0..200.0f64), 1..9000)) {
            let given: Vec<_> = points.iter().copied().map(Some).collect();
            let kept = cloud(&given, 300.0, 200.0);
            prop_assert!(kept.len() <= MOST_SYMBOLS + 4);
            prop_assert_eq!(range(kept.iter().map(|p| p.0)), range(points.iter().map(|p| p.0)));
            prop_assert_eq!(range(kept.iter().map(|p| p.1)), range(points.iter().map(|p| p.1)));
        }
    }
}
