//! MATLAB level 5 files ("MAT-File Format", The MathWorks), read and written here because the crates at hand refuse
//! files of common programs or read numbers only.
//!
//! Read: both byte orders, compressed and small elements, all numeric classes and logicals, 1 x 1 structs by dotted
//! names. Cells, objects, characters, sparse and opaque variables are passed over. Only wanted variables are decoded.

mod element;
mod reader;
mod writer;

pub(crate) use reader::read;
pub(crate) use writer::write;
