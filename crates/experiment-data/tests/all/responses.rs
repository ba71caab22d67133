//! Measured frequency responses in every kind of file: what was written by hand is what is read.

use experiment_data::{Bundle, MeasuredResponse, ResponseQuantity, Spread};
use lpv_core::Position;
use lpv_core::num_complex::Complex;
use npyz::zip::ZipWriter;
use npyz::zip::write::FileOptions;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::io::{Cursor, Write};
use std::path::Path;
use tempfile::TempDir;

type C64 = Complex<f64>;

/// A response with its frequencies: entries by line, output, input.
#[derive(Debug, Clone)]
struct Truth {
    lines: usize,
    outputs: usize,
    inputs: usize,
    frequencies: Vec<f64>,
    entries: Vec<C64>,
}

impl Truth {
    fn at(&self, k: usize, i: usize, j: usize) -> C64 {
        self.entries[(k * self.outputs + i) * self.inputs + j]
    }
    /// All indices, the first of `[k, i, j]` the fastest.
    fn first_fastest(&self) -> Vec<C64> {
        let mut all = Vec::new();
        for j in 0..self.inputs {
            for i in 0..self.outputs {
                all.extend((0..self.lines).map(|k| self.at(k, i, j)));
            }
        }
        all
    }
    fn toml(&self, file: &str, more: &str) -> String {
        let names = |letter: &str, n: usize| {
            (0..n)
                .map(|k| format!("\"{letter}{k}\""))
                .collect::<Vec<_>>()
                .join(", ")
        };
        format!(
            "format = 2\nname = \"responses\"\nsample_rate = 1e4\n[channels.output]\ncolumns = [{}]\n[channels.input]\ncolumns = [{}]\n\
             [[records]]\nfile = \"{file}\"\nkind = \"response\"\nuse = \"estimation\"\nposition = 0.5\n{more}\n",
            names("y", self.outputs),
            names("u", self.inputs)
        )
    }
}

fn truth() -> impl Strategy<Value = Truth> {
    let sizes = (2..9_usize, 1..4_usize, 1..4_usize);
    sizes.prop_flat_map(|(lines, outputs, inputs)| {
        let number = (-1.0..1.0_f64, -12..12_i32).prop_map(|(m, e)| (m + 1.5) * 10f64.powi(e));
        let entry = (number, -1.0..1.0_f64).prop_map(|(re, turn)| C64::new(re, re * turn));
        let steps = proptest::collection::vec(0.01..100.0_f64, lines);
        (steps, proptest::collection::vec(entry, lines * outputs * inputs)).prop_map(
            move |(steps, entries)| Truth {
                lines,
                outputs,
                inputs,
                frequencies: steps
                    .iter()
                    .scan(0.0, |f, step| {
                        *f += step;
                        Some(*f)
                    })
                    .collect(),
                entries,
            },
        )
    })
}

fn load(dir: &Path) -> MeasuredResponse {
    Bundle::open(dir).unwrap().load_response(0).unwrap()
}

fn check(truth: &Truth, found: &MeasuredResponse, slack: f64) {
    let near = |a: f64, b: f64| (a - b).abs() <= slack * b.abs();
    assert_eq!(found.position, Some(Position::from(0.5)));
    assert_eq!(
        (found.frf.outputs(), found.frf.inputs()),
        (truth.outputs, truth.inputs)
    );
    assert_eq!(found.frf.len(), truth.lines);
    for (k, f) in found.frf.frequencies_hz().iter().enumerate() {
        assert!(near(*f, truth.frequencies[k]), "{f}");
        for i in 0..truth.outputs {
            for j in 0..truth.inputs {
                let (a, b) = (found.frf.line(k)[(i, j)], truth.at(k, i, j));
                assert!((a - b).norm() <= slack * b.norm(), "{a} {b}");
            }
        }
    }
}

fn folder(toml: &str, file: &str, bytes: impl AsRef<[u8]>) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("experiment.toml"), toml).unwrap();
    std::fs::write(dir.path().join(file), bytes).unwrap();
    dir
}

fn doubles(all: &[f64]) -> Vec<u8> {
    all.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn pairs(all: &[C64]) -> Vec<u8> {
    all.iter().flat_map(|v| doubles(&[v.re, v.im])).collect()
}

/// Arrays by name: dtype, shape, order, bytes.
fn npz(arrays: &[(&str, &str, &str, bool, Vec<u8>)]) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, descr, shape, fortran, bytes) in arrays {
        archive
            .start_file(format!("{name}.npy"), FileOptions::default())
            .unwrap();
        let order = if *fortran { "True" } else { "False" };
        let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        archive.write_all(b"\x93NUMPY\x01\x00").unwrap();
        archive.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
        archive.write_all(header.as_bytes()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// An element of a MATLAB file with its tag, padded.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut out = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    out.extend(data);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A complex or real array of MATLAB 5.
fn matlab(name: &str, shape: &[usize], re: &[f64], im: Option<&[f64]>) -> Vec<u8> {
    let flags = 6 | if im.is_some() { 0x800 } else { 0 };
    let mut body = element(6, &[(flags as u32).to_le_bytes(), [0; 4]].concat());
    body.extend(element(
        5,
        &shape
            .iter()
            .flat_map(|n| (*n as i32).to_le_bytes())
            .collect::<Vec<_>>(),
    ));
    body.extend(element(1, name.as_bytes()));
    body.extend(element(9, &doubles(re)));
    body.extend(im.map(|im| element(9, &doubles(im))).unwrap_or_default());
    element(14, &body)
}

fn matlab_file(variables: &[Vec<u8>]) -> Vec<u8> {
    let mut file = vec![b' '; 124];
    file.extend([0, 1, b'I', b'M']);
    file.extend(variables.concat());
    file
}

fn re_im(all: &[C64]) -> (Vec<f64>, Vec<f64>) {
    all.iter().map(|v| (v.re, v.im)).unzip()
}

/// Text with seventeen digits.
fn table(truth: &Truth, name: impl Fn(usize, usize, &str) -> String) -> String {
    let mut text = "frequency".to_owned();
    let channels: Vec<(usize, usize)> = (0..truth.outputs)
        .flat_map(|i| (0..truth.inputs).map(move |j| (i, j)))
        .collect();
    for (i, j) in &channels {
        let _ = write!(text, ",{},{}", name(*i, *j, "re"), name(*i, *j, "im"));
    }
    for k in 0..truth.lines {
        let _ = write!(text, "\n{:e}", truth.frequencies[k]);
        for (i, j) in &channels {
            let v = truth.at(k, *i, *j);
            let _ = write!(text, ",{:e},{:e}", v.re, v.im);
        }
    }
    text + "\n"
}

/// A universal file with a function for each pair of places; double precision, complex, uneven.
fn universal(truth: &Truth, kind: [usize; 2]) -> String {
    let mut text = String::new();
    for i in 0..truth.outputs {
        for j in 0..truth.inputs {
            let none = "NONE\n".repeat(5);
            let _ = write!(text, "    -1\n    58\n{none}");
            let place =
                |name: &str, node: usize, direction: usize| format!(" {name:<10}{node:>10}{direction:>4}");
            let _ = writeln!(
                text,
                "{:>5}{:>10}{:>5}{:>10}{}{}",
                4,
                0,
                0,
                0,
                place("NONE", 10 + i, 3),
                place("NONE", 20 + j, 1)
            );
            let _ = writeln!(
                text,
                "{:>10}{:>10}{:>10}{:>13.5e}{:>13.5e}{:>13.5e}",
                6, truth.lines, 0, 0.0, 0.0, 0.0
            );
            let axis = |kind: usize| {
                format!(
                    "{kind:>10}{:>5}{:>5}{:>5} {:<20} {:<20}\n",
                    0, 0, 0, "NONE", "NONE"
                )
            };
            text += &(axis(18) + &axis(kind[0]) + &axis(kind[1]) + &axis(0));
            for k in 0..truth.lines {
                let v = truth.at(k, i, j);
                let _ = writeln!(text, " {:.17e} {:.17e} {:.17e}", truth.frequencies[k], v.re, v.im);
            }
            text += "    -1\n";
        }
    }
    text
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn arrays_of_numpy(truth in truth(), fortran: bool) {
        let shape = format!("({}, {}, {})", truth.lines, truth.outputs, truth.inputs);
        let values = if fortran { truth.first_fastest() } else { truth.entries.clone() };
        let variance: Vec<f64> = values.iter().map(|v| 1e-4 * v.norm_sqr()).collect();
        let bytes = npz(&[
            ("frequency", "<f8", &format!("({},)", truth.lines), false, doubles(&truth.frequencies)),
            ("response", "<c16", &shape, fortran, pairs(&values)),
            ("variance", "<f8", &shape, fortran, doubles(&variance)),
            ("averages", "<f8", "()", false, doubles(&[16.0])),
        ]);
        let dir = folder(&truth.toml("a.npz", ""), "a.npz", bytes);
        let found = load(dir.path());
        check(&truth, &found, 0.0);
        prop_assert_eq!(found.averages, Some(16.0));
        let Spread::Variance(found) = found.spread else { panic!("no variance") };
        for (at, v) in found.iter().enumerate() {
            let n = truth.outputs * truth.inputs;
            let (k, j, i) = (at / n, at % n / truth.outputs, at % truth.outputs);
            prop_assert_eq!(*v, 1e-4 * truth.at(k, i, j).norm_sqr());
        }
    }

    /// MATLAB drops last indices that run over one entry.
    #[test]
    fn arrays_of_matlab(truth in truth(), version73: bool) {
        let mut shape = vec![truth.lines, truth.outputs, truth.inputs];
        while shape.len() > 2 && shape.last() == Some(&1) {
            shape.pop();
        }
        let (re, im) = re_im(&truth.first_fastest());
        let bytes = if version73 {
            let mut file = hdf5_pure::FileBuilder::new();
            file.create_dataset("frequency").with_f64_data(&truth.frequencies).with_shape(&[1, truth.lines as u64]);
            let values: Vec<(f64, f64)> = re.iter().copied().zip(im.iter().copied()).collect();
            let reversed: Vec<u64> = shape.iter().rev().map(|n| *n as u64).collect();
            file.create_dataset("response").with_complex64_data(&values).with_shape(&reversed);
            file.finish().unwrap()
        } else {
            matlab_file(&[
                matlab("frequency", &[truth.lines, 1], &truth.frequencies, None),
                matlab("response", &shape, &re, Some(&im)),
            ])
        };
        let dir = folder(&truth.toml("a.mat", ""), "a.mat", bytes);
        check(&truth, &load(dir.path()), 0.0);
    }

    /// The last index of HDF5 is the fastest.
    #[test]
    fn arrays_of_hdf5(truth in truth()) {
        let mut file = hdf5_pure::FileBuilder::new();
        file.create_dataset("f").with_f64_data(&truth.frequencies);
        let values: Vec<(f64, f64)> = truth.entries.iter().map(|v| (v.re, v.im)).collect();
        let shape = [truth.lines, truth.outputs, truth.inputs].map(|n| n as u64);
        file.create_dataset("G").with_complex64_data(&values).with_shape(&shape);
        let toml = truth.toml("a.h5", "columns = { frequency = \"f\", response = \"G\" }");
        let dir = folder(&toml, "a.h5", file.finish().unwrap());
        check(&truth, &load(dir.path()), 0.0);
    }

    #[test]
    fn columns_of_text(truth in truth(), zero: bool) {
        let mut text = table(&truth, |i, j, part| format!("y{i}/u{j} {part}"));
        if zero {
            // What stands at 0 Hz is left out, whatever it is.
            let (names, rest) = text.split_once('\n').unwrap();
            let empty = vec!["0"; names.split(',').count()].join(",");
            text = format!("{names}\n{empty}\n{rest}");
        }
        let dir = folder(&truth.toml("a.csv", "quantity = \"accelerance\""), "a.csv", text);
        let found = load(dir.path());
        check(&truth, &found, 0.0);
        prop_assert_eq!(found.quantity, Some(ResponseQuantity::AccelerationForce));
    }

    #[test]
    fn functions_of_universal_files(truth in truth()) {
        let mut places: Vec<String> = (0..truth.outputs).map(|i| format!("y{i} = \"{}+Z\"", 10 + i)).collect();
        places.extend((0..truth.inputs).map(|j| format!("u{j} = \"{}+X\"", 20 + j)));
        let toml = truth.toml("a.uff", &format!("columns = {{ {} }}", places.join(", ")));
        let dir = folder(&toml, "a.uff", universal(&truth, [12, 13]));
        let found = load(dir.path());
        check(&truth, &found, 1e-15);
        prop_assert_eq!(found.quantity, Some(ResponseQuantity::AccelerationForce));
        // The same in g.
        let ordinate = |unit: &str| format!("        12    0    0    0 NONE                 {unit:<20}\n");
        let in_g = universal(&truth, [12, 13]).replace(&ordinate("NONE"), &ordinate("g"));
        std::fs::write(dir.path().join("a.uff"), in_g).unwrap();
        let refused = Bundle::open(dir.path()).unwrap().load_response(0).unwrap_err().to_string();
        prop_assert!(refused.contains("is in g"), "{}", refused);
        std::fs::write(dir.path().join("a.uff"), universal(&truth, [12, 13])).unwrap();
        let stated = toml.replace("position", "quantity = \"mobility\"\nposition");
        std::fs::write(dir.path().join("experiment.toml"), stated).unwrap();
        let refused = Bundle::open(dir.path()).unwrap().load_response(0).unwrap_err().to_string();
        prop_assert!(refused.contains("but the file says acceleration/force"), "{}", refused);
    }

    /// Scales of outputs multiply, those of inputs divide, and the variance goes along.
    #[test]
    fn scales_are_those_of_the_channels(truth in truth(), decade in -6..6_i32) {
        let scale = 10f64.powi(decade);
        let mut text = table(&truth, |i, j, part| format!("y{i}/u{j} {part}"));
        text = text
            .lines()
            .enumerate()
            .map(|(k, line)| {
                let n = truth.outputs * truth.inputs;
                let cells: Vec<String> = (0..n)
                    .map(|c| match k {
                        0 => format!("y{}/u{} variance", c % truth.outputs, c / truth.outputs),
                        _ => "4".to_owned(),
                    })
                    .collect();
                format!("{line},{}\n", cells.join(","))
            })
            .collect();
        let toml = truth
            .toml("a.csv", "")
            .replace("[channels.input]", &format!("scale = [{}]\n[channels.input]", vec![format!("{scale:e}"); truth.outputs].join(", ")))
            .replace("[[records]]", &format!("scale = [{}]\n[[records]]", vec!["-2.0"; truth.inputs].join(", ")));
        let dir = folder(&toml, "a.csv", text);
        let found = load(dir.path());
        let scaled = Truth { entries: truth.entries.iter().map(|v| v * scale / -2.0).collect(), ..truth };
        check(&scaled, &found, 1e-15);
        let Spread::Variance(all) = found.spread else { panic!("no variance") };
        prop_assert!(all.iter().all(|v| (v / (scale * scale) - 1.0).abs() < 1e-12));
    }
}

/// The covariance of the columns of the response one below the other, in the units of the channels.
#[test]
fn a_covariance_goes_along_with_the_scales() {
    let truth = Truth {
        lines: 2,
        outputs: 2,
        inputs: 2,
        frequencies: vec![1.0, 3.0],
        entries: (0..8).map(|k| C64::new(1.0 + f64::from(k), 0.5)).collect(),
    };
    let entry = |k: usize, a: usize, b: usize| {
        let part =
            |a: usize, m: usize| C64::new((a + 2 * m + k) as f64 * 0.3 - 0.7, (a * m) as f64 * 0.2 - 0.1);
        let own = f64::from(u8::from(a == b));
        (0..4).map(|m| part(a, m) * part(b, m).conj()).sum::<C64>() + own
    };
    let all = |twist: f64| -> Vec<C64> {
        let indices = (0..32).map(|at| (at / 16, at % 16 / 4, at % 4));
        indices
            .map(|(k, a, b)| entry(k, a, b) + if (a, b) == (0, 3) { twist } else { 0.0 })
            .collect()
    };
    let file = |twist: f64| {
        npz(&[
            ("frequency", "<f8", "(2,)", false, doubles(&truth.frequencies)),
            ("response", "<c16", "(2, 2, 2)", false, pairs(&truth.entries)),
            ("covariance", "<c16", "(2, 4, 4)", false, pairs(&all(twist))),
        ])
    };
    let toml = truth
        .toml("a.npz", "")
        .replace("[channels.input]", "scale = [2.0, 5.0]\n[channels.input]")
        .replace("[[records]]", "scale = [1.0, 0.5]\n[[records]]");
    let dir = folder(&toml, "a.npz", file(0.0));
    let Spread::Covariance(found) = load(dir.path()).spread else {
        panic!("no covariance");
    };
    // Channels y0/u0, y1/u0, y0/u1, y1/u1.
    let factor = [2.0, 5.0, 4.0, 10.0];
    for k in 0..2 {
        for a in 0..4 {
            for b in 0..4 {
                let wanted = entry(k, a, b) * factor[a] * factor[b];
                assert!((found[k * 16 + b * 4 + a] - wanted).norm() < 1e-12 * wanted.norm().max(1.0));
            }
        }
    }
    std::fs::write(dir.path().join("a.npz"), file(0.1)).unwrap();
    let refused = Bundle::open(dir.path())
        .unwrap()
        .load_response(0)
        .unwrap_err()
        .to_string();
    assert!(refused.contains("a covariance is Hermitian"), "{refused}");
}

/// Every kind of file with a few bytes changed or its end cut off: an error or a response, never a panic, and soon.
#[test]
fn damage_is_an_error_or_a_response() {
    let truth = Truth {
        lines: 5,
        outputs: 2,
        inputs: 1,
        frequencies: vec![1.0, 2.0, 4.0, 5.0, 9.0],
        entries: (0..10).map(|k| C64::new(f64::from(k) + 1.0, -0.5)).collect(),
    };
    let (re, im) = re_im(&truth.first_fastest());
    let mut hdf5 = hdf5_pure::FileBuilder::new();
    hdf5.create_dataset("frequency").with_f64_data(&truth.frequencies);
    let values: Vec<(f64, f64)> = truth.entries.iter().map(|v| (v.re, v.im)).collect();
    hdf5.create_dataset("response")
        .with_complex64_data(&values)
        .with_shape(&[5, 2, 1]);
    let shape = "(5, 2, 1)";
    let files = [
        (
            "a.npz",
            "",
            npz(&[
                ("frequency", "<f8", "(5,)", false, doubles(&truth.frequencies)),
                ("response", "<c16", shape, false, pairs(&truth.entries)),
            ]),
        ),
        (
            "a.mat",
            "",
            matlab_file(&[
                matlab("frequency", &[5, 1], &truth.frequencies, None),
                matlab("response", &[5, 2], &re, Some(&im)),
            ]),
        ),
        ("a.h5", "", hdf5.finish().unwrap()),
        (
            "a.csv",
            "",
            table(&truth, |i, j, part| format!("y{i}/u{j} {part}")).into_bytes(),
        ),
        (
            "a.uff",
            "columns = { y0 = \"10+Z\", y1 = \"11+Z\", u0 = \"20+X\" }",
            universal(&truth, [8, 13]).into_bytes(),
        ),
    ];
    let mut seed = 1_u64;
    let mut next = |below: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) as usize % below
    };
    for (name, more, bytes) in files {
        let dir = folder(&truth.toml(name, more), name, &bytes);
        check(&truth, &load(dir.path()), 1e-15);
        let bundle = Bundle::open(dir.path()).unwrap();
        let mut refused = 0;
        for case in 0..600 {
            let mut damaged = bytes.clone();
            match case % 4 {
                0 => damaged.truncate(next(bytes.len())),
                _ => (0..=next(4)).for_each(|_| damaged[next(bytes.len())] = next(256) as u8),
            }
            std::fs::write(dir.path().join(name), damaged).unwrap();
            let start = std::time::Instant::now();
            refused += usize::from(bundle.load_response(0).is_err());
            assert!(start.elapsed().as_secs() < 2, "{name}");
        }
        assert!(refused > 100, "{name}: {refused}");
    }
}

/// A struct as `struct(frd)` makes it: outputs x inputs x lines, rad/s or Hz.
#[test]
fn a_struct_of_matlab() {
    use experiment_data::mat::{Array, Value, write_values};
    let truth = Truth {
        lines: 3,
        outputs: 2,
        inputs: 1,
        frequencies: vec![1.0, 2.0, 4.0],
        entries: (0..6).map(|k| C64::new(f64::from(k) + 1.0, -0.5)).collect(),
    };
    let array = |shape: &[u64], data: Vec<f64>| {
        Value::Array(Array {
            shape: shape.to_vec(),
            data,
        })
    };
    for (unit, factor) in [
        ("Hz", 1.0),
        ("rad/s", std::f64::consts::TAU),
        ("kHz", 1e-3),
        ("octaves", 0.0),
        ("", 0.0),
    ] {
        let mut fields = vec![
            (
                "Frequency".to_owned(),
                array(
                    &[3, 1],
                    truth
                        .frequencies
                        .iter()
                        .map(|f| f * if factor > 0.0 { factor } else { 1.0 })
                        .collect(),
                ),
            ),
            // Real here; the imaginary part is put in below.
            (
                "ResponseData".to_owned(),
                array(&[2, 1, 3], truth.entries.iter().map(|v| v.re).collect()),
            ),
        ];
        if !unit.is_empty() {
            fields.push(("Units".to_owned(), Value::Text(unit.to_owned())));
        }
        let bytes = write_values(&[("G".to_owned(), Value::Struct(fields))]).unwrap();
        let bytes = with_imaginary(&bytes, -0.5, 6);
        let dir = folder(&truth.toml("a.mat", ""), "a.mat", bytes);
        let found = Bundle::open(dir.path()).unwrap().load_response(0);
        if factor > 0.0 {
            check(&truth, &found.unwrap(), 1e-15);
        } else {
            let refused = found.unwrap_err().to_string();
            assert!(refused.contains("\"Hz\" or \"rad/s\" is needed"), "{refused}");
        }
    }
}

/// The same file with an imaginary part of the array `2 x 1 x 3`, the sizes of what is around it corrected.
fn with_imaginary(bytes: &[u8], im: f64, count: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let dimensions: Vec<u8> = [2_i32, 1, 3].iter().flat_map(|n| n.to_le_bytes()).collect();
    let at = bytes.windows(12).position(|w| w == dimensions).unwrap();
    // Its flags are 16 bytes before, and its own tag 24.
    let flags = at - 16;
    bytes[flags + 1] |= 8;
    let part = element(9, &doubles(&vec![im; count]));
    let own = flags - 16;
    let size = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at + 4..at + 8].try_into().unwrap());
    let end = own + 8 + size(&bytes, own) as usize;
    bytes.splice(end..end, part.clone());
    for tag in [own, 128] {
        let larger = size(&bytes, tag) + part.len() as u32;
        bytes[tag + 4..tag + 8].copy_from_slice(&larger.to_le_bytes());
    }
    bytes
}
