//! Many records and many columns: the work grows with their number and not with its square, which took minutes.

use experiment_data::{Bundle, RecordError, list_columns, read_columns};
use std::fmt::Write as _;
use std::time::{Duration, Instant};

/// A hundredth of what the square would take, and many times what the work takes.
const LONG: Duration = Duration::from_secs(20);

#[test]
fn many_records_open_in_a_moment() {
    const RECORDS: usize = 10_000;
    let folder = tempfile::tempdir().unwrap();
    let first = folder.path().join("r0.csv");
    std::fs::write(&first, "y,u\n1,2\n2,3\n4,1\n").unwrap();
    let mut text = "format = 1\nname = 'n'\nsample_rate = 1.0\n[channels.output]\ncolumns = ['y']\n\
                    [channels.input]\ncolumns = ['u']\n"
        .to_owned();
    for k in 0..RECORDS {
        let file = format!("r{k}.csv");
        if k > 0 {
            // Another name of the same bytes is another file.
            std::fs::hard_link(&first, folder.path().join(&file)).unwrap();
        }
        write!(
            text,
            "[[records]]\nfile = '{file}'\nkind = 'transient'\nuse = 'estimation'\n"
        )
        .unwrap();
    }
    let description = folder.path().join("experiment.toml");
    std::fs::write(&description, &text).unwrap();
    let start = Instant::now();
    let bundle = Bundle::open(folder.path()).unwrap();
    assert_eq!(bundle.len(), RECORDS);
    assert_eq!(bundle.record_name(RECORDS - 1).unwrap(), "r9999");
    assert_eq!(
        bundle.load(RECORDS - 1).unwrap().outputs.columns,
        [[1.0, 2.0, 4.0]]
    );
    // The last one is the first again, through another way.
    std::fs::write(&description, text.replace("'r9999.csv'", "'./r0.csv'")).unwrap();
    let error = Bundle::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("is already records[0]"), "{error}");
    std::fs::write(&description, text.replace("'r9999.csv'", "'r9999_.csv'")).unwrap();
    let error = Bundle::open(folder.path()).unwrap_err().to_string();
    assert!(
        error.contains("records[9999].file") && error.contains("`r9999.csv`"),
        "{error}"
    );
    assert!(start.elapsed() < LONG, "{:?}", start.elapsed());
}

#[test]
fn many_columns_are_listed_and_read_in_a_moment() {
    const COLUMNS: usize = 60_000;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r.csv");
    let row = |cell: &dyn Fn(usize) -> String| (0..COLUMNS).map(cell).collect::<Vec<_>>().join(",");
    let text = [
        row(&|k| format!("c{k}")),
        row(&|k| k.to_string()),
        row(&|k| (k + 1).to_string()),
    ]
    .join("\n");
    std::fs::write(&path, text).unwrap();
    let start = Instant::now();
    let listed = list_columns(&path).unwrap();
    assert_eq!(listed.len(), COLUMNS);
    let names: Vec<&str> = listed.iter().map(|c| c.name.as_str()).collect();
    let columns = read_columns(&path, &names).unwrap();
    assert_eq!(columns[COLUMNS - 1], [COLUMNS as f64 - 1.0, COLUMNS as f64]);
    let error = read_columns(&path, &["c6O000"]).unwrap_err();
    assert!(
        matches!(&error, RecordError::ColumnMissing { present: COLUMNS, .. }),
        "{error}"
    );
    assert!(start.elapsed() < LONG, "{:?}", start.elapsed());
}
