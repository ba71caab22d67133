//! The number of functions by cost.

use crate::{BasisError, FkcmResult, FkcmSettings, PoleSet, fkcm};
use std::ops::RangeInclusive;

/// One size tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeCost {
    /// Number of functions.
    pub functions: usize,
    /// n-width cost on the observed poles, dB.
    pub cost_db: f64,
    /// Starts within 0.01 dB of the best.
    pub reached_best: usize,
}

/// The account of [`choose_functions`].
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The smallest size that reaches the target, or the size of least cost if none does.
    pub result: FkcmResult,
    /// Every size tried, smallest first.
    pub table: Vec<SizeCost>,
    /// Whether the target is met.
    pub verdict: Verdict,
}

/// Whether a size met the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The cost is at or below the target.
    Reached,
    /// No size of the range reaches the target.
    NotReached,
}

/// Tries the sizes of `functions` from the smallest until one reaches `target_db`.
///
/// Sizes of the parity of the settings' own `functions` are tried (that parity decides how many real centres are
/// possible); fuzziness, starts, iterations and seed apply to every size.
///
/// # Errors
/// [`BasisError::EmptyRange`]; [`BasisError::Setting`] for a target that is NaN; those of [`fkcm`].
pub fn choose_functions(
    observed: &PoleSet,
    functions: RangeInclusive<usize>,
    target_db: f64,
    settings: &FkcmSettings,
) -> Result<Choice, BasisError> {
    let (lowest, highest) = (*functions.start(), *functions.end());
    if target_db.is_nan() {
        return Err(BasisError::Setting {
            name: "target_db",
            value: target_db,
            range: "a number",
        });
    }
    if lowest == 0 || lowest > highest {
        return Err(BasisError::EmptyRange { lowest, highest });
    }
    settings.check()?;
    let parity = settings.reals() % 2;
    let mut table = Vec::new();
    let mut best: Option<FkcmResult> = None;
    for size in functions.filter(|size| size % 2 == parity) {
        if settings.real_centres.is_some_and(|reals| reals > size) {
            continue;
        }
        let found = fkcm(
            observed,
            &FkcmSettings {
                functions: size,
                ..settings.clone()
            },
        )?;
        table.push(SizeCost {
            functions: size,
            cost_db: found.cost_db,
            reached_best: found.reached_best,
        });
        if found.cost_db <= target_db {
            return Ok(Choice {
                result: found,
                table,
                verdict: Verdict::Reached,
            });
        }
        if best.as_ref().is_none_or(|b| found.cost_db < b.cost_db) {
            best = Some(found);
        }
    }
    let result = best.ok_or(BasisError::EmptyRange { lowest, highest })?;
    Ok(Choice {
        result,
        table,
        verdict: Verdict::NotReached,
    })
}
