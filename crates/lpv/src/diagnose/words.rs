//! The first line of a diagnosis.

use super::found::{FoundEffect, names};

/// The first line of a diagnosis: the verdict, what was added with its size, and the largest error over the noise on the judged records
/// before and after; `records` are the names of all records.
pub(super) fn in_words(
    verdict: &str,
    effects: &[FoundEffect],
    records: &[String],
    over_noise: [f64; 2],
) -> String {
    let [before, after] = over_noise.map(times);
    let (named, rounding) = names(effects, records);
    let falls =
        format!("{named}; on held-out records the error falls from {before} to {after} times the noise");
    match verdict {
        "nothing-missing" => {
            format!("nothing is missing: on held-out records the error is {after} times the noise")
        }
        "explained" if named.is_empty() => format!(
            "explained: nothing is missing beside the rounding of the readings; on held-out records the error is {after} times the \
             noise{rounding}"
        ),
        "explained" => format!("explained: {falls}{rounding}"),
        "partly-explained" if named.is_empty() => format!(
            "partly explained: the readings are rounded; on held-out records the error is {after} times the noise, and that is \
             left{rounding}"
        ),
        "partly-explained" => format!("partly explained: {falls}, and that is left{rounding}"),
        _ => format!(
            "unexplained: on held-out records the error is {after} times the noise, and no effect of the catalogue explains it; do not \
             rely on the model for such moves"
        ),
    }
}

/// What is said first of data that contradict themselves.
pub(super) fn contradicted(contradictions: &[String]) -> String {
    format!(
        "do not use: the data contradict themselves: {}",
        contradictions.join("; ")
    )
}

/// Verdict and first line where an observer of `hz` leaves noise and a slower one, `slow_hz`, so many times the noise.
pub(super) fn said_of_slower(
    effects: &[FoundEffect],
    records: &[String],
    over_noise: [f64; 2],
    [hz, slow_hz]: [f64; 2],
    slow_over_noise: f64,
) -> (&'static str, String) {
    let [before, after] = over_noise.map(times);
    let (named, rounding) = names(effects, records);
    let slow = format!(
        "through one of {slow_hz:.3} Hz, which takes less of a slow force away, {} times, and no effect of the catalogue explains that",
        times(slow_over_noise)
    );
    if named.is_empty() {
        let words = format!(
            "unexplained: on held-out records the error is {after} times the noise through an observer of {hz:.3} Hz, but {slow}; do not \
             rely on the model for such moves{rounding}"
        );
        return ("unexplained", words);
    }
    let words = format!(
        "partly explained: {named}; on held-out records the error falls from {before} to {after} times the noise through an observer of \
         {hz:.3} Hz, but {slow}{rounding}"
    );
    ("partly-explained", words)
}

/// A multiple of the noise.
fn times(over: f64) -> String {
    match over < 1e4 {
        true => format!("{over:.2}"),
        false => format!("{over:.1e}"),
    }
}
