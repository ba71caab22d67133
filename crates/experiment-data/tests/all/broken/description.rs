use super::Row;
use super::small::edit;

/// A bundle of format 2 with a change.
fn second(dir: &std::path::Path, from: &str, to: &str) {
    let text = super::small::TOML.replacen("format = 1", "format = 2", 1);
    assert!(text.contains(from));
    edit(dir, super::small::TOML, &text.replacen(from, to, 1));
}

pub(super) const CASES: &[Row] = &[
    (
        "format-3",
        "a later version of the format",
        |d| edit(d, "format = 1", "format = 3"),
        &[":1:10: ", "format", "format 3 is not known", "formats 1 and 2"],
    ),
    (
        "format-1-text",
        "a key of format 2 in format 1",
        |d| edit(d, "period = 40", "period = 40\nrows = [1, 80]"),
        &["records[0].rows", "`rows` is a key of format 2; write format = 2"],
    ),
    (
        "format-2-unread",
        "a key of format 2 that is not read yet",
        |d| second(d, "period = 40", "period = 40\nclipped = \"missing\""),
        &[
            "records[0].clipped",
            "`clipped` of format 2 is not read by this version",
        ],
    ),
    (
        "position-list",
        "a position of two numbers in format 1",
        |d| edit(d, "period = 40", "period = 40\nposition = [0.1, 0.2]"),
        &[
            "records[0].position",
            "`position = [...]` is a key of format 2; write format = 2",
        ],
    ),
    (
        "position-length",
        "a position of two numbers and one scheduling signal",
        |d| second(d, "period = 40", "period = 40\nposition = [0.1, 0.2]"),
        &["records[0].position", "2 numbers where p has 1"],
    ),
    (
        "text-names",
        "names beside a line of names",
        |d| {
            second(
                d,
                "[[records]]",
                "[text]\nheader = 1\nnames = [\"a\"]\n\n[[records]]",
            )
        },
        &["text.names", "write header = 0 with it"],
    ),
    (
        "text-separator",
        "a separator that no table has",
        |d| second(d, "[[records]]", "[text]\nseparator = \"|\"\n\n[[records]]"),
        &["unknown value `|`, expected one of `,`, `;`"],
    ),
    (
        "rows-turned",
        "rows from the last to the first",
        |d| second(d, "period = 40", "period = 40\nrows = [80, 1]"),
        &["records[0].rows", "write the first and the last row"],
    ),
    (
        "rows-too-many",
        "rows that the file does not have",
        |d| second(d, "period = 40", "period = 40\nrows = [1, 200]"),
        &["rows = [1, 200], but column `y1` has 120 rows"],
    ),
    (
        "columns-unasked",
        "a place for a column that no channel has",
        |d| second(d, "period = 40", "period = 40\ncolumns = { u3 = \"force\" }"),
        &[
            "records[0].columns",
            "`u3` is no channel of this bundle; nearest: `u1`, `u2`",
        ],
    ),
    (
        "format-text",
        "a version that is no number",
        |d| edit(d, "format = 1", "format = \"1\""),
        &[":1:10: ", "format \"1\" is not known"],
    ),
    (
        "format-missing",
        "no version",
        |d| edit(d, "format = 1\n", ""),
        &[":1:1: ", "missing key `format`"],
    ),
    (
        "name-number",
        "a name that is no text",
        |d| edit(d, "name = \"small\"", "name = 3"),
        &[":2:8: ", "expected a string"],
    ),
    (
        "text-open",
        "a text that is never closed",
        |d| edit(d, "name = \"small\"", "name = \"small"),
        &[":2:14: ", "invalid basic string"],
    ),
    (
        "rate-zero",
        "a sample rate of zero",
        |d| edit(d, "sample_rate = 20.0", "sample_rate = 0"),
        &[":3:15: ", "sample_rate: sample rate 0.0 Hz"],
    ),
    (
        "rate-negative",
        "a negative sample rate",
        |d| edit(d, "sample_rate = 20.0", "sample_rate = -1.0"),
        &[":3:15: ", "sample rate -1.0 Hz"],
    ),
    (
        "rate-nan",
        "a sample rate that is no number",
        |d| edit(d, "sample_rate = 20.0", "sample_rate = nan"),
        &[":3:15: ", "sample rate NaN Hz"],
    ),
    (
        "key-unknown",
        "a misspelt key",
        |d| edit(d, "sample_rate = 20.0", "sample_rat = 20.0"),
        &[":3:1: ", "unknown key `sample_rat`", "nearest: `sample_rate`"],
    ),
    (
        "group-unknown",
        "a misspelt channel group",
        |d| edit(d, "[channels.output]", "[channels.outputs]"),
        &[":5:11: ", "channels.outputs", "nearest: `output`"],
    ),
    (
        "group-key-unknown",
        "a misspelt key of a channel group",
        |d| edit(d, "units = [\"m\", \"rad\"]", "unit = [\"m\"]"),
        &[":7:1: ", "channels.output.unit", "nearest: `units`"],
    ),
    (
        "controller-key-unknown",
        "a misspelt key of the controller",
        |d| edit(d, "limit = 100.0", "limits = 100.0"),
        &[":23:1: ", "controller.limits", "nearest: `limit`"],
    ),
    (
        "record-key-unknown",
        "a misspelt key of a record",
        |d| edit(d, "period = 40", "perod = 40"),
        &[":32:1: ", "records[0].perod", "nearest: `period`"],
    ),
    (
        "injection-key-unknown",
        "a key that an injection does not have",
        |d| edit(d, "scale = [3.0]", "gain = [3.0]"),
        &[
            ":39:36: ",
            "records[1].injection.gain",
            "known here: columns, units, scale",
        ],
    ),
    (
        "columns-none",
        "an output group without columns",
        |d| edit(d, "[\"y1\", \"y2\"]", "[]"),
        &[":6:11: ", "channels.output.columns: no columns"],
    ),
    (
        "column-empty",
        "an empty column name",
        |d| edit(d, "[\"y1\", \"y2\"]", "[\"y1\", \"\"]"),
        &[":6:18: ", "channels.output.columns[1]", "empty"],
    ),
    (
        "column-twice",
        "a column listed twice",
        |d| edit(d, "[\"y1\", \"y2\"]", "[\"y1\", \"y1\"]"),
        &[
            ":6:18: ",
            "`y1` is already listed under channels.output.columns[0]",
        ],
    ),
    (
        "column-two-roles",
        "a column in two roles",
        |d| edit(d, "[\"u1\", \"u2\"]", "[\"u1\", \"y2\"]"),
        &[
            ":11:18: ",
            "`y2` is already listed under channels.output.columns[1]",
        ],
    ),
    (
        "units-length",
        "fewer units than columns",
        |d| edit(d, "units = [\"m\", \"rad\"]", "units = [\"m\"]"),
        &[":7:9: ", "channels.output.units: a list of 1 for 2 columns"],
    ),
    (
        "scale-length",
        "fewer scales than columns",
        |d| edit(d, "scale = [2.0, 1.0]", "scale = [2.0]"),
        &[":8:9: ", "channels.output.scale: a list of 1 for 2 columns"],
    ),
    (
        "scale-zero",
        "a scale of zero",
        |d| edit(d, "scale = [2.0, 1.0]", "scale = [2.0, 0.0]"),
        &[":8:15: ", "channels.output.scale[1]: scale 0 of column `y2`"],
    ),
    (
        "scale-infinite",
        "an infinite scale",
        |d| edit(d, "scale = [2.0, 1.0]", "scale = [inf, 1.0]"),
        &[":8:10: ", "scale inf of column `y1`"],
    ),
    (
        "scale-text",
        "a scale that is no list",
        |d| edit(d, "scale = [2.0, 1.0]", "scale = \"2\""),
        &[":8:9: ", "expected a list"],
    ),
    (
        "injection-scale-length",
        "more scales than columns of an injection",
        |d| edit(d, "scale = [3.0]", "scale = [3.0, 1.0]"),
        &[
            ":39:44: ",
            "records[1].injection.scale: a list of 2 for 1 columns",
        ],
    ),
    (
        "controller-not-causal",
        "a denominator that starts with zero",
        |d| edit(d, "denominator = [1.0, -0.9]", "denominator = [0.0, 1.0]"),
        &[":22:16: ", "controller.denominator[0][0]", "zero"],
    ),
    (
        "controller-empty",
        "an empty polynomial",
        |d| edit(d, "denominator = [1.0, -0.9]", "denominator = []"),
        &[":22:15: ", "controller.denominator[0]: an empty polynomial"],
    ),
    (
        "controller-text",
        "coefficients that are no numbers",
        |d| edit(d, "denominator = [1.0, -0.9]", "denominator = [\"a\"]"),
        &[":22:15: ", "one list of numbers a loop"],
    ),
    (
        "controller-missing",
        "a controller without denominator",
        |d| edit(d, "denominator = [1.0, -0.9]\n", ""),
        &[":19:1: ", "missing key `denominator`"],
    ),
    (
        "controller-loops",
        "polynomials for another number of loops",
        |d| edit(d, "[[1.0, -0.5], [2.0, 0.0]]", "[[1.0, -0.5]]"),
        &[":21:22: ", "a list of 1 polynomials for 2 inputs"],
    ),
    (
        "limit-negative",
        "a negative saturation",
        |d| edit(d, "limit = 100.0", "limit = -1"),
        &[":23:9: ", "controller.limit: limit -1"],
    ),
    (
        "geometry-row",
        "a matrix with a short row",
        |d| {
            edit(
                d,
                "motor_from_output = [[1.0, -0.5], [1.0, 0.5]]",
                "motor_from_output = [[1.0], [1.0, 0.5]]",
            )
        },
        &[
            ":27:22: ",
            "geometry.motor_from_output[0]",
            "a 2 x 2 matrix",
            "found 1 in this row",
        ],
    ),
    (
        "geometry-rows",
        "a matrix with too few rows",
        |d| edit(d, "[[1.0, 0.0], [1.0, 2.0]]", "[[1.0, 0.0]]"),
        &[":26:21: ", "geometry.force_from_input[0]", "found 1 in rows"],
    ),
    (
        "geometry-position",
        "a geometry that depends on a position that is not measured",
        |d| edit(d, "[channels.scheduling]\ncolumns = [\"p\"]\n", ""),
        &[":24:20: ", "exactly one scheduling signal"],
    ),
    (
        "kind-unknown",
        "an unknown kind of record",
        |d| edit(d, "kind = \"periodic\"", "kind = \"steady\""),
        &[":31:8: ", "`steady`", "`periodic`, `transient`, `response`"],
    ),
    (
        "use-unknown",
        "an unknown use of a record",
        |d| edit(d, "use = \"validation\"", "use = \"test\""),
        &[":38:7: ", "`test`", "`estimation` or `validation`"],
    ),
    (
        "period-missing",
        "a periodic record without period",
        |d| edit(d, "period = 40\n", ""),
        &[":29:1: ", "records[0]: a periodic record needs `period`"],
    ),
    (
        "period-short",
        "a period of one sample",
        |d| edit(d, "period = 40", "period = 1"),
        &[
            ":32:10: ",
            "records[0].period: `period` = 1; a period has at least 2",
        ],
    ),
    (
        "period-negative",
        "a negative period",
        |d| edit(d, "period = 40", "period = -40"),
        &[":32:10: ", "-40"],
    ),
    (
        "period-transient",
        "a period on a transient record",
        |d| edit(d, "kind = \"transient\"", "kind = \"transient\"\nperiod = 3"),
        &[":38:10: ", "`period` = 3 on a transient record"],
    ),
    (
        "rate-text",
        "a sample rate in words",
        |d| edit(d, "sample_rate = 20.0", "sample_rate = \"20 Hz\""),
        &[":3:15: ", "expected"],
    ),
    (
        "rate-tiny",
        "a sample rate whose inverse overflows",
        |d| edit(d, "sample_rate = 20.0", "sample_rate = 1e-310"),
        &[":3:15: ", "it must be finite and above zero"],
    ),
    (
        "rate-missing",
        "no sample rate",
        |d| edit(d, "sample_rate = 20.0\n", ""),
        &[":1:1: ", "missing key `sample_rate`"],
    ),
    (
        "channels-missing",
        "no input group",
        |d| edit(d, "[channels.input]\ncolumns = [\"u1\", \"u2\"]\n", ""),
        &["missing key `input`"],
    ),
    (
        "columns-missing",
        "a group that does not name its columns",
        |d| edit(d, "columns = [\"u1\", \"u2\"]\n", ""),
        &["missing key `columns`"],
    ),
    (
        "columns-numbers",
        "column names that are numbers",
        |d| edit(d, "columns = [\"u1\", \"u2\"]", "columns = [1, 2]"),
        &[":11:12: ", "expected a string"],
    ),
    (
        "key-twice",
        "one key twice",
        |d| edit(d, "name = \"small\"\n", "name = \"small\"\nname = \"large\"\n"),
        &[":3:1: ", "duplicate key"],
    ),
    (
        "reference-missing",
        "a reference in a group that has fewer signals than loops",
        |d| edit(d, "columns = [\"r1\", \"r2\"]", "columns = [\"r1\"]"),
        &[
            ":19:1: controller: ",
            "2 loops (one an input) need as many references; the bundle has 1",
        ],
    ),
    (
        "controller-nan",
        "a coefficient that is no number",
        |d| edit(d, "denominator = [1.0, -0.9]", "denominator = [1.0, nan]"),
        &[
            ":22:21: controller.denominator[0][1]: ",
            "NaN is not a finite number",
        ],
    ),
    (
        "limit-zero",
        "a saturation of zero",
        |d| edit(d, "limit = 100.0", "limit = 0.0"),
        &[":23:9: controller.limit: limit 0"],
    ),
    (
        "geometry-many",
        "more matrices than a polynomial of degree two has",
        |d| {
            edit(
                d,
                "[[0.5, 0.0], [0.0, 0.0]]",
                "[[0, 0], [0, 0]], [[0, 0], [0, 0]], [[0, 0], [0, 0]]",
            )
        },
        &["4 matrices; give [T0], [T0, T1] or [T0, T1, T2]"],
    ),
    (
        "geometry-infinite",
        "an infinite entry of a matrix",
        |d| edit(d, "[[1.0, -0.5], [1.0, 0.5]]", "[[1.0, inf], [1.0, 0.5]]"),
        &["geometry.motor_from_output[0][1]: inf is not a finite number"],
    ),
    (
        "geometry-half",
        "a geometry without its second matrix",
        |d| edit(d, "motor_from_output = [[1.0, -0.5], [1.0, 0.5]]\n", ""),
        &["missing key `motor_from_output`"],
    ),
    (
        "record-file-missing",
        "a record without file",
        |d| edit(d, "file = \"records/grid.csv\"\n", ""),
        &[":29:1: missing key `file`"],
    ),
    (
        "record-use-missing",
        "a record without use",
        |d| edit(d, "use = \"estimation\"\n", ""),
        &[":29:1: missing key `use`"],
    ),
    (
        "position-nan",
        "a position that is no number",
        |d| edit(d, "period = 40", "period = 40\nposition = nan"),
        &[":33:12: records[0].position: NaN is not a finite number"],
    ),
    (
        "period-fraction",
        "a period that is no whole number",
        |d| edit(d, "period = 40", "period = 40.5"),
        &[":32:10: ", "expected"],
    ),
];
