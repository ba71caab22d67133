//! Fuzz targets of every reader, one program: the environment variable `LPV_FUZZ` names the target.
//!
//! libFuzzer changes the input to reach new code, and watches for panics, for inputs that take longer than 5 s and for memory
//! above 1 GiB; `cargo xtask fuzz` gives it these limits. With `LPV_FUZZ_SEEDS` in the place of a target, the seeds of all targets
//! are written into that folder.
#![no_main]

#[cfg(feature = "program")]
mod program;
#[cfg(feature = "program")]
mod program_seeds;
mod seeds;
mod targets;

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use std::sync::OnceLock;

static TARGET: OnceLock<targets::Target> = OnceLock::new();

fuzz_target!(
    init: {
        if let Some(folder) = std::env::var_os("LPV_FUZZ_SEEDS") {
            seeds::write(Path::new(&folder));
            #[cfg(feature = "program")]
            program_seeds::write(Path::new(&folder));
            std::process::exit(0);
        }
        let name = std::env::var("LPV_FUZZ").unwrap_or_default();
        let mut all = targets::TARGETS.to_vec();
        #[cfg(feature = "program")]
        all.extend(program::TARGETS);
        let found = all.iter().find(|t| t.name == name);
        let names: Vec<&str> = all.iter().map(|t| t.name).collect();
        let Some(found) = found else {
            panic!("set LPV_FUZZ to one of {}", names.join(", "));
        };
        let _ = TARGET.set(*found);
        pardon_guarded_crates();
    },
    |data: &[u8]| {
        if let Some(target) = TARGET.get() {
            (target.run)(data);
        }
    }
);

/// The readers of HDF5 and Parquet catch the panics of the crates below them and make errors of them; every other panic is a
/// finding, which libFuzzer's own hook reports.
fn pardon_guarded_crates() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        let place = info.location().map_or("", |l| l.file());
        if !["/hdf5-pure-", "/parquet-"]
            .iter()
            .any(|guarded| place.contains(guarded))
        {
            report(info);
        }
    }));
}
