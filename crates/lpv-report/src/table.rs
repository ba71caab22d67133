//! Tables: a head, rows of cells, a caption.

use crate::cell::{Cell, Verdict};
use crate::{ReportError, text};

/// A table; every row has one cell a column.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Explanation above the table; may be empty.
    pub caption: String,
    /// Names of the columns.
    pub head: Vec<String>,
    /// The cells, row by row.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table with these columns and no rows yet.
    pub fn new<S: Into<String>>(caption: impl Into<String>, head: impl IntoIterator<Item = S>) -> Self {
        Self {
            caption: caption.into(),
            head: head.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    pub fn row(mut self, cells: impl IntoIterator<Item = Cell>) -> Self {
        self.rows.push(cells.into_iter().collect());
        self
    }

    /// Number of cells that miss their bar.
    pub fn failures(&self) -> usize {
        self.rows
            .iter()
            .flatten()
            .filter(|cell| cell.verdict() == Some(Verdict::Fail))
            .count()
    }

    pub(crate) fn to_html(&self) -> Result<String, ReportError> {
        let columns = self.head.len();
        if columns == 0 {
            return Err(ReportError::EmptyTable {
                table: self.caption.clone(),
            });
        }
        for (row, cells) in self.rows.iter().enumerate() {
            if cells.len() != columns {
                let (table, found) = (self.caption.clone(), cells.len());
                return Err(ReportError::RowWidth {
                    table,
                    row,
                    expected: columns,
                    found,
                });
            }
        }
        let mut out = String::from("<div class=\"scroll\"><table>");
        if !self.caption.is_empty() {
            out.push_str(&format!("<caption>{}</caption>", text::to_html(&self.caption)));
        }
        out.push_str("<thead><tr>");
        for (column, name) in self.head.iter().enumerate() {
            let class = if self.is_numeric(column) {
                " class=\"n\""
            } else {
                ""
            };
            out.push_str(&format!("<th scope=\"col\"{class}>{}</th>", text::to_html(name)));
        }
        out.push_str("</tr></thead>\n<tbody>");
        for row in &self.rows {
            out.push_str("<tr>");
            for cell in row {
                out.push_str(&cell_html(cell));
            }
            out.push_str("</tr>\n");
        }
        out.push_str("</tbody></table></div>\n");
        Ok(out)
    }

    /// Whether a column holds numbers and, apart from empty cells, nothing else.
    fn is_numeric(&self, column: usize) -> bool {
        let mut cells = self
            .rows
            .iter()
            .filter_map(|row| row.get(column))
            .filter(|cell| **cell != Cell::Empty);
        let first = cells.next();
        first.is_some()
            && first
                .into_iter()
                .chain(cells)
                .all(|cell| matches!(cell, Cell::Number { .. }))
    }
}

fn cell_html(cell: &Cell) -> String {
    let class = match cell {
        Cell::Number { .. } => " class=\"n\"",
        Cell::Empty => " class=\"n e\"",
        Cell::Text(_) => "",
    };
    format!(
        "<td{class}>{}{}</td>",
        text::to_html(&cell.markup()),
        bar_html(cell)
    )
}

/// The bar and its mark; words beside colour, for readers who do not see either.
pub(crate) fn bar_html(cell: &Cell) -> String {
    let (Some(bar), Some(verdict)) = (cell.bar_markup(), cell.verdict()) else {
        return String::new();
    };
    let bar = text::to_html(&bar);
    match verdict {
        Verdict::Pass => format!(" <span class=\"bar pass\" title=\"bar met\">✓&nbsp;{bar}</span>"),
        Verdict::Fail => format!(" <span class=\"bar fail\" title=\"bar not met\">✗&nbsp;{bar}</span>"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Bar, Format};

    fn table() -> Table {
        Table::new("Errors <strict>", ["model", "error"])
            .row([
                Cell::text("OBF & spline"),
                Cell::decibel(-13.8, 1).bar(Bar::AtMost(-40.0)),
            ])
            .row([Cell::text("LFR"), Cell::decibel(-62.0, 1).bar(Bar::AtMost(-40.0))])
            .row([Cell::text("none"), Cell::Empty])
    }

    #[test]
    fn a_table_by_hand() {
        let html = table().to_html().unwrap();
        assert!(html.contains("<caption>Errors &lt;strict&gt;</caption>"));
        assert!(html.contains("<th scope=\"col\">model</th><th scope=\"col\" class=\"n\">error</th>"));
        assert!(html.contains("<td>OBF &amp; spline</td>"));
        assert!(html.contains("bar fail\" title=\"bar not met\">✗&nbsp;≤\u{a0}−40.0"));
        assert_eq!(html.matches("bar pass").count(), 1);
        assert_eq!(table().failures(), 1);
    }

    #[test]
    fn a_row_that_does_not_fit_is_named() {
        let error = table()
            .row([Cell::number(1.0, Format::Fixed(0))])
            .to_html()
            .unwrap_err();
        assert!(
            matches!(
                error,
                ReportError::RowWidth {
                    row: 3,
                    expected: 2,
                    found: 1,
                    ..
                }
            ),
            "{error}"
        );
        let error = Table::new("t", Vec::<String>::new()).to_html().unwrap_err();
        assert!(matches!(error, ReportError::EmptyTable { .. }));
    }
}
