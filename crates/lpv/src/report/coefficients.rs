//! The entries of the frozen state space that change with the scheduling variable.

use super::Subject;
use crate::PipelineError;
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Clock, FrozenModel, StateSpace};
use lpv_report::{Axis, Colour, Figure, Panel, Section, Series};

/// Points along the range.
const POINTS: usize = 101;

/// Functions that are drawn in one panel.
const A_PANEL: usize = 6;

/// A relative change below this is rounding.
const CHANGES: f64 = 1e-9;

pub(super) fn section(s: &Subject) -> Result<Option<Section>, PipelineError> {
    let Some([low, high]) = s
        .machine
        .range()
        .filter(|r| r.parameters() == 1)
        .map(|r| r.bounds()[0])
    else {
        return Ok(None);
    };
    let grid: Vec<f64> = (0..POINTS)
        .map(|k| low + (high - low) * k as f64 / (POINTS - 1) as f64)
        .collect();
    let model = s.file.model.in_states()?;
    // Sampling would make nearly every entry of a continuous model change.
    let at = |p: f64| -> Result<[DMatrix<f64>; 4], PipelineError> {
        Ok(match model.frozen(&[p])? {
            FrozenModel::Continuous(m) => matrices(&m),
            FrozenModel::Discrete(m) => matrices(&m),
        })
    };
    let frozen = grid.iter().map(|&p| at(p)).collect::<Result<Vec<_>, _>>()?;
    let mut figure = Figure::new("Coefficient functions").columns(2);
    let (mut drawn, mut changing) = (0, 0);
    for (pick, name) in ["A", "B", "C", "D"].into_iter().enumerate() {
        let matrices: Vec<&DMatrix<f64>> = frozen.iter().map(|f| &f[pick]).collect();
        let found = functions(&grid, &matrices);
        changing += found.len();
        if found.is_empty() {
            continue;
        }
        drawn += found.len().min(A_PANEL);
        let mut panel = Panel::new(Axis::linear("Scheduling p"), Axis::linear("Entry")).title(format!(
            "{name}(p): {} of {} entries change",
            found.len(),
            matrices[0].len()
        ));
        for (n, (i, j, points)) in found.into_iter().take(A_PANEL).enumerate() {
            panel = panel.series(
                Series::line(points)
                    .label(format!("{name}_{{{},{}}}", i + 1, j + 1))
                    .colour(Colour::Index(n)),
            );
        }
        figure = figure.panel(panel);
    }
    if changing == 0 {
        return Ok(None);
    }
    let more = if drawn < changing {
        format!(" The {A_PANEL} that change most are drawn of each matrix.")
    } else {
        String::new()
    };
    Ok(Some(Section::new("Coefficient functions").figure(
        figure.caption(format!(
            "Entries of the frozen state space that depend on the scheduling variable.{more}"
        )),
    )))
}

fn matrices<K: Clock>(s: &StateSpace<K>) -> [DMatrix<f64>; 4] {
    [s.a(), s.b(), s.c(), s.d()].map(Clone::clone)
}

/// An entry as a function of p: row, column, points.
type Function = (usize, usize, Vec<(f64, f64)>);

/// Entries that change, the largest change first.
fn functions(grid: &[f64], matrices: &[&DMatrix<f64>]) -> Vec<Function> {
    let scale = matrices.iter().map(|m| m.amax()).fold(0.0, f64::max);
    let mut found: Vec<(f64, Function)> = Vec::new();
    for i in 0..matrices[0].nrows() {
        for j in 0..matrices[0].ncols() {
            let values: Vec<f64> = matrices.iter().map(|m| m[(i, j)]).collect();
            let (low, high) = lpv_numerics::statistics::range(&values);
            if high - low > CHANGES * scale {
                let points = grid.iter().copied().zip(values).collect();
                found.push((high - low, (i, j, points)));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, f)| f).collect()
}
