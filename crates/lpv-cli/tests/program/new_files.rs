//! `lpv new`: what a file says besides its signals, and files of instruments.

use crate::common::{Desk, PERIOD, csv, has_modes, mode_record};
use experiment_data::mat::{Array, Value, write_values};
use experiment_data::{Bundle, Text};
use lpv_core::num_complex::Complex;
use lpv_core::{Purpose, RecordKind};
use std::f64::consts::TAU;

fn array(rows: usize, data: &[f64]) -> Value {
    Value::Array(Array {
        shape: vec![rows as u64, (data.len() / rows) as u64],
        data: data.to_vec(),
    })
}

fn named(name: &str, value: Value) -> (String, Value) {
    (name.to_owned(), value)
}

#[test]
fn settings_tell_the_rate() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let signals = || [named("u", array(u.len(), &u)), named("y", array(y.len(), &y))];
    for (name, value, rate) in [
        ("Fs", 10.0, 10.0),
        ("Ts", 0.1, 10.0),
        ("dt", 2.5e-5, 4e4),
        ("sample_rate", 123.0, 123.0),
    ] {
        let mut values = signals().to_vec();
        values.push(named(name, array(1, &[value])));
        values.push(named("gain", array(1, &[7.0])));
        desk.write("mat/a.mat", write_values(&values).unwrap());
        let said = desk.done("new mat/a.mat --force");
        assert!(said.contains(&format!("as `{name}` = {value} says")), "{said}");
        let bundle = Bundle::open(&desk.path("mat")).unwrap();
        assert_eq!(bundle.description().sample_rate_hz, rate);
        desk.done("inspect mat");
    }
    // Two settings that contradict each other are asked about, and a setting decides the unit of a time.
    let mut values = signals().to_vec();
    values.push(named("fs", array(1, &[1000.0])));
    values.push(named("Ts", array(1, &[0.01])));
    desk.write("two/a.mat", write_values(&values).unwrap());
    let said = desk.done("new two/a.mat");
    for part in [
        "`fs` = 1000 says 1000 Hz",
        "`Ts` = 0.01 says 100 Hz",
        "lpv new two/a.mat --sample-rate HZ --force",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let steps: Vec<f64> = (0..u.len()).map(|k| k as f64).collect();
    let mut values = signals().to_vec();
    values.push(named("t", array(u.len(), &steps)));
    values.push(named("fs", array(1, &[1000.0])));
    desk.write("unit/a.mat", write_values(&values).unwrap());
    let said = desk.done("new unit/a.mat");
    assert!(
        said.contains("sample_rate = 1000 from the column `t` in ms"),
        "{said}"
    );
    // In a table: alone in its first row, or above the names.
    let rows = csv(&[("u", &u), ("y", &y)]);
    let mut lines = rows.lines();
    let mut table = format!("{},Ts\n", lines.next().unwrap());
    table += &format!("{},0.1\n", lines.next().unwrap());
    lines.for_each(|line| table += &format!("{line},\n"));
    desk.write("table/a.csv", table);
    assert!(
        desk.done("new table/a.csv")
            .contains("sample_rate = 10, as `Ts` = 0.1 says")
    );
    desk.done("inspect table");
    for line in [
        "# sample rate: 0.01 kHz",
        "rig 3, dt=100ms, N=7",
        "Abtastrate,10",
        "Ts,0.1s",
    ] {
        desk.write("above/a.csv", format!("{line}\n{rows}"));
        let said = desk.done("new above/a.csv --force");
        assert!(said.contains("sample_rate = 10, as the line"), "{line}: {said}");
        desk.done("inspect above");
    }
    // Milliseconds without a word are asked about.
    let mut values = signals().to_vec();
    values.push(named("Ts", array(1, &[250.0])));
    desk.write("slow/a.mat", write_values(&values).unwrap());
    let said = desk.done("new slow/a.mat");
    assert!(
        said.contains("`Ts` = 250 says no unit: 0.004 Hz, or 4 Hz"),
        "{said}"
    );
}

/// A number in each file that is named after a place is the place; what is the same in all, or named after something else, is not.
#[test]
fn a_number_in_each_file_is_its_place() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let places = [-0.3, 0.0, 1.25e-3];
    for (k, place) in places.iter().enumerate() {
        let numbers = [
            ("x_pos", *place),
            ("y0", 2.0),
            ("temperature", 20.0 + k as f64),
            ("fs", 10.0),
        ];
        let mut values = vec![named("u", array(u.len(), &u)), named("y", array(y.len(), &y))];
        values.extend(numbers.map(|(name, value)| named(name, array(1, &[value]))));
        desk.write(&format!("at/m{k}.mat"), write_values(&values).unwrap());
    }
    let said = desk.done("new at/m0.mat at/m1.mat at/m2.mat");
    assert!(
        said.contains("`x_pos`, a single number in each file, is the position"),
        "{said}"
    );
    let bundle = Bundle::open(&desk.path("at")).unwrap();
    for (k, place) in places.iter().enumerate() {
        let position = bundle.load(k).unwrap().position.unwrap();
        assert_eq!(position[0], *place);
    }
}

#[test]
fn two_clocks_in_one_file_are_asked_about() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let steps = |step: f64| (0..u.len()).map(|k| k as f64 * step).collect::<Vec<f64>>();
    let data = [steps(0.001), u.clone(), y.clone()].concat();
    let log = Value::Struct(vec![
        named("time", array(1, &steps(0.004))),
        named("pos", array(1, &y)),
    ]);
    let values = [named("data", array(u.len(), &data)), named("rec", log)];
    desk.write("two/m.mat", write_values(&values).unwrap());
    let said = desk.done("new two/m.mat --input data(:,2)");
    for part in [
        "`rec.time` has steps of 0.004, `data(:,1)` of 0.001",
        "--sample-rate HZ --force",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    assert!(
        desk.text("two/experiment.toml")
            .contains("# FILL IN: 250 or 1000")
    );
    let said = desk.done("new two/m.mat --input data(:,2) --output data(:,3) --sample-rate 1000 --force");
    assert!(!said.contains("fill in"), "{said}");
    desk.done("inspect two");
}

#[test]
fn names_tell_what_is_held_out() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let half = u.len() / 2 / PERIOD * PERIOD;
    let (first, second) = (
        |x: &[f64]| x[..half].to_vec(),
        |x: &[f64]| x[half..2 * half].to_vec(),
    );
    let columns = [first(&u), second(&u), first(&y), second(&y)];
    let names = ["uEst", "uVal", "yEst", "yVal"];
    let table: Vec<(&str, &[f64])> = names
        .iter()
        .zip(&columns)
        .map(|(n, c)| (*n, c.as_slice()))
        .collect();
    desk.write("table/a.csv", csv(&table));
    // Of a MAT file the lengths may differ.
    let values = [
        named("u", array(u.len(), &u)),
        named("y", array(y.len(), &y)),
        named("u_val", array(half, &columns[1])),
        named("y_val", array(half, &columns[3])),
        named("Ts", array(1, &[0.1])),
    ];
    desk.write("mat/a.mat", write_values(&values).unwrap());
    for (folder, file, rows) in [("table", "a.csv", half), ("mat", "a.mat", u.len())] {
        let said = desk.done(&format!("new {folder}/{file} --sample-rate 10"));
        assert!(said.contains("are held out"), "{said}");
        let bundle = Bundle::open(&desk.path(folder)).unwrap();
        let records: Vec<_> = bundle.records().collect::<Result<_, _>>().unwrap();
        assert_eq!(
            records.iter().map(|r| r.purpose).collect::<Vec<_>>(),
            [Purpose::Estimation, Purpose::Validation]
        );
        assert_eq!(records[0].inputs.columns[0], u[..rows]);
        assert_eq!(records[1].inputs.columns[0], columns[1]);
        assert_eq!(records[1].outputs.columns[0], columns[3]);
        assert_ne!(records[0].name, records[1].name);
        desk.done(&format!("inspect {folder}"));
    }
    // The same samples are not fitted and held out at once.
    let text = desk.text("table/experiment.toml").replace("Val", "Est");
    desk.write("table/experiment.toml", text);
    let said = desk.refused("inspect table");
    assert!(said.contains("is already records[0]"), "{said}");
}

#[test]
fn scattered_stamps_state_their_error() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let t: Vec<f64> = (0..u.len())
        .map(|k| (k as f64 + 0.1 * (k as f64 * 2.3).sin()) * 1e-3)
        .collect();
    desk.write("data/a.csv", csv(&[("t", &t), ("u", &u), ("y", &y)]));
    let said = desk.done("new data/a.csv");
    // A tenth of a step: 0.01 / (2 pi 1e-4 s) is 16 Hz.
    assert!(
        said.contains("scatter by up to 10 % of a step") && said.contains("1 % on a sine of 15.9"),
        "{said}"
    );
}

/// A data set 58 in text, of this function and kind of numbers at even places: kinds and units of its axes, and lines of numbers.
fn data_set(
    [function, numbers]: [u8; 2],
    [node, excited]: [u8; 2],
    (start, step): (f64, f64),
    axes: [(u8, &str); 3],
    points: (usize, Vec<&[f64]>),
) -> String {
    let mut text = format!("    -1\n    58\n{}", "NONE\n".repeat(5));
    text += &format!(
        "{function:5}         0    1         0       NONE{node:10}   3       NONE{excited:10}   3\n"
    );
    let (count, lines) = points;
    text += &format!(
        "{numbers:10}{count:10}{:10}{start:13.5}{step:13.5}{:13.5}\n",
        1, 0.0
    );
    for (kind, unit) in axes.into_iter().chain([(0, "NONE")]) {
        text += &format!("{kind:10}    0    0    0 NONE                 {unit}\n");
    }
    for line in lines {
        let cells: Vec<String> = line.iter().map(|v| format!("{v:20.11e}")).collect();
        text += &format!("{}\n", cells.concat());
    }
    text + "    -1\n"
}

/// A time history of samples every 0.1 s.
fn function(quantity: u8, unit: &str, node: u8, data: &[f64]) -> String {
    let axes = [(17, "s"), (quantity, unit), (0, "NONE")];
    let points = (data.len(), data.chunks(4).collect());
    data_set([1, 4], [node, 1], (0.0, 0.1), axes, points)
}

#[test]
fn a_universal_file_needs_no_edit() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    desk.write("data/a.uff", function(13, "N", 1, &u) + &function(8, "m", 7, &y));
    let said = desk.done("new data/a.uff");
    for part in [
        "`abscissa increment` = 0.1",
        "input: force 1+Z",
        "output: displacement 7+Z",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let bundle = Bundle::open(&desk.path("data")).unwrap();
    assert_eq!(bundle.description().channels.output.units, ["m"]);
    assert_eq!(bundle.description().text, None::<Text>);
    let record = bundle.load(0).unwrap();
    assert_eq!(record.kind, RecordKind::Periodic { period: PERIOD });
    for (a, b) in record.outputs.columns[0].iter().zip(&y) {
        assert!((a - b).abs() <= 1e-11 * b.abs());
    }
    desk.done("identify data -o model.json");
}

/// The receptance of a place to a force, lines of 0.5 Hz.
fn response(node: u8, excited: u8, values: &[Complex<f64>]) -> String {
    let axes = [(18, "Hz"), (8, "m"), (13, "N")];
    let pairs: Vec<[f64; 2]> = values.iter().map(|v| [v.re, v.im]).collect();
    let points = (values.len(), pairs.iter().map(<[f64; 2]>::as_slice).collect());
    data_set([4, 6], [node, excited], (0.5, 0.5), axes, points)
}

/// Responses of two places to one, which is one of them: a draft without a line to fill in, and a model with both modes.
#[test]
fn responses_of_a_universal_file_need_no_edit() {
    let desk = Desk::new();
    let modes = [(20.0, 0.01, [1.0, 0.6]), (55.0, 0.02, [0.7, -1.1])];
    let values = |place: usize| -> Vec<Complex<f64>> {
        let at = |k: usize| -> Complex<f64> {
            let s = Complex::new(0.0, TAU * 0.5 * (k + 1) as f64);
            let mode = |(hz, damping, shape): &(f64, f64, [f64; 2])| {
                let w = TAU * hz;
                shape[place] * shape[0] / (s * s + 2.0 * damping * w * s + w * w)
            };
            modes.iter().map(mode).sum()
        };
        (0..200).map(at).collect()
    };
    desk.write(
        "lab/a.uff",
        response(7, 7, &values(0)) + &response(12, 7, &values(1)),
    );
    let said = desk.done("new lab/a.uff");
    for part in [
        "y1 = \"7+Z\", y2 = \"12+Z\"",
        "input: u1 = \"7+Z\"",
        "sample_rate = 2000",
        "displacement/force",
        "next: look through it",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    desk.done("inspect lab");
    has_modes(&desk, "lab", modes.map(|(hz, ..)| hz));
    // Two files are two places, which only the user knows; another pair of channels is refused by name.
    desk.write(
        "lab/x_0.2.uff",
        response(7, 7, &values(0)) + &response(12, 7, &values(1)),
    );
    desk.write(
        "lab/x_0.4.uff",
        response(7, 7, &values(0)) + &response(12, 7, &values(1)),
    );
    let said = desk.done("new lab/x_0.2.uff lab/x_0.4.uff --force");
    assert!(said.contains("fill in: position"), "{said}");
    assert!(
        desk.text("lab/experiment.toml")
            .contains("# position = 0.4  # FILL IN")
    );
    desk.write(
        "lab/b.uff",
        response(7, 7, &values(0)) + &response(12, 9, &values(1)),
    );
    let said = desk.refused("new lab/b.uff --force");
    assert!(said.contains("0 frequency responses of 7+Z to 9+Z"), "{said}");
}

/// Moves that resemble themselves do so after another time in every record; an excitation has one period, which a move beside it does not take
/// away.
#[test]
fn one_excitation_has_one_period() {
    let desk = Desk::new();
    let sines = RecordKind::Periodic { period: 300 };
    let moves = RecordKind::Transient;
    for (name, periods, kinds, told) in [
        ("moves", &[300, 317][..], &[moves; 2][..], Some("300 to 317")),
        ("sines", &[300, 300], &[sines; 2], None),
        ("both", &[300, 317, 300], &[sines, moves, sines], Some("317")),
        ("tie", &[300, 300, 317, 317], &[moves; 4], Some("300 to 317")),
        ("one", &[300], &[sines], None),
    ] {
        for (number, period) in periods.iter().enumerate() {
            let wave = |shift: f64| -> Vec<f64> {
                (0..960)
                    .map(|k| TAU * f64::from(k) / f64::from(*period))
                    .map(|turn| (turn + shift).sin() + 0.5 * (3.0 * turn + 2.0 * shift).cos())
                    .collect()
            };
            let t: Vec<f64> = (0..960).map(|k| 1e-3 * f64::from(k)).collect();
            desk.write(
                &format!("{name}/{number}.csv"),
                csv(&[("t", &t), ("u", &wave(0.0)), ("y", &wave(1.0))]),
            );
        }
        let files: Vec<String> = (0..periods.len()).map(|n| format!("{name}/{n}.csv")).collect();
        let said = desk.done(&format!("new {}", files.join(" ")));
        let bundle = Bundle::open(&desk.path(name)).unwrap();
        let records = bundle.description().records.iter();
        let found: Vec<RecordKind> = records.map(|r| r.record_kind()).collect();
        assert_eq!(found, kinds, "{said}");
        match told {
            Some(after) => {
                let sentence = format!("repeat after {after} samples are taken for moves");
                assert!(said.contains(&sentence), "{said}");
            }
            None => assert!(!said.contains("taken for moves"), "{said}"),
        }
    }
}

/// Groups that hold the same signals: names tell runs and what is held out, and where they do not, the user does.
#[test]
fn groups_are_runs_or_axes() {
    let (u, y) = mode_record();
    let half = u.len() / 2 / PERIOD * PERIOD;
    let of = |from: usize| {
        let part = |x: &[f64]| array(half, &x[from..from + half]);
        Value::Struct(vec![named("u", part(&u)), named("y", part(&y))])
    };
    for (names, options, inputs, purposes) in [
        (
            ["train", "test"],
            "",
            1,
            &[Purpose::Estimation, Purpose::Validation][..],
        ),
        (["test1", "test2"], "", 1, &[Purpose::Estimation; 2]),
        (["a", "b"], "--groups runs", 1, &[Purpose::Estimation; 2]),
        (
            ["x000mm", "x100mm"],
            "--groups runs",
            1,
            &[Purpose::Estimation; 2],
        ),
        (["a", "b"], "--groups axes", 2, &[Purpose::Estimation]),
        (["axis1", "axis2"], "", 2, &[Purpose::Estimation]),
    ] {
        let desk = Desk::new();
        let values = [
            named(names[0], of(0)),
            named(names[1], of(half)),
            named("fs", array(1, &[10.0])),
        ];
        desk.write("d/a.mat", write_values(&values).unwrap());
        if !options.is_empty() {
            let said = desk.done("new d/a.mat");
            for part in ["hold the same signals", "--groups runs", "--groups axes"] {
                assert!(said.contains(part), "{part} in {said}");
            }
        }
        let said = desk.done(&format!("new d/a.mat {options} --force"));
        assert!(!said.contains("fill in"), "{names:?}: {said}");
        let bundle = Bundle::open(&desk.path("d")).unwrap();
        let records: Vec<_> = bundle.records().collect::<Result<_, _>>().unwrap();
        assert_eq!(
            records.iter().map(|r| r.purpose).collect::<Vec<_>>(),
            purposes,
            "{names:?}"
        );
        assert!(
            records.iter().all(|r| r.inputs.channels() == inputs),
            "{names:?}: {said}"
        );
        assert_eq!(
            records[records.len() - 1].inputs.columns[inputs - 1],
            u[half..2 * half]
        );
    }
}

/// What is commanded of an input and what is measured of it are one input; a table of frequencies has no samples.
#[test]
fn what_acts_is_the_input_and_a_frequency_is_no_time() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let wanted: Vec<f64> = u.iter().map(|u| 1.02 * u + 1e-3).collect();
    let time: Vec<f64> = (0..u.len()).map(|k| 0.1 * k as f64).collect();
    desk.write(
        "c/a.csv",
        csv(&[
            ("t [s]", &time),
            ("current_cmd", &wanted),
            ("current_act", &u),
            ("pos", &y),
        ]),
    );
    let said = desk.done("new c/a.csv");
    assert!(said.contains("`current_cmd` is left aside"), "{said}");
    let channels = &Bundle::open(&desk.path("c"))
        .unwrap()
        .description()
        .channels
        .clone();
    assert_eq!(channels.input.columns, ["current_act"]);
    let frequencies: Vec<f64> = (0..200).map(|k| 0.5 + 0.25 * f64::from(k)).collect();
    let part = |phase: f64| {
        frequencies
            .iter()
            .map(|f| (f + phase).sin())
            .collect::<Vec<f64>>()
    };
    desk.write(
        "f/a.csv",
        csv(&[("freq", &frequencies), ("P11", &part(0.0)), ("P12", &part(1.0))]),
    );
    let said = desk.refused("new f/a.csv");
    assert!(
        said.contains("`freq` goes one way") && said.contains("y/u re"),
        "{said}"
    );
}
