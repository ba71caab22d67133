//! The program `lpv`: measured records in, model out.

mod arguments;
mod bars;
mod done;
mod fleet;
mod run;
mod stop;

use anstyle::AnsiColor;
use arguments::{Arguments, Common};
use clap::{CommandFactory, FromArgMatches, Parser};
use lpv::encode;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

fn main() -> ExitCode {
    lpv_core::keep_freed_memory();
    ExitCode::from(exit_code())
}

/// Runs the program: every exit code comes from here.
fn exit_code() -> u8 {
    let Arguments { common, command } = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(refused) => return refusal(&refused),
    };
    if let Err(problem) = begin(&common) {
        say(&problem);
        return 1;
    }
    // A panic is a fault of the program and not of its input; its message is on standard error already.
    let Ok(done) = std::panic::catch_unwind(|| run::run(command)) else {
        say("this is a fault of the program; please report it with the command and the data");
        return 1;
    };
    match done {
        Ok(done) => printed(done.print(common.quiet)).unwrap_or(done.exit_code()),
        Err(error) => {
            say(&error.to_string());
            error.exit_code()
        }
    }
}

/// Sets up what the options of every command ask for.
fn begin(common: &Common) -> Result<(), String> {
    common.color.write_global();
    bars::set(common.quiet, common.verbose);
    stop::on_signals();
    stop::after(common.time_limit);
    let threads = common.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build_global()
        .map_err(|e| format!("the threads cannot be started: {e}; ask for fewer with --threads"))
}

/// One message on standard error. Where nobody can read it, the exit code tells.
fn say(problem: &str) {
    let style = AnsiColor::Red.on_default().bold();
    writeln!(
        anstream::stderr(),
        "{style}error:{style:#} {}",
        encode::message(problem)
    )
    .ok();
}

/// The exit code of output that cannot be written.
fn printed(out: std::io::Result<()>) -> Option<u8> {
    match out {
        Ok(()) => None,
        // A reader that closes the pipe early has what it wanted.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => None,
        Err(e) => {
            say(&format!("the output cannot be written: {e}"));
            Some(1)
        }
    }
}

/// Help and version, or words that mean nothing.
fn refusal(refused: &clap::Error) -> u8 {
    // Whatever is wrong with the other words, the one about colour holds.
    let lenient = Arguments::command().ignore_errors(true).try_get_matches();
    if let Ok(common) = lenient.and_then(|words| Common::from_arg_matches(&words)) {
        common.color.write_global();
    }
    if !refused.use_stderr() {
        return printed(refused.print()).unwrap_or(0);
    }
    let text = refused.render().to_string();
    let shown = encode::for_terminal(&text);
    if shown == text {
        refused.print().ok();
    } else {
        write!(std::io::stderr(), "{shown}").ok();
    }
    2
}
