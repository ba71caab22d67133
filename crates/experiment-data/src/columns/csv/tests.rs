//! Blocks have 16 bytes here, so that every kind of row meets their borders.

use super::*;
use proptest::prelude::*;

fn table(content: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("table.csv");
    std::fs::write(&path, content).unwrap();
    (dir, path)
}

fn read_text(content: impl AsRef<[u8]>, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let (_dir, path) = table(content.as_ref());
    read(&path, names)
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
    assert_eq!(lines_of_rows(&path, &[1, 2]), [3, 6]);
    let text = read(&path, &["c"]).unwrap_err().to_string();
    assert!(text.contains("line 6, column `c`: `w` is not a number"), "{text}");
}

#[test]
fn what_is_refused() {
    for (content, part) in [
        (&b"a,b\n1,2\n3\n"[..], "line 3: 1 fields, the header has 2"),
        (b"a,b\n1,2,\n", "line 2: 3 fields"),
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
        (b"a;b\n1;2\n", "separated by semicolons"),
        (b"a\tb\n1\t2\n", "separated by tabs"),
    ] {
        let text = refusal(content);
        assert!(text.contains(part), "{part} expected in {text}");
    }
    let (_dir, path) = table(b"a,a\n1,2\n");
    let text = list(&path).unwrap_err().to_string();
    assert!(text.contains("the column `a` 2 times"), "{text}");
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
