//! Experiment bundles: files in, records out.
//!
//! A bundle is a folder with one `experiment.toml` and the record files that it names. A column `c` of a file holds
//! the samples `c(k)`, `k = 0 .. N-1`, taken at `t = k T_s`, `T_s = 1 / sample_rate`. This crate reads the description,
//! multiplies every column by the scale written there, `x(k) = scale * c(k)`, checks the result against every clause
//! of the format, and hands out [`lpv_core::Record`]s, one at a time, and [`MeasuredResponse`]s. [`BundleWriter`] goes the other way;
//! [`look_into`], [`list_columns`] and [`read_columns`] look into a file that has no description yet, and [`schema`] is the description
//! as a JSON Schema.
//!
//! # Glossary
//!
//! | term | meaning |
//! |---|---|
//! | bundle | folder with `experiment.toml` and record files (`.npz`, `.csv` and other text tables, `.parquet`, `.mat` v5 and v7.3, `.h5`, `.tdms`, `.mf4`, `.uff`) |
//! | channel group | list of columns with one role: output y, input u, reference r, scheduling p, auxiliary |
//! | periodic record | steady multisine, p constant, a whole number (two or more) of periods |
//! | transient record | anything else |
//! | response record | a frequency response that was measured elsewhere, at one position |
//! | injection | known signal that one test added to the controller's output |
//! | position | the constant p of a record |
//!
//! # What it does not do
//! It knows no identification. It does not resample, detrend, align or repair: a number that is not finite, a clipped
//! sensor or a moving scheduling signal is refused with its place, because a silent repair would end as a pole in some
//! model. It does not look whether the periodic records at one position excite all inputs independently; that needs
//! spectra and belongs to the FRF estimate. It reads vectors of real numbers, and of MATLAB files columns and rows of matrices: complex numbers, words, lists,
//! objects, times in Parquet, formulas and tables in MDF, and raw values in TDMS that are still to be scaled are refused by name, and so is Parquet in a build without the feature `parquet`, Parquet packed otherwise than
//! with snappy, and HDF5 packed otherwise than MATLAB packs it. It estimates no frequency response: one that was measured elsewhere it reads, checks and scales.

//!
//! It believes no header. What a file claims to hold is compared with what a file of its size can hold, before memory is
//! taken for it, so that a damaged file ends in an error and not in a lack of memory: at most 64 times the size of the file (or
//! 64 MiB), and half of the memory that is free. Every message is shown in `docs/bad-input.md`.
//!
//! What counts as constant and as clipped is written at [`RecordError::Constant`] and [`RecordError::Clipped`].
//!
//! # Example
//!
//! ```
//! use experiment_data::{Bundle, RecordEntry};
//! let folder = std::env::temp_dir().join(format!("bundle-doc-{}", std::process::id()));
//! std::fs::create_dir_all(&folder)?;
//! std::fs::write(folder.join("move.csv"), "u,y\n0.0,0.0\n1.0,0.1\n0.5,0.4\n")?;
//! std::fs::write(
//!     folder.join("experiment.toml"),
//!     "format = 1\nname = 'one move'\nsample_rate = 20.0\n[channels.output]\ncolumns = ['y']\n\
//!      [channels.input]\ncolumns = ['u']\nscale = [2.0]\n\
//!      [[records]]\nfile = 'move.csv'\nkind = 'transient'\nuse = 'estimation'\n",
//! )?;
//! let bundle = Bundle::open(&folder)?;
//! let record = bundle.load(0)?;
//! assert_eq!(record.inputs.columns[0], [0.0, 2.0, 1.0]);
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bundle;
mod checks;
mod clipping;
mod columns;
mod contents;
mod description;
mod description_check;
mod error;
mod key_path;
pub mod mat;
mod memory;
mod nearest;
mod paths;
mod quantity;
mod response;
mod rest;
mod schema;
mod size;
mod source;
mod stage;
mod text;
mod toml_file;
mod writer;

pub use bundle::Bundle;
pub use columns::{RecordFormat, lines_of_rows, list_columns, look_into, read_columns, read_columns_as};
pub use contents::{Column, ColumnInfo, Contents, PassedOver, ResponseInfo, Scalar};
pub use description::{ChannelGroup, Channels, Description, EntryKind, RecordEntry};
pub use error::{DataError, DescriptionError, Place, RecordError, RecordPlace, ResponseFault};
pub use lpv_core;
pub use quantity::{Quantity, ResponseQuantity};
pub use response::{MeasuredResponse, ResponseArrays, Spread, response_arrays};
pub use rest::{RestingPlace, Travel};
pub use schema::schema;
pub use text::{Decimal, Separator, Text};
pub use writer::BundleWriter;
