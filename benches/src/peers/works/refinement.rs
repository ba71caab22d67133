//! The refinement of an LFR on frozen responses, to the same cost.

use super::{Failure, Run, parts, write};
use lfr_fit::{RefineSettings, StopReason, refine};
use lpv_benches::refinement::{Case, LINES, lines};
use lpv_core::nalgebra::DMatrix;
use std::path::Path;

/// Both are done at a cost that is so near the least one.
const DONE: f64 = 1.001;

/// The least cost, and the rms that counts as reached.
fn goal(case: &Case) -> Result<(f64, f64), Failure> {
    let settings = RefineSettings {
        tolerance: 1e-9,
        max_iterations: 2000,
        ..RefineSettings::default()
    };
    let account = refine(&case.start, &case.data, &settings)?.account;
    let least = account.costs.last().copied().ok_or("no cost")?;
    Ok((DONE * least, DONE.sqrt() * account.rms))
}

pub(super) fn ours() -> Result<Run, Failure> {
    let case = Case::new()?;
    let (_, rms) = goal(&case)?;
    let settings = RefineSettings {
        target: rms,
        tolerance: 1e-9,
        ..RefineSettings::default()
    };
    Ok(Box::new(move || {
        let refined = refine(&case.start, &case.data, &settings)?;
        if refined.account.stop != StopReason::TargetReached {
            return Err(format!("the cost was not reached: {:?}", refined.account.stop).into());
        }
        Ok(refined.candidate.matrix().transpose().as_slice().to_vec())
    }))
}

pub(super) fn export(folder: &Path) -> Result<(), Failure> {
    let case = Case::new()?;
    let (cost, _) = goal(&case)?;
    write(folder, "start", case.start.matrix().transpose().iter().copied())?;
    let free = case.start.free().transpose();
    write(folder, "free", free.iter().map(|f| f64::from(u8::from(*f))))?;
    write(folder, "positions", case.responses.iter().map(|(p, _)| p[0]))?;
    write(folder, "lines", lines())?;
    write(folder, "cost", [cost])?;
    let rows = case.responses.iter().flat_map(|(_, frf)| super::rows_of(frf));
    write(folder, "frf", rows)
}

/// The responses of a result against those without noise.
pub(super) fn error(found: &[f64]) -> Result<f64, Failure> {
    let case = Case::new()?;
    let n = case.start.matrix().nrows();
    if found.len() != n * n {
        return Err(format!("{} numbers for a matrix of {}", found.len(), n * n).into());
    }
    let candidate = case.candidate(&DMatrix::from_row_slice(n, n, found))?;
    let (mut all, mut truth) = (Vec::new(), Vec::new());
    for ((p, _), exact) in case.responses.iter().zip(&case.exact) {
        let frf = candidate.frozen(p)?.frequency_response(&lines())?;
        for k in 0..LINES {
            let size = exact.line(k).norm();
            all.extend(frf.line_slice(k).iter().flat_map(|v| parts(v / size)));
            truth.extend(exact.line_slice(k).iter().flat_map(|v| parts(v / size)));
        }
    }
    super::distance(&all, &truth)
}
