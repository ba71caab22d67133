//! `lpv new` of tables with frequency responses: names say the parts, and nothing is left to fill in but what no file says.

use crate::common::{Desk, has_modes};
use lpv_core::num_complex::Complex;
use std::f64::consts::TAU;
use std::fmt::Write as _;

type C64 = Complex<f64>;

const MODES: [(f64, f64, [f64; 2]); 2] = [(20.0, 0.01, [1.0, 0.6]), (55.0, 0.02, [0.7, -1.1])];

/// From one place to another of a body on springs with two modes.
fn value(hz: f64, to: usize, from: usize) -> C64 {
    let s = C64::new(0.0, TAU * hz);
    let mode = |(hz, damping, shape): &(f64, f64, [f64; 2])| {
        let w = TAU * hz;
        shape[to] * shape[from] / (s * s + 2.0 * damping * w * s + w * w)
    };
    MODES.iter().map(mode).sum()
}

/// A table with this first line, of 200 lines to 100 Hz.
fn table(first: &str, separator: &str, row: impl Fn(f64) -> Vec<f64>) -> String {
    let mut text = format!("{first}\n");
    for k in 1..=200 {
        let all: Vec<String> = row(0.5 * f64::from(k)).iter().map(|v| format!("{v:e}")).collect();
        let line = all.join(separator);
        let line = if separator == ";" {
            line.replace('.', ",")
        } else {
            line
        };
        let _ = writeln!(text, "{line}");
    }
    text
}

#[test]
fn an_analyser_names_its_columns_in_many_ways() {
    let one = |f: f64| value(f, 0, 0);
    let decibel = |v: C64| 20.0 * v.norm().log10();
    let all = |to: usize, f: f64| [value(f, to, 0), value(f, to, 1)];
    let cases: [(&str, String, &[&str]); 6] = [
        (
            "bode",
            table("Frequency (Hz),Magnitude (dB),Phase (deg)", ",", |f| {
                vec![f, decibel(one(f)), one(f).arg().to_degrees()]
            }),
            &["y1/u1 dB = `Magnitude (dB)`", "fill in: quantity"],
        ),
        (
            "units",
            table("f [Hz];Betrag [m/N];Phase [rad]", ";", |f| {
                vec![f, one(f).norm(), one(f).arg()]
            }),
            &["y1/u1 rad", "a response of displacement/force"],
        ),
        (
            "turns",
            table("omega (rad/s)\tG real\tG imag\tcoherence", "\t", |f| {
                vec![TAU * f, one(f).re, one(f).im, 1.0]
            }),
            &[
                "omega = `omega (rad/s)`",
                "sample_rate = 2000",
                "left aside: a coherence",
            ],
        ),
        (
            "bare",
            table("freq,gain,phase", ",", |f| {
                vec![f, decibel(one(f)), one(f).arg().to_degrees()]
            }),
            &[
                "`gain` is in dB: values go below zero",
                "`phase` is in deg, by the range",
            ],
        ),
        (
            "gravities",
            table("Frequency [Hz],Real [g/N],Imag [g/N]", ",", |f| {
                let g = one(f) * -(TAU * f).powi(2) / 9.80665;
                vec![f, g.re, g.im]
            }),
            &["a response of acceleration/force"],
        ),
        (
            "two",
            table(
                "frequency,H11_re,H11_im,H12_re,H12_im,H21_re,H21_im,H22_re,H22_im",
                ",",
                |f| {
                    let parts = [all(0, f), all(1, f)].concat();
                    std::iter::once(f)
                        .chain(parts.iter().flat_map(|v| [v.re, v.im]))
                        .collect()
                },
            ),
            &["y2/u1 re = `H21_re`", "y1/u2 im = `H12_im`"],
        ),
    ];
    for (name, text, parts) in cases {
        let desk = Desk::new();
        desk.write(&format!("lab/{name}.csv"), text);
        let said = desk.done(&format!("new lab/{name}.csv"));
        for part in parts {
            assert!(said.contains(part), "{name}: {part} in {said}");
        }
        desk.done("inspect lab");
        has_modes(&desk, "lab", MODES.map(|(hz, ..)| hz));
    }
}

/// Below the first mode a phase in degrees stays within a turn in radians: all files together tell, in any order.
#[test]
fn phases_of_all_files_have_one_unit() {
    for files in [["low", "whole"], ["whole", "low"]] {
        let desk = Desk::new();
        for (k, file) in files.iter().enumerate() {
            let most = if *file == "low" { 0.1 } else { 1.0 };
            let text = table("f,gain,phase", ",", |f| {
                let v = value(most * f, 0, 0);
                vec![most * f, v.norm(), v.arg().to_degrees()]
            });
            desk.write(&format!("lab/{k}.csv"), text);
        }
        let said = desk.done("new lab/0.csv lab/1.csv");
        assert!(said.contains("`phase` is in deg, by the range"), "{said}");
        assert!(said.contains("`gain` is linear, not in dB"), "{said}");
        let text = std::fs::read_to_string(desk.path("lab").join("experiment.toml")).unwrap();
        assert!(text.contains("\"y1/u1 deg\" = \"phase\""), "{text}");
    }
}

#[test]
fn what_is_no_whole_response_is_refused_by_name() {
    let one = |f: f64| value(f, 0, 0);
    for (first, row, parts) in [
        (
            "Frequency (Hz),Magnitude (dB)",
            2,
            ["Magnitude (dB)", "no magnitude with its phase"],
        ),
        (
            "Frequency (kHz),Magnitude (dB),Phase (deg)",
            3,
            ["kHz", "give it in Hz"],
        ),
        (
            "frequency,H11_re,H11_im,H22_re,H22_im",
            5,
            ["y2/u1", "there is nothing"],
        ),
        ("frequency,re,im,H1 real,H1 imag", 5, ["`re`", "says no channel"]),
    ] {
        let desk = Desk::new();
        let text = table(first, ",", |f| {
            [f, one(f).re, one(f).im, 1.0, 2.0][..row].to_vec()
        });
        desk.write("lab/a.csv", text);
        let said = desk.refused("new lab/a.csv");
        for part in parts {
            assert!(said.contains(part), "{part} in {said}");
        }
        assert!(said.contains("kind = \"response\""), "{said}");
    }
}
