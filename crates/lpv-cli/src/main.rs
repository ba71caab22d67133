//! The program `lpv`: measured records in, model out.

mod arguments;
mod bars;
mod run;
mod stop;

use clap::Parser;
use lpv::encode;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

fn main() -> ExitCode {
    lpv_core::keep_freed_memory();
    ExitCode::from(exit_code())
}

/// Runs the program: every exit code comes from here.
fn exit_code() -> u8 {
    let arguments = match arguments::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(refused) => return refusal(&refused),
    };
    // A panic is a fault of the program and not of its input; its message is on standard error already.
    let Ok(done) = std::panic::catch_unwind(|| run::run(arguments.command)) else {
        say("this is a fault of the program; please report it with the command and the data");
        return 1;
    };
    match done {
        Ok(done) => print(done.text.trim_end(), if done.usable { 0 } else { 3 }),
        Err(error) => {
            say(&error.to_string());
            error.exit_code()
        }
    }
}

/// One message on standard error. Where nobody can read it, the exit code tells.
fn say(problem: &str) {
    writeln!(std::io::stderr(), "error: {}", encode::message(problem)).ok();
}

/// The text on standard output, and the exit code.
fn print(text: &str, exit_code: u8) -> u8 {
    if text.is_empty() {
        return exit_code;
    }
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Ok(()) => exit_code,
        // A reader that closes the pipe early has what it wanted.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => exit_code,
        Err(e) => {
            say(&format!("the output cannot be written: {e}"));
            1
        }
    }
}

/// Help and version, or words that mean nothing.
fn refusal(refused: &clap::Error) -> u8 {
    let text = refused.render().to_string();
    if !refused.use_stderr() {
        return match refused.print() {
            Ok(()) => 0,
            Err(e) if e.kind() == ErrorKind::BrokenPipe => 0,
            Err(e) => {
                say(&format!("the output cannot be written: {e}"));
                1
            }
        };
    }
    let shown = encode::for_terminal(&text);
    if shown == text {
        refused.print().ok();
    } else {
        write!(std::io::stderr(), "{shown}").ok();
    }
    2
}
