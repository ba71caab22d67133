use super::Row;
use super::small::{COLUMNS, ROWS, csv, grid, grid_cell};

fn lines(change: impl FnOnce(&mut Vec<String>)) -> String {
    let mut lines: Vec<String> = csv().lines().map(str::to_owned).collect();
    change(&mut lines);
    lines.join("\n")
}

pub(super) const CASES: &[Row] = &[
    (
        "csv-empty",
        "an empty file",
        |d| grid(d, ""),
        &["damaged CSV file: line 1: the file is empty"],
    ),
    (
        "csv-header-only",
        "a header without rows",
        |d| grid(d, COLUMNS.join(",") + "\n"),
        &["column `y1` has no rows"],
    ),
    (
        "csv-mixed-decimals",
        "semicolons, and decimal commas and points in one file",
        |d| {
            grid(
                d,
                lines(|l| {
                    for (k, line) in l.iter_mut().enumerate() {
                        *line = line.replace(',', ";");
                        if k != 60 {
                            *line = line.replace('.', ",");
                        }
                    }
                }),
            )
        },
        &[
            "line 61, column `u1`: `",
            "is not a number; write numbers like -1,5e-3",
        ],
    ),
    (
        "csv-names-too-few",
        "tabs, and a name less than columns",
        |d| grid(d, csv().replace(',', "\t").replacen("\tr2", "", 1)),
        &["line 1 has 7 fields, and the rows from line 2 on have 8 separated by tabs; [text]"],
    ),
    (
        "csv-decimal-commas",
        "commas between fields and in numbers",
        |d| grid(d, csv().replace('.', ",")),
        &["line 2: ", "the header has 8", "decimal commas"],
    ),
    (
        "csv-decimal-comma-quoted",
        "a decimal comma in quotation marks",
        |d| grid_cell(d, "u2", 4, "\"1,5\""),
        &["line 6, column `u2`: `1,5` is not a number"],
    ),
    (
        "csv-row-long",
        "a row with a field more than the header",
        |d| grid(d, lines(|l| l[10] += ",5")),
        &["line 11: 9 fields, the header has 8"],
    ),
    (
        "csv-row-cut",
        "a file that was cut in a row",
        |d| grid(d, lines(|l| l[ROWS] = "0.1,0.2".to_owned())),
        &["line 121: 2 fields, the header has 8; complete the row"],
    ),
    (
        "csv-text",
        "a text among numbers",
        |d| grid_cell(d, "u2", 4, "off"),
        &["line 6, column `u2`: `off` is not a number"],
    ),
    (
        "csv-cell-empty",
        "an empty cell",
        |d| grid_cell(d, "u2", 4, ""),
        &["line 6, column `u2`: the cell is empty"],
    ),
    (
        "csv-quote-open",
        "a quotation mark that is never closed",
        |d| grid_cell(d, "u2", 4, "\"1.5"),
        &["damaged CSV file: line 6: a quotation mark is never closed"],
    ),
    (
        "csv-nul",
        "a NUL byte",
        |d| grid_cell(d, "u2", 4, "1\0"),
        &["line 6: a NUL byte: the file is binary or UTF-16"],
    ),
    (
        "csv-utf16",
        "text of two bytes a letter",
        |d| {
            grid(
                d,
                csv().encode_utf16().fold(vec![0xff, 0xfe], |mut all, c| {
                    all.extend(c.to_le_bytes());
                    all
                }),
            )
        },
        &["line 1: the text is UTF-16; save it as UTF-8"],
    ),
    (
        "csv-glued",
        "two files glued together",
        |d| grid(d, format!("{}\u{feff}{}", csv(), csv())),
        &["line 122: a byte order mark inside the text: two files glued together?"],
    ),
    (
        "csv-headers-twice",
        "a second header in the middle",
        |d| grid(d, csv() + &csv()),
        &["line 122, column `u1`: `u1` is not a number"],
    ),
    (
        "csv-name-twice",
        "a header with one name twice",
        |d| grid(d, csv().replacen("r1", "y2", 1).replacen("r2", "r1", 1)),
        &["line 1: the header has the column `y2` 2 times; rename all but one"],
    ),
    (
        "csv-column-missing",
        "a column that the file does not have",
        |d| grid(d, csv().replacen("y1", "Y1_", 1)),
        &["no column `y1` among the 8 of the file; nearest: `u1`, `Y1_`"],
    ),
    (
        "csv-no-header",
        "a file without header",
        |d| grid(d, lines(|l| drop(l.remove(0)))),
        &["no line has the names of the 8 columns; write header = 0 and their names"],
    ),
];
