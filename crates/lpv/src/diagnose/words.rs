//! The first line of a diagnosis.

use super::account::{Errors, FoundEffect};

/// The first line of a diagnosis: the verdict, what was added, and the largest error over the noise on the judged records before and
/// after.
pub(super) fn in_words(verdict: &str, effects: &[FoundEffect], before: &Errors, after: &Errors) -> String {
    let largest = |errors: &Errors| {
        let over = errors
            .validation
            .values()
            .map(|e| e.over_noise)
            .fold(0.0, f64::max);
        if over < 1e4 {
            format!("{over:.2}")
        } else {
            format!("{over:.1e}")
        }
    };
    let (before, after) = (largest(before), largest(after));
    let names: Vec<String> = effects
        .iter()
        .map(|e| format!("{} at {}", e.effect, e.channel))
        .collect();
    let names = names.join(", ");
    match verdict {
        "nothing-missing" => {
            format!("nothing is missing: on held-out records the error is {after} times the noise")
        }
        "explained" => {
            format!(
                "explained: {names}; on held-out records the error falls from {before} to {after} times the noise"
            )
        }
        "partly-explained" => format!(
            "partly explained: {names}; on held-out records the error falls from {before} to {after} times the noise, and that is left"
        ),
        _ => format!(
            "unexplained: on held-out records the error is {after} times the noise, and no effect of the catalogue explains it; do not \
             rely on the model for such moves"
        ),
    }
}
