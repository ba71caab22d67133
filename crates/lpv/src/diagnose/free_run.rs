//! The machine let run free over a record, before and after.

use super::figures::{BEFORE_AFTER, Channel};
use lpv_diagnose::{Base, Explained, Track};
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
    let [low, high] = bounds(measured.iter().copied())?;
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
        for (range, (values, [low, high])) in drawn
            .iter_mut()
            .zip([(&positions, [low, high]), (&error, [0.0; 2])])
        {
            let [from, to] = bounds(values.iter().copied())?;
            *range = [
                range[0].min(from.max(low - travel)),
                range[1].max(to.min(high + travel)),
            ];
        }
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

fn bounds(mut values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let first = values.next()?;
    Some(values.fold([first; 2], |[a, b], v| [a.min(v), b.max(v)]))
}
