//! Blocks have 16 bytes here, so that every kind of row meets their borders.

use super::*;
use crate::text::Separator;
use proptest::prelude::*;

fn table(content: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("table.csv");
    std::fs::write(&path, content).unwrap();
    (dir, path)
}

fn read_text(content: impl AsRef<[u8]>, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let (_dir, path) = table(content.as_ref());
    read(&path, names, None)
}

fn refusal(content: impl AsRef<[u8]>) -> String {
    read_text(content, &["a", "b"]).unwrap_err().to_string()
}

#[test]
fn read_by_hand() {
    let good = [vec![1.0, -2.5e3], vec![2.0, 0.25]];
    for text in [
        "a,b\n1,2\n-2.5e3,.25\n",
        "a,b\r\n1,2\r\n-2.5e3,.25",
        "a,b\r1,2\r-2.5e3,.25\r",
        "\u{feff}\n\n a , b\n\n  \n 1 ,\t2\n \t\n-2500 , 0.25 \n\n",
        "a,note,b\n1,\"line, one\n\"\"two\"\"\n\",2\n-2.5e3,é,.25\n",
        "\"a\",\"b\"\n\"1\",\" 2\"\n\"-2.5E+3\",+0.25\n",
        "b,a\n2,1\n.25,-2500\n",
    ] {
        assert_eq!(read_text(text, &["a", "b"]).unwrap(), good, "{text}");
    }
    // A name may be asked for twice; columns come in the order of the names.
    let twice = read_text("a,b\n1,2\n", &["b", "a", "b"]).unwrap();
    assert_eq!(twice, [[2.0], [1.0], [2.0]]);
    let odd = read_text("a,b\nNaN,-inf\nnan,Infinity\n", &["b", "a"]).unwrap();
    assert_eq!(odd[0], [f64::NEG_INFINITY, f64::INFINITY]);
    assert!(odd[1].iter().all(|v| v.is_nan()));
}

#[test]
fn places_by_hand() {
    let text = "a,note,b,,c\n\n\"1\",\"x\ny\",2,3,4\r\n\n5,z,6,7,w\n";
    let (_dir, path) = table(text.as_bytes());
    let names: Vec<_> = list(&path)
        .unwrap()
        .into_iter()
        .map(|c| (c.name, c.rows))
        .collect();
    assert_eq!(names, [("a".into(), 2), ("b".into(), 2), ("c".into(), 2)]);
    assert_eq!(lines_of_rows(&path, None, &[1, 2]), [3, 6]);
    let text = read(&path, &["c"], None).unwrap_err().to_string();
    assert!(text.contains("line 6, column `c`: `w` is not a number"), "{text}");
}

#[test]
fn what_is_refused() {
    for (content, part) in [
        (&b"a,b\n1,2\n3\n"[..], "line 3: 1 fields, the header has 2"),
        (b"a,b\n1,2,\n3,4,5\n", "line 2: 3 fields"),
        (b"a,b\n1,\n", "line 2, column `b`: the cell is empty"),
        (b"a,b\n1,2\n1,0x10\n", "line 3, column `b`: `0x10`"),
        (b"a,b\n1,\"2\n3,4\n", "line 2: a quotation mark is never closed"),
        (b"a,\"b\n1,2\n3,4\n", "line 1: a quotation mark is never closed"),
        (b"a,b\n1,2\n3,\x004\n", "line 3: a NUL byte"),
        (
            b"a,b\n1,2\n\xef\xbb\xbfa,b\n3,4\n",
            "line 3: a byte order mark inside",
        ),
        (
            b"a,b\n1,22222222\xef\xbb\xbfa,b\n3,4\n",
            "line 2: a byte order mark inside",
        ),
        (b"\xfe\xff\0a\0,\0b", "line 1: the text is UTF-16"),
        (b"\n\r\n  \n", "the file is empty"),
        (
            b"a;b\n1,5;2\n1.5;3\n2,5;3\n",
            "line 3, column `a`: `1.5` is not a number; write numbers like -1,5e-3",
        ),
        (
            b"a;b\n1;2\n1,5;3\n1.5;3\n",
            "line 4, column `a`: `1.5` is not a number",
        ),
        (
            b"a;b\n1;2;3\n1;2;3\n",
            "line 1 has 2 fields, and the rows from line 2 on have 3 separated by semicolons",
        ),
        (
            b"1,2\n3,4\n",
            "no line has the names of the 2 columns; write header = 0",
        ),
        (b"just\nwords\n", "no table of numbers is in it; [text]"),
    ] {
        let text = refusal(content);
        assert!(text.contains(part), "{part} expected in {text}");
    }
    let (_dir, path) = table(b"a,a\n1,2\n");
    let text = list(&path).unwrap_err().to_string();
    assert!(text.contains("the column `a` 2 times"), "{text}");
}

/// Whole numbers from 1000 on that may have their thousands apart are asked about; fractions of three digits are read.
#[test]
fn thousands_that_look_like_fractions_are_asked_about() {
    let values: Vec<i64> = (0..400).map(|k| (k * k * 7919 + 31 * k) % 5000 - 2300).collect();
    let apart = |v: i64, mark: char| match v.abs() < 1000 {
        true => v.to_string(),
        false => format!("{}{mark}{:03}", v / 1000, v.abs() % 1000),
    };
    for (separator, mark) in [(';', '.'), ('\t', ','), (';', ','), ('\t', '.')] {
        let rows = values.iter().enumerate();
        let rows: String = rows
            .map(|(k, v)| format!("{k}{separator}{}\n", apart(*v, mark)))
            .collect();
        let text = format!("n{separator}i\n{rows}");
        let said = refusal(&text);
        assert!(
            said.contains("a fraction or one thousand"),
            "{separator:?} {mark:?}: {said}"
        );
        // A fraction beside them, in any column, says what the mark is.
        let rows = values.iter().enumerate();
        let point = |k: usize| format!("{}{mark}5", k % 7);
        let rows: String = rows
            .map(|(k, v)| format!("{}{separator}{}\n", point(k), apart(*v, mark)))
            .collect();
        let read = read_text(format!("n{separator}i\n{rows}"), &["i"]).unwrap();
        let fraction = |v: &i64| {
            if v.abs() < 1000 {
                *v as f64
            } else {
                apart(*v, '.').parse().unwrap()
            }
        };
        assert_eq!(read[0], values.iter().map(fraction).collect::<Vec<f64>>());
        // So do fractions of three digits without whole numbers between.
        let rows: String = values
            .iter()
            .map(|v| format!("1{separator}{}{mark}{:03}\n", v / 1000, v.abs() % 1000))
            .collect();
        let read = read_text(format!("n{separator}i\n{rows}"), &["i"]).unwrap();
        let small: f64 = format!("{}.{:03}", values[0] / 1000, values[0].abs() % 1000)
            .parse()
            .unwrap();
        assert_eq!(read[0][0], small);
    }
}

#[test]
fn tables_of_other_programs() {
    let good = [vec![1.0, -2.5e3, 0.125], vec![2.0, 0.25, 3.0]];
    for (text, header) in [
        ("a;b\n1,0;2\n-2500,0;,25\n0,125;3\n", 1),
        ("a\tb\r\n1\t2\r\n-2.5e3\t.25\r\n0.125\t3\r\n", 1),
        ("  a   b\n  1   2\n-2.5e3  .25\n0.125\t3\n", 1),
        ("# a b\n1 2\n-2.5e3 .25\n0.125 3\n", 1),
        ("a,b\n[mm],[N]\n1,2\n-2.5e3,.25\n0.125,3\n", 1),
        ("a,b\nmm,N\nfirst,second\n1,2\n-2.5e3,.25\n0.125,3\n", 1),
        ("mm,N\na,b\n1,2\n-2.5e3,.25\n0.125,3\n", 2),
        ("a,b\n1,2,\n-2.5e3,.25,\n0.125,3,\n", 1),
        ("Model,X12\nVersion,1.5\n\na,b\n1,2\n-2.5e3,.25\n0.125,3\n", 4),
        (
            "Scope;\nFile;c.svdx\nStart;133500\n\na;b\n1;2\n-2500;0,25\n0,125;3\n",
            5,
        ),
        (
            "V\t2\n***End***\n\nSamples\t3\t3\na\tb\tComment\n1\t2\tstart\n-2.5e3\t.25\n0.125\t3\n",
            5,
        ),
        (
            "Units,mm,N\nLabel,a,b\nTIME,CH1,CH2\n0,1,2\n1,-2.5e3,.25\n2,0.125,3\n",
            0,
        ),
        ("\u{feff}a;b\n1,0;2,0\n-2500,0;0,25\n0,125;3,0", 1),
        ("a;b\n1;2\n-2500;0,25\n0,125;3\n", 1),
        (
            "t;a;b\n10:00:00,1;1,0;2\n10:00:00,2;-2500;0,25\n10:00:00,3;0,125;3\n",
            1,
        ),
    ] {
        let (_dir, path) = table(text.as_bytes());
        assert_eq!(read(&path, &["a", "b"], None).unwrap(), good, "{text}");
        // What is said about it reads it again.
        let said = contents(&path).unwrap();
        assert!(
            ["a", "b"]
                .iter()
                .all(|n| said.columns.iter().any(|c| c.name == *n)),
            "{text}"
        );
        let layout = said.text.unwrap();
        assert_eq!(layout.header, Some(header), "{text}");
        assert_eq!(read(&path, &["a", "b"], Some(&layout)).unwrap(), good, "{text}");
    }
}

#[test]
fn a_layout_is_taken_as_said() {
    let (_dir, path) = table(b"1,5\nno data\n2,5\n");
    let layout = Text {
        separator: Some(Separator::Semicolon),
        decimal: Some(Decimal::Comma),
        header: Some(0),
        names: vec!["a".to_owned()],
        units_row: None,
        skip: vec![2],
    };
    assert_eq!(read(&path, &["a"], Some(&layout)).unwrap(), [[1.5, 2.5]]);
    let wrong = Text {
        header: Some(9),
        names: Vec::new(),
        ..layout.clone()
    };
    let said = read(&path, &["a"], Some(&wrong)).unwrap_err().to_string();
    assert!(
        said.contains("header = 9, and the file has no such line"),
        "{said}"
    );
    let unskipped = Text {
        skip: Vec::new(),
        ..layout
    };
    let said = read(&path, &["a"], Some(&unskipped)).unwrap_err().to_string();
    assert!(
        said.contains("line 2, column `a`: `no data` is not a number"),
        "{said}"
    );
    // Commas between numbers with decimal commas need quotation marks.
    let (_dir, path) = table(b"a,b\n\"1,5\",\"2\"\n");
    let layout = Text {
        decimal: Some(Decimal::Comma),
        ..Text::default()
    };
    assert_eq!(read(&path, &["b", "a"], Some(&layout)).unwrap(), [[2.0], [1.5]]);
}

#[test]
fn columns_with_holes_are_passed_over() {
    let (_dir, path) = table(b"a,b,c,note,\n1,2,3,x,\n4,5,,y,\n6,7,,z,\n");
    let said = contents(&path).unwrap();
    let names: Vec<&str> = said.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!((names.as_slice(), said.text), (&["a", "b"][..], None));
    let passed: Vec<String> = said
        .passed_over
        .iter()
        .map(|p| format!("{}: {}", p.name, p.what))
        .collect();
    assert_eq!(
        passed,
        [
            "c: no value in 2 of 3 rows, the first in line 3",
            "note: words (`x`)"
        ]
    );
}

/// Cells as programs write them, and as they should not.
fn cell() -> impl Strategy<Value = String> {
    let spaces = "[ \t]{0,2}";
    prop_oneof![
        8 => any::<f64>().prop_map(|v| format!("{v:?}")),
        4 => (-1e3..1e3f64).prop_map(|v| format!("{v:.9}")),
        4 => (spaces, any::<f64>(), spaces).prop_map(|(a, v, b)| format!("{a}{v:e}{b}")),
        2 => any::<i64>().prop_map(|v| format!("\"{v}\"")),
        2 => "[+-]?[0-9]{0,25}\\.?[0-9]{0,25}([eE][+-]?[0-9]{1,4})?",
        1 => "\"[a,\n\r ]{0,5}(\"\")?\"",
        1 => "(nan|NAN|inf|-Infinity|1_000|1e|e5|--1|1\\.2\\.3|0x1p3|infinit|1d3)",
    ]
}

/// The columns by the crate csv and the standard library; none if anything is wrong.
fn reference(text: &str, names: &[&str]) -> Option<Vec<Vec<f64>>> {
    let mut reader = csv::ReaderBuilder::new().from_reader(text.as_bytes());
    let header = reader.headers().ok()?.clone();
    let mut columns = vec![Vec::new(); names.len()];
    for row in reader.records() {
        let row = row.ok()?;
        for (column, name) in columns.iter_mut().zip(names) {
            let place = header.iter().position(|h| h == *name)?;
            column.push(row.get(place)?.trim_ascii().parse().ok()?);
        }
    }
    Some(columns)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn agrees_with_the_crate_csv(
        rows in prop::collection::vec(prop::collection::vec(cell(), 3), 0..12),
        end in prop_oneof![Just("\n"), Just("\r\n"), Just("\r"), Just("\n\n")],
        closed in any::<bool>(),
    ) {
        let mut lines = vec!["x,y,z".to_owned()];
        lines.extend(rows.iter().map(|r| r.join(",")));
        let mut text = lines.join(end);
        if closed {
            text += end;
        }
        for names in [&["x", "y", "z"][..], &["z"], &["y", "x"]] {
            let bits = |columns: Vec<Vec<f64>>| -> Vec<Vec<u64>> {
                let one = |v: f64| if v.is_nan() { f64::NAN.to_bits() } else { v.to_bits() };
                columns.into_iter().map(|c| c.into_iter().map(one).collect()).collect()
            };
            let ours = read_text(&text, names).ok().map(bits);
            prop_assert_eq!(ours, reference(&text, names).map(bits));
        }
    }
}
