use crate::RecordError;
use parquet::basic::{Compression, Repetition, Type as PhysicalType};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::sync::Arc;

/// Rows written at once.
const GROUP: usize = 1 << 20;

/// Columns of doubles that must have values, packed with snappy; the same columns give the same bytes.
pub(crate) fn write(file: File, names: &[&str], columns: &[&[f64]]) -> Result<File, RecordError> {
    let to_error = |e: ParquetError| RecordError::io("write")(std::io::Error::other(e.to_string()));
    let mut buffer = content(BufWriter::new(file), names, columns).map_err(to_error)?;
    buffer.flush().map_err(RecordError::io("write"))?;
    buffer
        .into_inner()
        .map_err(|e| RecordError::io("write")(e.into_error()))
}

fn content<W: Write + Send>(out: W, names: &[&str], columns: &[&[f64]]) -> Result<W, ParquetError> {
    let fields = names
        .iter()
        .map(|name| {
            let field = Type::primitive_type_builder(name, PhysicalType::DOUBLE);
            Ok(Arc::new(field.with_repetition(Repetition::REQUIRED).build()?))
        })
        .collect::<Result<Vec<_>, ParquetError>>()?;
    let schema = Arc::new(Type::group_type_builder("record").with_fields(fields).build()?);
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_created_by("experiment-data".to_owned())
        .build();
    let mut writer = SerializedFileWriter::new(out, schema, Arc::new(properties))?;
    let rows = columns.first().map_or(0, |c| c.len());
    for start in (0..rows).step_by(GROUP) {
        let end = rows.min(start + GROUP);
        let mut group = writer.next_row_group()?;
        for column in columns {
            let Some(mut pages) = group.next_column()? else {
                break;
            };
            pages
                .typed::<DoubleType>()
                .write_batch(&column[start..end], None, None)?;
            pages.close()?;
        }
        group.close()?;
    }
    writer.into_inner()
}
