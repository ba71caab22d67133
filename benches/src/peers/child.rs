//! A process that runs a work on demand; the other end of `benches/peers/peer.py`.

use crate::works::Failure;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// A run is repeated until it takes so long, seconds.
const LEAST: f64 = 0.02;

/// Before a run: threads of a BLAS go on asking for work for a tenth of a second, on a core that whoever is next needs.
const QUIET: Duration = Duration::from_millis(300);

/// Answers commands of the standard input: `run`, `save PATH`, `memory`.
pub(crate) fn serve(run: &mut dyn FnMut() -> Result<Vec<f64>, Failure>) -> Result<(), Failure> {
    let mut result = run()?;
    println!("ready");
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        match line.split_once(' ') {
            Some(("save", path)) => {
                let bytes: Vec<u8> = result.iter().flat_map(|v| v.to_le_bytes()).collect();
                std::fs::write(path, bytes)?;
                println!("saved");
            }
            _ if line == "run" => {
                let (start, mut count) = (Instant::now(), 0.0);
                while count == 0.0 || start.elapsed().as_secs_f64() < LEAST {
                    result = run()?;
                    count += 1.0;
                }
                println!("{}", start.elapsed().as_secs_f64() / count);
            }
            _ => println!("{}", peak_mib().unwrap_or(f64::NAN)),
        }
    }
    Ok(())
}

/// Peak of the resident memory, where the system tells.
fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

/// A running process; it ends when its input is closed.
pub(crate) struct Child {
    process: std::process::Child,
    to: Option<ChildStdin>,
    from: BufReader<ChildStdout>,
}

impl Child {
    /// Starts it, and waits until it is ready.
    pub(crate) fn start(command: &mut Command) -> Result<Self, Failure> {
        let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let to = process.stdin.take();
        let from = process.stdout.take().ok_or("a child without an output")?;
        let mut child = Self {
            process,
            to,
            from: BufReader::new(from),
        };
        match child.answer()?.as_str() {
            "ready" => Ok(child),
            other => Err(format!("{command:?} said {other:?} instead of ready").into()),
        }
    }

    /// Seconds of one run, all others at rest.
    pub(crate) fn run(&mut self) -> Result<f64, Failure> {
        std::thread::sleep(QUIET);
        Ok(self.ask("run")?.parse()?)
    }

    /// Peak memory, MiB.
    pub(crate) fn memory(&mut self) -> Result<f64, Failure> {
        Ok(self.ask("memory")?.parse()?)
    }

    /// The last result.
    pub(crate) fn result(&mut self, path: &Path) -> Result<Vec<f64>, Failure> {
        self.ask(&format!("save {}", path.display()))?;
        let bytes = std::fs::read(path)?;
        let (numbers, _) = bytes.as_chunks::<8>();
        Ok(numbers.iter().map(|b| f64::from_le_bytes(*b)).collect())
    }

    fn ask(&mut self, what: &str) -> Result<String, Failure> {
        let to = self.to.as_mut().ok_or("a child without an input")?;
        writeln!(to, "{what}")?;
        to.flush()?;
        self.answer()
    }

    fn answer(&mut self) -> Result<String, Failure> {
        let mut line = String::new();
        if self.from.read_line(&mut line)? == 0 {
            return Err("a child ended before it answered".into());
        }
        Ok(line.trim().to_owned())
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.to = None;
        // Its end is of no interest.
        let _ = self.process.wait();
    }
}
