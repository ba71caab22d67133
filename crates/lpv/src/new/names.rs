//! The words and the unit in the name of a column.

/// Of a struct only the field says what it is, and a unit in brackets does not count.
pub(super) fn plain_name(column: &str) -> String {
    let column = column.split("(:").next().unwrap_or(column);
    // An element of a struct array: `data(2).u`.
    let element = column.rfind(").").map_or(0, |at| at + 2);
    let column = &column[element..];
    let column = without_index(column);
    let field = match column.find(['[', '(']) {
        Some(open) => column[..open].rsplit('.').next().unwrap_or(&column),
        None => column.rsplit('.').next().unwrap_or(&column),
    };
    field.trim().to_owned()
}

/// Without numbers in brackets that are no unit: `r61[0]: speed (1/min)`, `FPOS(0)`.
fn without_index(column: &str) -> String {
    let mut all = column.to_owned();
    let mut from = 0;
    while let Some(open) = all[from..].find(['[', '(']).map(|at| from + at) {
        let length = all[open + 1..].bytes().take_while(u8::is_ascii_digit).count();
        let is_index = length > 0 && all[open + 1 + length..].starts_with([']', ')']);
        match is_index {
            true => all.replace_range(open..open + length + 2, ""),
            false => from = open + 1,
        }
    }
    // A parameter of a drive has its number before what it is.
    match all.split_once(": ") {
        Some((_, what)) if all != column && !what.trim().is_empty() => what.to_owned(),
        _ => all,
    }
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
    let is_index = inside.bytes().all(|b| b.is_ascii_digit());
    (!is_index && !inside.contains([':', '='])).then_some(inside)
}
