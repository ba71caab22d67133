//! The native half of the Python package `lpvident`: the facade `lpv` with numpy arrays.
//!
//! Each file says what it hands over. Accounts go as JSON text, which Python reads as it reads the files of the program; signals,
//! responses and matrices go as arrays. Names, defaults, shapes and units are documented where they are used, in `python/lpvident/`.
//! Nothing here decides about models or data.

mod arrays;
mod bundle;
mod commands;
mod diagnosis;
mod error;
mod fit;
mod model;
mod places;
mod settings;
mod simulate;
mod worker;

use pyo3::prelude::*;

/// The native half of lpvident.
#[pymodule]
mod _lpvident {
    #[pymodule_export]
    use crate::bundle::Bundle;
    #[pymodule_export]
    use crate::commands::{identify, inspect, validate};
    #[pymodule_export]
    use crate::diagnosis::{Diagnosis, diagnose, read_effects};
    #[pymodule_export]
    use crate::fit::fit_frf;
    #[pymodule_export]
    use crate::model::Model;
    #[pymodule_export]
    use crate::settings::{settings, template};
    #[pymodule_export]
    use crate::simulate::{machine_template, simulate_machine};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
