//! Counts in sentences.

/// A count with its noun: `1 output`, `3 outputs`; for nouns whose plural ends in `s`.
///
/// ```
/// use lpv_core::counted;
/// assert_eq!((counted(1, "input"), counted(0, "time")), ("1 input".to_owned(), "0 times".to_owned()));
/// ```
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
