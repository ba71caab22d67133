//! The program `lpv`: measured records in, model out.

mod arguments;
mod run;

use clap::Parser;
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    lpv_core::keep_freed_memory();
    let arguments = arguments::Arguments::parse();
    // A panic is a fault of the program and not of its input; its message is on standard error already.
    let Ok(done) = std::panic::catch_unwind(|| run::run(arguments.command)) else {
        eprintln!("error: this is a fault of the program; please report it with the command and the data");
        return ExitCode::from(1);
    };
    match done {
        Ok(done) => {
            let code = ExitCode::from(if done.usable { 0 } else { 3 });
            let text = done.text.trim_end();
            if text.is_empty() {
                return code;
            }
            // A reader that closes the pipe early has what it wanted.
            match writeln!(std::io::stdout().lock(), "{text}") {
                Ok(()) => code,
                Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => code,
                Err(e) => {
                    eprintln!("error: the output cannot be written: {e}");
                    ExitCode::from(1)
                }
            }
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
