//! How fast CSV is read, on one core: `csv_speed [megabytes]` (default 64). It writes a table of eight columns of the
//! given size to a temporary folder, reads it three times, prints the best speeds, and removes it.

use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::Path;
use std::time::Instant;

const NAMES: [&str; 8] = ["t", "u1", "u2", "y1", "y2", "r1", "r2", "p"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let megabytes: u64 = std::env::args().nth(1).map_or(Ok(64), |text| text.parse())?;
    let folder = std::env::temp_dir().join(format!("experiment-data-csv-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let outcome = measure(&folder.join("table.csv"), megabytes);
    std::fs::remove_dir_all(&folder)?;
    outcome
}

fn measure(path: &Path, megabytes: u64) -> Result<(), Box<dyn std::error::Error>> {
    let (bytes, rows) = write_table(path, megabytes * 1_000_000)?;
    println!(
        "{:.1} MB, {rows} rows, {:.1} bytes a cell",
        bytes as f64 / 1e6,
        bytes as f64 / (rows * 8) as f64
    );
    report("the bytes alone", bytes, || {
        let mut block = vec![0; 1 << 18];
        let mut file = File::open(path)?;
        while file.read(&mut block)? > 0 {}
        Ok(())
    })?;
    for columns in [&NAMES[..], &NAMES[3..5]] {
        report(&format!("{} of 8 columns", columns.len()), bytes, || {
            let read = experiment_data::read_columns(path, columns)?;
            if read.len() != columns.len() || read.iter().any(|c| c.len() as u64 != rows) {
                return Err("rows are missing".into());
            }
            Ok(())
        })?;
    }
    Ok(())
}

fn report(
    what: &str,
    bytes: u64,
    run: impl Fn() -> Result<(), Box<dyn std::error::Error>>,
) -> Result<(), Box<dyn std::error::Error>> {
    let mut best = 0.0f64;
    for _ in 0..3 {
        let start = Instant::now();
        run()?;
        best = best.max(bytes as f64 / 1e6 / start.elapsed().as_secs_f64());
    }
    println!("{what}: {best:.0} MB/s");
    Ok(())
}

/// Half of the columns with nine decimals, half with the shortest text that reads back to the same bits.
fn write_table(path: &Path, size: u64) -> Result<(u64, u64), std::io::Error> {
    let mut out = BufWriter::new(File::create(path)?);
    let mut line = NAMES.join(",") + "\n";
    let (mut written, mut rows) = (0, 0);
    while written < size {
        out.write_all(line.as_bytes())?;
        written += line.len() as u64;
        line.clear();
        for column in 0..NAMES.len() {
            let value = 3.0 * (0.001 * rows as f64 * (1.0 + column as f64)).sin();
            line += &match column % 2 {
                0 => format!("{value:.9},"),
                _ => format!("{value:?},"),
            };
        }
        line.pop();
        line.push('\n');
        rows += 1;
    }
    out.flush()?;
    Ok((written, rows - 1))
}
