//! The words and the unit in the name of a column.

/// Of a struct only the field says what it is, and a unit in brackets does not count.
pub(super) fn plain_name(column: &str) -> String {
    let column = column.split("(:").next().unwrap_or(column);
    let field = match column.find(['[', '(']) {
        Some(open) => column[..open].rsplit('.').next().unwrap_or(column),
        None => column.rsplit('.').next().unwrap_or(column),
    };
    field.trim().to_owned()
}

/// The words of a name in small letters, apart where anything but a letter or a capital after a small letter parts them.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut all = vec![String::new()];
    let mut small_before = false;
    for c in name.chars() {
        let begins = c.is_uppercase() && small_before;
        if (begins || !c.is_alphabetic()) && all.last().is_some_and(|w| !w.is_empty()) {
            all.push(String::new());
        }
        if c.is_alphabetic()
            && let Some(word) = all.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        small_before = c.is_lowercase();
    }
    all.retain(|w| !w.is_empty());
    all
}

/// The unit in brackets behind a name: `force [N]`, `pos (mm)`.
pub(super) fn unit_of(column: &str) -> Option<&str> {
    let open = column.rfind(['[', '('])?;
    let inside = column
        .get(open + 1..)?
        .trim_end()
        .strip_suffix([']', ')'])?
        .trim();
    // The column of a matrix is no unit.
    (!inside.is_empty() && !inside.contains([':', '='])).then_some(inside)
}
