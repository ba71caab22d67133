use super::Row;
use super::small::{ROWS, TOML, csv, csv_with, edit, grid, grid_column, put, value, write};

pub(super) const CASES: &[Row] = &[
    (
        "nan",
        "values that are not numbers",
        |d| grid_column(d, "u1", |k, v| if k == 4 || k == 11 { f64::NAN } else { v }),
        &["column `u1` is NaN or infinite in rows 5, 12 (lines 6, 13), 2 in all"],
    ),
    (
        "nan-behind-blank-lines",
        "rows and lines that part company",
        |d| {
            let cell = |c: &str, k, v: f64| {
                if (c, k) == ("u1", 4) {
                    "nan".into()
                } else {
                    v.to_string()
                }
            };
            grid(d, csv_with(cell).replacen('\n', "\n\n\n", 1));
        },
        &["rows 5 (lines 8)"],
    ),
    (
        "infinite",
        "an infinite value",
        |d| grid_column(d, "r2", |k, v| if k == 0 { f64::NEG_INFINITY } else { v }),
        &["column `r2` is NaN or infinite", "rows 1 (lines 2)"],
    ),
    (
        "infinite-by-scale",
        "a value that overflows when it is scaled",
        |d| grid_column(d, "y1", |k, v| if k == 3 { 1.5e308 } else { v }),
        &["column `y1` is NaN or infinite", "rows 4"],
    ),
    (
        "nan-everywhere",
        "a sensor that was not connected",
        |d| grid_column(d, "p", |_, _| f64::NAN),
        &["column `p` is NaN or infinite", "120 in all", "9, 10, ... (lines"],
    ),
    (
        "periods-few",
        "fewer than two periods",
        |d| edit(d, "period = 40", "period = 61"),
        &["120 samples are fewer than two periods of 61"],
    ),
    (
        "periods-huge",
        "a period that no computer can count to",
        |d| edit(d, "period = 40", "period = 9223372036854775807"),
        &["120 samples are fewer than two periods of 9223372036854775807"],
    ),
    (
        "periods-partial",
        "a last period that is not complete",
        |d| edit(d, "period = 40", "period = 50"),
        &["120 samples are no multiple of the period 50: 20 left over"],
    ),
    (
        "scheduling-ramp",
        "a position that moves during a periodic record",
        |d| grid_column(d, "p", |k, v| v + 0.01 * k as f64 / ROWS as f64),
        &[
            "scheduling column `p` moves from 0.25 to 0.25991",
            "taken as constant",
        ],
    ),
    (
        "scheduling-through-zero",
        "a position that swings about zero",
        |d| grid_column(d, "p", |k, _| 1e-3 * value("y1", k)),
        &["scheduling column `p` moves"],
    ),
    (
        "scheduling-far-from-zero",
        "a position that moves, its zero far away",
        |d| {
            grid_column(d, "p", |k, _| 1e6 + (k as f64 / 20.0).sin());
            let far = |c: &str, _, v: f64| if c == "p" { 1e6 } else { v }.to_string();
            put(d, "records/move.csv", csv_with(far));
        },
        &[
            "scheduling column `p` moves from 999999.",
            "to 1000000.",
            "`position`",
        ],
    ),
    (
        "position-contradicts",
        "a position that the column contradicts",
        |d| edit(d, "period = 40", "period = 40\nposition = 0.3"),
        &["`position` = 0.3, but the scheduling column `p` has the mean 0.25"],
    ),
    (
        "output-dead",
        "an output that is constant",
        |d| grid_column(d, "y2", |_, _| 0.5),
        &["column `y2` is constant, 0.5 in every row"],
    ),
    (
        "input-dead",
        "an input that is constant",
        |d| grid_column(d, "u1", |_, _| 0.0),
        &["column `u1` is constant, 0 in every row"],
    ),
    (
        "output-clipped",
        "an output beyond its range (scaled by 2)",
        |d| grid_column(d, "y1", |_, v| v.min(0.25)),
        &["column `y1` is clipped", "extreme value 0.5"],
    ),
    (
        "transient-clipped",
        "a motion that runs into a limit",
        |d| {
            let slow = |k: usize| 5.0 * (std::f64::consts::TAU * k as f64 / ROWS as f64).sin();
            let cut = |c: &str, k, v: f64| {
                if c == "y1" {
                    (slow(k) + 0.3 * v).min(2.0)
                } else {
                    v
                }
            };
            write(d);
            put(
                d,
                "records/move.csv",
                csv_with(|c, k, v| cut(c, k, v).to_string()),
            );
        },
        &["move.csv (records[1]): column `y1` is clipped"],
    ),
    (
        "transient-dead",
        "an output that is constant in a motion",
        |d| {
            write(d);
            let zero = |c: &str, _, v: f64| if c == "y1" { "0".to_owned() } else { v.to_string() };
            put(d, "records/move.csv", csv_with(zero));
        },
        &["move.csv (records[1]): column `y1` is constant"],
    ),
    (
        "injection-missing",
        "a signal of one test that its file does not have",
        |d| {
            edit(d, "columns = [\"pulse\"]", "columns = [\"pulses\"]");
            put(d, "records/grid.csv", csv());
            assert!(TOML.contains("pulse"));
        },
        &["move.csv (records[1]): no column `pulses` among the 8 of the file; nearest: `pulse`"],
    ),
];
