//! How near the hot kernels are to what the machine can do, and how their times grow.
//!
//! `cargo xtask limits` runs this, on one thread. Operations and bytes are the least that the method of a kernel needs, not those that
//! the code happens to do.

mod disk;
mod growth;
mod kernels;
mod page;
mod works;

use clap::Parser;
use lpv_benches::Bench;
use serde::Serialize;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

type Failure = Box<dyn Error + Send + Sync>;

/// Measures roofline fractions and growth, and writes limits.json and the tables of docs/limits.md.
#[derive(Parser)]
#[command(name = "cargo xtask limits")]
struct Arguments {
    /// Write docs/limits.md too.
    #[arg(long)]
    bless: bool,
    /// Bundles of up to so many GB are written to target/ and read again.
    #[arg(long, default_value_t = 1.5, value_name = "GB")]
    disk: f64,
    /// The fractions alone, without growth, printed and not kept.
    #[arg(long, conflicts_with = "bless")]
    kernels: bool,
    /// Tell the peak memory of one row at one size.
    #[arg(long, hide = true)]
    memory: Option<String>,
    /// Where limits.json goes.
    #[arg(long, default_value = "target/limits")]
    output: PathBuf,
}

/// A kernel beside the speed that limits it.
#[derive(Debug, Serialize)]
struct Kernel {
    kernel: &'static str,
    seconds: f64,
    /// Floating-point operations that it needs.
    operations: f64,
    /// Bytes that it must read or write.
    bytes: f64,
    /// `compute` or `memory`, whichever takes longer at the limit.
    limit: &'static str,
    /// Time at the limit over the time that it takes.
    fraction: f64,
    bar: Option<f64>,
}

/// Time and memory against a size.
#[derive(Debug, Serialize)]
struct Growth {
    what: &'static str,
    sizes: Vec<usize>,
    seconds: Vec<f64>,
    /// Slope of the logarithms, least squares.
    exponent: f64,
    /// The same over the upper half of the sizes.
    upper_exponent: f64,
    bar: Option<f64>,
    /// What a run takes at its peak beyond its inputs; none where the system does not tell.
    mib: Option<Vec<f64>>,
    /// Most that it may be.
    most_mib: Option<f64>,
    /// Slope of its logarithms over the upper half of the sizes, where what any run takes no longer counts.
    mib_exponent: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Account {
    /// Operations a second of a product of matrices, one thread.
    gemm: f64,
    /// Bytes a second that a copy reads and writes, one thread.
    copy: f64,
    kernels: Vec<Kernel>,
    growth: Vec<Growth>,
}

fn main() -> ExitCode {
    lpv_core::keep_freed_memory();
    match measure(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure(arguments: &Arguments) -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    if let Some(of) = &arguments.memory {
        return growth::tell_memory(of);
    }
    let bench = Bench::new()?;
    let (kernels, [gemm, copy]) = kernels::all(&bench)?;
    let (growth, command) = if arguments.kernels {
        (Vec::new(), "cargo xtask limits --kernels".to_owned())
    } else {
        let command = format!("cargo xtask limits --bless --disk {}", arguments.disk);
        (growth::all(&bench, arguments.disk)?, command)
    };
    let account = Account {
        gemm,
        copy,
        kernels,
        growth,
    };
    let page = page::page(&account, &command);
    print!("{page}");
    if arguments.kernels {
        return Ok(());
    }
    std::fs::create_dir_all(&arguments.output)?;
    std::fs::write(
        arguments.output.join("limits.json"),
        serde_json::to_string_pretty(&account)?,
    )?;
    if arguments.bless {
        std::fs::write("docs/limits.md", page)?;
    }
    Ok(())
}
