//! Text tables of every layout that a program may write, found by looking.

use experiment_data::{look_into, read_columns_as};
use proptest::prelude::*;
use proptest::sample::select;

/// How a table is written.
#[derive(Debug, Clone)]
struct Written {
    separator: &'static str,
    comma: bool,
    ending: &'static str,
    /// Lines above the names, or above the numbers.
    notes: Vec<&'static str>,
    has_names: bool,
    units: Option<(&'static str, &'static str)>,
    is_quoted: bool,
    ends: &'static str,
    has_mark: bool,
    format: usize,
}

fn written() -> impl Strategy<Value = Written> {
    let layout = (
        select(vec![",", ";", "\t", " ", "   "]),
        any::<bool>(),
        select(vec!["csv", "txt", "dat", "log", "tsv", "asc"]),
        proptest::collection::vec(
            select(vec![
                "# recorded 2026",
                "%% file 3 of 9",
                "Measurement of axis 3",
                "Operator: Schmidt",
                "Gain: 2",
                "",
            ]),
            0..4,
        ),
    );
    let rest = (
        any::<bool>(),
        proptest::option::of(select(vec![("[", "]"), ("(", ")"), ("", "")])),
        any::<bool>(),
        select(vec!["\n", "\r\n"]),
        any::<bool>(),
        0usize..3,
    );
    (layout, rest).prop_map(|((separator, comma, ending, notes), rest)| {
        let (has_names, units, is_quoted, ends, has_mark, format) = rest;
        Written {
            separator,
            comma: comma && separator != ",",
            ending,
            notes,
            has_names,
            units: units.filter(|_| has_names),
            is_quoted: is_quoted && !separator.trim_matches(' ').is_empty(),
            ends,
            has_mark,
            format,
        }
    })
}

const NAMES: [&str; 3] = ["time", "force", "position"];
const UNITS: [&str; 3] = ["s", "N", "mm"];

impl Written {
    fn cell(&self, value: f64) -> String {
        let text = match self.format {
            0 => format!("{value}"),
            1 => format!("{value:.17e}"),
            _ => format!("{value:.9}"),
        };
        let text = if self.comma { text.replace('.', ",") } else { text };
        if self.is_quoted {
            format!("\"{text}\"")
        } else {
            text
        }
    }

    fn text(&self, rows: &[[f64; 3]]) -> String {
        let mut lines: Vec<String> = self.notes.iter().map(ToString::to_string).collect();
        if self.has_names {
            lines.push(NAMES.join(self.separator));
        }
        if let Some((open, close)) = self.units {
            let units = UNITS.map(|u| format!("{open}{u}{close}"));
            lines.push(units.join(self.separator));
        }
        lines.extend(
            rows.iter()
                .map(|row| row.map(|v| self.cell(v)).join(self.separator)),
        );
        let mark = if self.has_mark { "\u{feff}" } else { "" };
        format!("{mark}{}{}", lines.join(self.ends), self.ends)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn are_read_as_they_were_written(
        how in written(),
        scale in -6i32..5,
        numbers in proptest::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 12..60),
    ) {
        let rows: Vec<[f64; 3]> = numbers
            .iter()
            .enumerate()
            .map(|(k, (a, b))| [k as f64 * 5e-4, a * 10f64.powi(scale), *b])
            .collect();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(format!("a.{}", how.ending));
        std::fs::write(&path, how.text(&rows)).unwrap();
        let found = look_into(&path).unwrap();
        let names: Vec<&str> = found.columns.iter().map(|c| c.name.as_str()).collect();
        if how.has_names {
            prop_assert_eq!(&names, &NAMES);
        }
        prop_assert_eq!(names.len(), 3, "{:?}", &names);
        if how.units.is_some() {
            let units: Vec<&str> = found.columns.iter().map(|c| c.unit.as_str()).collect();
            prop_assert_eq!(units, UNITS);
        }
        let columns = read_columns_as(&path, &names, found.text.as_ref()).unwrap();
        for (k, column) in columns.iter().enumerate() {
            let wanted: Vec<f64> = rows
                .iter()
                .map(|row| how.cell(row[k]).replace(',', ".").trim_matches('"').parse().unwrap())
                .collect();
            prop_assert_eq!(column, &wanted);
        }
    }
}
