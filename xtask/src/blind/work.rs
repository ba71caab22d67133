//! Machines that are worked on two at a time. Each outcome is appended to a log, from which a later run goes on.

use crate::{TaskError, reproduce, root};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::Write;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

/// Machines that are worked on at the same time.
const AT_ONCE: usize = 2;

/// A case, or what came out of it, by the seed that they share.
pub(super) trait Seeded {
    fn seed(&self) -> u64;
}

/// Works on the cases in their order until the minutes are over. Those that are `done` are not run again; outcomes come in the order of
/// the cases, whoever was faster.
///
/// # Errors
/// Of the file system.
pub(super) fn work<C: Seeded + Sync, O: Seeded + Serialize + Send>(
    cases: &[C],
    (log, minutes): (&Path, f64),
    done: Vec<O>,
    solve: impl Fn(&C) -> Result<O, TaskError> + Sync,
    line: fn(&O) -> String,
) -> Result<Vec<O>, TaskError> {
    let start = Instant::now();
    let place = |seed: u64| cases.iter().position(|c| c.seed() == seed);
    let done: Vec<O> = done.into_iter().filter(|o| place(o.seed()).is_some()).collect();
    let mut file = std::fs::File::create(log)?;
    for outcome in &done {
        writeln!(file, "{}", serde_json::to_string(outcome)?)?;
    }
    let left: Vec<&C> = cases
        .iter()
        .filter(|c| done.iter().all(|o| o.seed() != c.seed()))
        .collect();
    let left = Mutex::new(left.into_iter());
    let told = Mutex::new((file, done));
    let next = || {
        let mut left = left.lock().ok()?;
        let late = start.elapsed().as_secs_f64() > 60.0 * minutes;
        if late { None } else { left.next() }
    };
    let one = || -> Result<(), TaskError> {
        while let Some(case) = next() {
            match solve(case) {
                Ok(outcome) => {
                    println!("{}", line(&outcome));
                    let mut told = told.lock().map_err(|_| "a diagnosis panicked")?;
                    writeln!(told.0, "{}", serde_json::to_string(&outcome)?)?;
                    told.1.push(outcome);
                }
                // A severity that the simulation cannot hold, say.
                Err(error) => println!("not simulated: seed {}: {error}", case.seed()),
            }
        }
        Ok(())
    };
    // Threads of their own: what one leaves of the pool that they share is the other's.
    std::thread::scope(|scope| {
        let workers = [(); AT_ONCE].map(|()| scope.spawn(one));
        workers
            .into_iter()
            .try_for_each(|w| w.join().unwrap_or_else(|_| Err("a diagnosis panicked".into())))
    })?;
    let mut outcomes = told.into_inner().map_err(|_| "a diagnosis panicked")?.1;
    outcomes.sort_by_key(|o| place(o.seed()));
    if outcomes.len() < cases.len() {
        println!("{} of {} machines", outcomes.len(), cases.len());
    }
    Ok(outcomes)
}

/// What an earlier run left in its log; a line that was cut off counts as not run.
///
/// # Errors
/// Of the file system.
pub(crate) fn logged<O: DeserializeOwned>(log: &Path) -> Result<Vec<O>, TaskError> {
    let text = match std::fs::read_to_string(log) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
        text => text?,
    };
    Ok(text
        .lines()
        .filter_map(|l| serde_json::from_str(l).ok())
        .collect())
}

/// Writes figures and page of a bench to its folder, and to docs where they are to be kept there.
///
/// # Errors
/// Of the file system.
pub(crate) fn publish(
    (folder, name): (&Path, &str),
    metrics: &impl Serialize,
    page: &str,
    bless: bool,
) -> Result<(), TaskError> {
    reproduce::write_json(&folder.join("metrics.json"), metrics)?;
    std::fs::write(folder.join(format!("{name}.md")), page)?;
    if bless {
        let docs = root().join("docs");
        reproduce::write_json(&docs.join(format!("metrics/{name}.json")), metrics)?;
        std::fs::write(docs.join(format!("{name}.md")), page)?;
    }
    println!("{}", serde_json::to_string_pretty(metrics)?);
    Ok(())
}
