//! The machine let run free over a record, before and after.

use super::figures::{BEFORE_AFTER, Channel};
use lpv_diagnose::{Base, Explained, Track};
use lpv_numerics::statistics::range;
use lpv_report::{Colour, Figure, Series};

/// Position of an axis along a record, and its error, without an observer: driven by the logged inputs from the measured start. A run that
/// leaves all bounds is not drawn, and one that leaves the record by more than its travel not to its end; none for other machines.
pub(super) fn figure(
    output: &Channel<'_>,
    track: &Track,
    models: [&Explained; 2],
    measured: &[f64],
) -> Option<Figure> {
    let Base::Axis(_) = models[1].base else {
        return None;
    };
    let runs = models.map(|model| model.open_loop(track));
    let (low, high) = range(measured);
    let travel = high - low;
    let time = |k: usize| k as f64 * track.step;
    let line = |values: &[f64]| Series::line((0..values.len()).map(|k| (time(k), values[k])).collect());
    let mut along = output
        .panel_in_time("Position")
        .series(line(measured).label("measured").colour(Colour::Bound).width(2.0));
    let mut errors = output.panel_in_time("Error");
    let mut drawn = [[low, high], [0.0; 2]];
    for (run, (label, colour)) in runs.iter().zip(BEFORE_AFTER) {
        let Some(run) = run else { continue };
        let positions: Vec<f64> = run.outputs.iter().map(|y| y[0]).collect();
        let error: Vec<f64> = positions.iter().zip(measured).map(|(y, m)| y - m).collect();
        drawn[0] = wider(drawn[0], &positions, [low - travel, high + travel]);
        drawn[1] = wider(drawn[1], &error, [-travel, travel]);
        along = along.series(line(&positions).label(label).colour(colour));
        errors = errors.series(line(&error).label(label).colour(colour));
    }
    let [positions, differences] = drawn;
    along.y = along.y.range(positions[0], positions[1]);
    if differences[1] > differences[0] {
        errors.y = errors.y.range(differences[0], differences[1]);
    }
    runs.iter().any(Option::is_some).then(|| {
        Figure::new("").columns(1).panel(along).panel(errors).caption(
            "Free run over the first held-out record: the model driven by the logged inputs from the measured start, without an observer. What \
             leaves the record by more than its travel is cut off.",
        )
    })
}

/// A range with these values in it, as far as they lie within bounds.
fn wider([low, high]: [f64; 2], values: &[f64], [least, most]: [f64; 2]) -> [f64; 2] {
    let (from, to) = range(values);
    [low.min(from.max(least)), high.max(to.min(most))]
}

#[cfg(test)]
mod tests {
    use super::wider;

    #[test]
    fn what_leaves_the_bounds_does_not_widen_a_range_beyond_them() {
        for unit in [1e-6, 1.0, 1e6] {
            let of = |v: [f64; 2]| v.map(|v| v * unit);
            let bounds = of([-2.0, 3.0]);
            assert_eq!(wider(of([0.0, 1.0]), &of([0.2, 0.9]), bounds), of([0.0, 1.0]));
            assert_eq!(wider(of([0.0, 1.0]), &of([-1.0, 2.0]), bounds), of([-1.0, 2.0]));
            assert_eq!(wider(of([0.0, 1.0]), &of([-9.0, 9.0]), bounds), bounds);
        }
    }
}
