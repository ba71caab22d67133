use super::{Row, small::put};
use std::path::Path;

const HEAD: &str = "format = 2\nname = \"response\"\nsample_rate = 1000.0\n[channels.output]\ncolumns = [\"y\"]\n[channels.input]\n\
                    columns = [\"u\"]\n";
const RECORD: &str = "[[records]]\nfile = \"a.csv\"\nkind = \"response\"\nuse = \"estimation\"\n";
const TABLE: &str = "frequency,y/u re,y/u im\n1,1,0\n2,0.5,-0.1\n4,0.1,-0.2\n";

fn with(dir: &Path, head: &str, record: &str, table: &str) {
    put(dir, "experiment.toml", format!("{head}{record}"));
    put(dir, "a.csv", table);
}

fn table(dir: &Path, from: &str, to: &str) {
    with(dir, HEAD, RECORD, &TABLE.replace(from, to));
}

fn more(dir: &Path, line: &str) {
    with(dir, HEAD, &format!("{RECORD}{line}\n"), TABLE);
}

/// Columns behind the table.
fn beside(dir: &Path, cells: [&str; 4]) {
    let lines = TABLE
        .lines()
        .zip(cells)
        .map(|(line, cell)| format!("{line},{cell}\n"));
    with(dir, HEAD, RECORD, &lines.collect::<String>());
}

pub(super) const CASES: &[Row] = &[
    (
        "response-format-1",
        "a response in a description of format 1",
        |d| with(d, &HEAD.replace('2', "1"), RECORD, TABLE),
        &[":10:8", "kind = \"response\"` is a key of format 2"],
    ),
    (
        "response-period",
        "a response with a period",
        |d| more(d, "period = 100"),
        &["`period` is for records of samples"],
    ),
    (
        "response-quantity",
        "a quantity that no response has",
        |d| more(d, "quantity = \"speed/torque\""),
        &["unknown value `speed/torque`", "velocity/force"],
    ),
    (
        "response-quantity-of-samples",
        "the quantity of a response on a record of samples",
        |d| {
            with(
                d,
                HEAD,
                &format!(
                    "{}quantity = \"mobility\"\n",
                    RECORD.replace("response", "transient")
                ),
                TABLE,
            )
        },
        &["says what a measured frequency response is of"],
    ),
    (
        "response-position",
        "a response without a position where p is measured",
        |d| {
            with(
                d,
                &format!("{HEAD}[channels.scheduling]\ncolumns = [\"p\"]\n"),
                RECORD,
                TABLE,
            )
        },
        &["say where it was measured: position = 0.1"],
    ),
    (
        "response-columns",
        "a place for a column that no response has",
        |d| more(d, "columns = { \"y/u real\" = \"a\" }"),
        &["`y/u real` is no channel of this bundle; nearest: `y/u re`"],
    ),
    (
        "response-missing",
        "a column that is not there",
        |d| table(d, "y/u im", "imag"),
        &[
            "no `y/u im` in the file",
            "frequency, y/u re, imag",
            "columns = { \"y/u im\" = \"...\" }",
        ],
    ),
    (
        "response-order",
        "lines that are not sorted",
        |d| table(d, "\n4,", "\n1.5,"),
        &["line 3: the frequency 1.5 Hz is not above the one before it"],
    ),
    (
        "response-negative",
        "a negative frequency",
        |d| table(d, "\n1,", "\n-1,"),
        &["line 1: the frequency -1.0 Hz is negative"],
    ),
    (
        "response-nan",
        "a line without a value",
        |d| table(d, "0.5,", "NaN,"),
        &["`response` is NaN or infinite in line 2 (2 Hz), 1 in all"],
    ),
    (
        "response-zero",
        "a channel that is zero",
        |d| with(d, HEAD, RECORD, "frequency,y/u re,y/u im\n1,0,0\n2,0,0\n"),
        &["the response of y is zero at all lines"],
    ),
    (
        "response-dc",
        "no line but that at 0 Hz",
        |d| with(d, HEAD, RECORD, "frequency,y/u re,y/u im\n0,1,0\n"),
        &["no line above 0 Hz"],
    ),
    (
        "response-variance",
        "a variance of zero",
        |d| beside(d, ["y/u variance", "1", "0", "1"]),
        &["`variance` in line 2 is 0.0; a variance is finite and above zero"],
    ),
    (
        "response-coherence",
        "a coherence without the number of averages",
        |d| beside(d, ["y/u coherence", "0.9", "1", "0.8"]),
        &["`coherence` tells a variance with the number of averages; add `averages`"],
    ),
    (
        "response-coherence-above-one",
        "a coherence above one",
        |d| beside(d, ["y/u coherence,averages", "0.9,8", "1.1,8", "0.8,8"]),
        &["`coherence` in line 2 is 1.1; a coherence is above 0 and at most 1"],
    ),
    (
        "response-rows",
        "lines that are not there",
        |d| more(d, "rows = [2, 9]"),
        &["rows = [2, 9], but column `frequency` has 3 rows"],
    ),
];
