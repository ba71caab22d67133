//! Text that comes from files, made safe for the place that it goes to: a terminal, a Python module, a cell of a spreadsheet.
//!
//! Names, units and notes are anything that a file can hold. In a terminal a control character moves the cursor or paints, in a
//! module a line end begins a statement, in a spreadsheet `=` begins a formula. (lpv-report escapes for HTML, `toml` for TOML and
//! `serde_json` for JSON.)

/// Characters that no reader sees and that change what is seen: controls, line and paragraph separators, and those that turn the
/// direction of writing.
fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{2028}' | '\u{2029}' | '\u{200e}' | '\u{200f}' | '\u{61c}' | '\u{feff}'
        )
        || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{e0000}'..='\u{e007f}')
}

fn escaped(c: char, out: &mut String) {
    match c {
        '\n' => out.push_str("\\n"),
        '\r' => out.push_str("\\r"),
        '\t' => out.push_str("\\t"),
        c if u32::from(c) < 0x100 => out.push_str(&format!("\\x{:02x}", u32::from(c))),
        c if u32::from(c) < 0x1_0000 => out.push_str(&format!("\\u{:04x}", u32::from(c))),
        c => out.push_str(&format!("\\U{:08x}", u32::from(c))),
    }
}

/// One line of text in which every character can be seen: `\x1b` for an escape character, `\n` for a line end.
pub fn visible(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match is_hidden(c) {
            true => escaped(c, &mut out),
            false => out.push(c),
        }
    }
    out
}

/// Several lines for a terminal: line ends and tabulators stay, everything else that cannot be seen is shown as in [`visible`].
pub fn for_terminal(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match is_hidden(c) && c != '\n' && c != '\t' {
            true => escaped(c, &mut out),
            false => out.push(c),
        }
    }
    out
}

/// Several lines for a terminal, with names in them of which none may begin a line of its own.
pub fn lines<'a>(text: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    let mut broken: Vec<&str> = names.into_iter().filter(|n| n.contains(['\n', '\r'])).collect();
    broken.sort_by_key(|n| std::cmp::Reverse(n.len()));
    let whole = broken
        .into_iter()
        .fold(text.to_owned(), |text, name| text.replace(name, &visible(name)));
    for_terminal(&whole)
}

/// A message of several lines, its later lines set in, so that no text in it looks like a message of its own.
pub fn message(text: &str) -> String {
    for_terminal(text.trim_end()).replace('\n', "\n  ")
}

/// JSON in which nothing is hidden; a parser reads the same value.
pub fn json(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        // Line ends and blanks of the layout stand between strings; within them the writer has escaped all below U+0020.
        if !is_hidden(c) || c == '\n' {
            out.push(c);
            continue;
        }
        for unit in c.encode_utf16(&mut [0; 2]) {
            out.push_str(&format!("\\u{unit:04x}"));
        }
    }
    out
}

/// A string literal of Python. Letters of all scripts stay readable; marks that combine with them and everything that is neither
/// letter nor ASCII are written as numbers.
pub(crate) fn python_string(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            ' '..='~' => out.push(c),
            c if c.is_alphabetic() && !is_hidden(c) => out.push(c),
            c => escaped(c, &mut out),
        }
    }
    out.push('"');
    out
}

/// A cell with text: what a spreadsheet would take for a formula has an apostrophe in front.
pub(crate) fn cell(text: &str) -> String {
    let text = visible(text);
    // Blanks in front do not keep every spreadsheet from reading a formula.
    let begins = text
        .trim_start()
        .starts_with(['=', '+', '-', '@', '＝', '＋', '－', '＠']);
    match begins {
        true => format!("'{text}"),
        false => text,
    }
}

/// A name of letters, digits and `_` only, for a variable of Python or MATLAB, behind a prefix that starts with a letter.
pub(crate) fn word(text: &str) -> String {
    text.replace(|c: char| !c.is_ascii_alphanumeric(), "_")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::strategy::ValueTree;

    /// Texts with what does harm more often than chance gives it.
    fn wild() -> impl Strategy<Value = String> {
        let part = prop_oneof![
            Just("\n".to_owned()),
            Just("\r".to_owned()),
            Just("\"".to_owned()),
            Just("\"\"\"".to_owned()),
            Just("'".to_owned()),
            Just("\\".to_owned()),
            Just("\u{1b}[31m".to_owned()),
            Just("\u{202e}".to_owned()),
            Just("u\u{308}".to_owned()),
            Just("\u{0}".to_owned()),
            Just("=1+1".to_owned()),
            Just(",".to_owned()),
            Just("\u{10ffff}".to_owned()),
            any::<char>().prop_map(String::from),
            "[a-z_ ]{0,5}",
        ];
        prop::collection::vec(part, 0..8).prop_map(|parts| parts.concat())
    }

    proptest! {
        #[test]
        fn nothing_hidden_is_left(text in wild()) {
            prop_assert!(!visible(&text).chars().any(is_hidden));
            prop_assert!(!for_terminal(&text).chars().any(|c| is_hidden(c) && c != '\n' && c != '\t'));
            let told = message(&text);
            prop_assert!(told.lines().skip(1).all(|l| l.starts_with("  ")));
        }

        #[test]
        fn json_is_the_same_value(text in wild()) {
            let shown = json(&serde_json::to_string_pretty(&[&text]).unwrap());
            prop_assert!(!shown.chars().any(|c| is_hidden(c) && c != '\n'));
            let back: Vec<String> = serde_json::from_str(&shown).unwrap();
            prop_assert_eq!(&back[0], &text);
        }

        #[test]
        fn a_cell_is_no_formula_and_one_cell(text in wild()) {
            let mut table = csv::Writer::from_writer(Vec::new());
            table.write_record([&cell(&text), "2"]).unwrap();
            let bytes = table.into_inner().unwrap();
            let mut rows = csv::ReaderBuilder::new().has_headers(false).from_reader(&bytes[..]);
            let row = rows.records().next().unwrap().unwrap();
            prop_assert_eq!(row.len(), 2);
            prop_assert!(!row[0].trim_start().starts_with(['=', '+', '-', '@', '\t', '\r']));
            prop_assert!(rows.records().next().is_none());
        }

        #[test]
        fn a_word_is_a_word(text in wild()) {
            prop_assert!(word(&text).chars().all(|c| c.is_ascii_alphanumeric() || c == '_'));
        }
    }

    #[test]
    fn python_reads_the_string_that_was_written() {
        let mut runner = proptest::test_runner::TestRunner::deterministic();
        let texts: Vec<String> = (0..400)
            .map(|_| wild().new_tree(&mut runner).unwrap().current())
            .collect();
        let mut module = String::new();
        for text in &texts {
            module += &format!("# {}\n{},\n", visible(text), python_string(text));
        }
        let program = "import ast, json, sys\n\
                       print(json.dumps(ast.literal_eval('[' + sys.stdin.read() + ']')))";
        let Ok(mut python) = std::process::Command::new("python3")
            .args(["-c", program])
            .env("PYTHONUTF8", "1")
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .spawn()
        else {
            eprintln!("skipped: there is no python3");
            return;
        };
        use std::io::Write;
        python.stdin.take().unwrap().write_all(module.as_bytes()).unwrap();
        let out = python.wait_with_output().unwrap();
        assert!(out.status.success());
        let back: Vec<String> = serde_json::from_slice(&out.stdout).unwrap();
        assert_eq!(back, texts);
    }
}
