//! The program `lpv` as a process: what it says, how it ends, what it takes.

use super::TaskError;
use serde_json::Value;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A run is ended after so long: nothing here is large.
const MOST_SECONDS: u64 = 300;
/// A run is ended at this memory, so that one that grows does not take the machine along.
const MOST_KIB: u64 = 3 << 20;

/// How a run ended.
#[derive(Debug, Clone, Default)]
pub(crate) struct Said {
    /// Exit code; none where a signal ended it.
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
    /// The largest resident set that was seen, in KiB.
    pub(crate) peak_kib: u64,
    pub(crate) seconds: f64,
}

impl Said {
    /// The first line: of standard output, else of standard error.
    pub(crate) fn first(&self) -> String {
        let line = |text: &str| text.lines().find(|l| !l.trim().is_empty()).map(str::to_owned);
        line(&self.out).or_else(|| line(&self.err)).unwrap_or_default()
    }
    /// Everything, in lower case.
    pub(crate) fn all(&self) -> String {
        format!("{}\n{}", self.out, self.err).to_lowercase()
    }
    /// Lines that warn, or name a contradiction of the data.
    pub(crate) fn warnings(&self) -> Vec<String> {
        self.out
            .lines()
            .chain(self.err.lines())
            .filter(|l| {
                let line = l.trim_start_matches("- ");
                line.starts_with("warning") || line.starts_with("contradiction")
            })
            .map(str::to_owned)
            .collect()
    }
    /// Whether it ended by itself, with one of the codes of the manual, and without a panic.
    pub(crate) fn is_orderly(&self) -> bool {
        matches!(self.code, Some(0..=3))
            && !self.all().contains("panicked")
            && !self.all().contains("fault of the program")
    }
}

/// The program, and the folder in which it runs.
#[derive(Debug, Clone)]
pub(crate) struct Lab {
    pub(crate) program: PathBuf,
    pub(crate) folder: PathBuf,
}

impl Lab {
    /// A command of the program in the folder.
    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.program);
        // One thread: the cases run beside each other.
        command
            .args(arguments)
            .env("RAYON_NUM_THREADS", "1")
            .current_dir(&self.folder);
        command
    }
    /// Runs it to its end.
    pub(crate) fn run(&self, arguments: &[&str]) -> Result<Said, TaskError> {
        watch(&mut self.command(arguments))
    }
    /// The path of a name in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }
    /// A JSON file in the folder; null where there is none.
    pub(crate) fn json(&self, name: &str) -> Value {
        let text = std::fs::read_to_string(self.path(name)).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or(Value::Null)
    }
}

/// Runs a command and looks at its memory while it runs.
pub(crate) fn watch(command: &mut Command) -> Result<Said, TaskError> {
    let start = Instant::now();
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    let reader = |stream: Option<Box<dyn Read + Send>>| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            if let Some(mut stream) = stream {
                // What cannot be read was not said.
                stream.read_to_end(&mut bytes).ok();
            }
            String::from_utf8_lossy(&bytes).into_owned()
        })
    };
    let out = reader(child.stdout.take().map(|s| Box::new(s) as Box<dyn Read + Send>));
    let err = reader(child.stderr.take().map(|s| Box::new(s) as Box<dyn Read + Send>));
    let status_file = format!("/proc/{}/status", child.id());
    let (mut peak_kib, mut pause) = (0, Duration::from_millis(1));
    let status = loop {
        peak_kib = peak_kib.max(peak(Path::new(&status_file)));
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if start.elapsed().as_secs() > MOST_SECONDS || peak_kib > MOST_KIB {
            child.kill()?;
        }
        std::thread::sleep(pause);
        pause = (pause * 5 / 4).min(Duration::from_millis(10));
    };
    Ok(Said {
        code: status.code(),
        out: out.join().unwrap_or_default(),
        err: err.join().unwrap_or_default(),
        peak_kib,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// `VmHWM`, the high-water mark that the kernel keeps, in KiB.
fn peak(status: &Path) -> u64 {
    let text = std::fs::read_to_string(status).unwrap_or_default();
    let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse().ok())
        .unwrap_or(0)
}

/// The first value under a key that fits.
pub(crate) fn find_where<'a>(value: &'a Value, key: &str, fits: fn(&Value) -> bool) -> Option<&'a Value> {
    match value {
        Value::Object(map) => map
            .get(key)
            .filter(|v| fits(v))
            .or_else(|| map.values().find_map(|v| find_where(v, key, fits))),
        Value::Array(all) => all.iter().find_map(|v| find_where(v, key, fits)),
        _ => None,
    }
}

/// The value under a key, wherever it stands first.
pub(crate) fn find<'a>(value: &'a Value, key: &str) -> Option<&'a Value> {
    find_where(value, key, |_| true)
}

/// The word of a verdict: what the result is worth; empty where there is none.
pub(crate) fn worth(value: &Value) -> String {
    find(value, "verdict")
        .and_then(|v| v.get("worth"))
        .and_then(Value::as_str)
        .unwrap_or_default()
        .to_owned()
}
