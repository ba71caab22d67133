//! Columns of text for a terminal.

/// A table with aligned columns.
pub(crate) struct TextTable {
    rows: Vec<Vec<String>>,
}

impl TextTable {
    pub(crate) fn new(head: &[&str]) -> Self {
        Self {
            rows: vec![head.iter().map(ToString::to_string).collect()],
        }
    }
    pub(crate) fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }
    /// Indented by two, columns two apart, numbers to the right; a column that is empty in every row is left out.
    pub(crate) fn text(&self) -> String {
        let columns = self.rows[0].len();
        let cell = |r: &[String], c: usize| r.get(c).cloned().unwrap_or_default();
        let used: Vec<usize> = (0..columns)
            .filter(|&c| self.rows.len() == 1 || self.rows[1..].iter().any(|r| !cell(r, c).is_empty()))
            .collect();
        let width = |c: usize| {
            self.rows
                .iter()
                .map(|r| cell(r, c).chars().count())
                .max()
                .unwrap_or(0)
        };
        let numeric = |c: usize| {
            self.rows[1..]
                .iter()
                .all(|r| cell(r, c).starts_with(|f: char| f.is_ascii_digit() || f == '-' || f == '+'))
        };
        let mut out = String::new();
        for row in &self.rows {
            let mut line = String::new();
            for &c in &used {
                let text = cell(row, c);
                let pad = " ".repeat(width(c) - text.chars().count());
                line += "  ";
                line += &if numeric(c) { pad + &text } else { text + &pad };
            }
            out += line.trim_end();
            out.push('\n');
        }
        out
    }
}
