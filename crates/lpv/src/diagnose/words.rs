//! The first line of a diagnosis.

/// The first line of a diagnosis: the verdict, what was added, and the largest error over the noise on the judged records before and
/// after.
pub(super) fn in_words(verdict: &str, names: &str, over_noise: [f64; 2]) -> String {
    let [before, after] = over_noise.map(|over| match over < 1e4 {
        true => format!("{over:.2}"),
        false => format!("{over:.1e}"),
    });
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
