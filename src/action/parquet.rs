//! Corpora as Parquet files: poses, and the actionlets they were made from. Plain columns, no
//! compression: angles hardly compress, and files are written at the speed of the disk.

use crate::action::corpus::{Batch, Pieces};
use crate::body::Dof;
use crate::error::{Error, ErrorKind};
use parquet::basic::Compression;
use parquet::data_type::{DataType, DoubleType, FloatType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;
use std::fmt::Write as _;
use std::io::Write;
use std::sync::Arc;

type RowGroup<'a, W> = SerializedRowGroupWriter<'a, W>;

/// Two files that grow together, a row group per batch.
pub struct CorpusWriter<W: Write + Send> {
    poses: SerializedFileWriter<W>,
    pieces: SerializedFileWriter<W>,
}

impl<W: Write + Send> CorpusWriter<W> {
    /// Begins both files. `notes` are kept in them: how they were made.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn new(poses: W, pieces: W, notes: &[(String, String)]) -> Result<Self, Error> {
        let mut schema =
            String::from("message poses { required int32 variation; required float time_s; ");
        for dof in Dof::ALL {
            let _ = write!(schema, "required float {}_rad; ", dof.name());
        }
        for axis in ["x", "y", "z"] {
            let _ = write!(schema, "required float root_{axis}_m; ");
        }
        schema.push('}');
        let pieces_schema = "message actionlets { required int32 variation; required int32 dof; \
             required int32 shape; required double begin_s; required double duration_s; \
             required double from_rad; required double to_rad; required double peak; \
             required group samples (LIST) { repeated group list { required double element; } } }";
        Ok(Self {
            poses: begun(poses, &schema, notes).map_err(unwritable)?,
            pieces: begun(pieces, pieces_schema, notes).map_err(unwritable)?,
        })
    }

    /// Appends a batch as one row group of each file.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&mut self, batch: &Batch) -> Result<(), Error> {
        write_poses(&mut self.poses, batch).map_err(unwritable)?;
        write_pieces(&mut self.pieces, &batch.pieces).map_err(unwritable)
    }

    /// Completes both files.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn finish(mut self) -> Result<(), Error> {
        self.poses.finish().map_err(unwritable)?;
        self.pieces.finish().map_err(unwritable)?;
        Ok(())
    }
}

fn unwritable(e: ParquetError) -> Error {
    Error::of(ErrorKind::Io, "cannot write the corpus").got(e.to_string())
}

fn begun<W: Write + Send>(
    file: W,
    schema: &str,
    notes: &[(String, String)],
) -> Result<SerializedFileWriter<W>, ParquetError> {
    let notes = notes.iter().map(|(key, value)| KeyValue::new(key.clone(), value.clone()));
    let properties = WriterProperties::builder()
        .set_dictionary_enabled(false)
        .set_compression(Compression::UNCOMPRESSED)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_key_value_metadata(Some(notes.collect()))
        .set_created_by("gaitway".to_owned())
        .build();
    SerializedFileWriter::new(file, Arc::new(parse_message_type(schema)?), Arc::new(properties))
}

fn column<W: Write + Send, T: DataType>(
    group: &mut RowGroup<'_, W>,
    values: &[T::T],
) -> Result<(), ParquetError> {
    let next = group.next_column()?;
    let mut column = next.ok_or_else(|| ParquetError::General("a column too many".to_owned()))?;
    column.typed::<T>().write_batch(values, None, None)?;
    column.close()
}

fn write_poses<W: Write + Send>(
    file: &mut SerializedFileWriter<W>,
    batch: &Batch,
) -> Result<(), ParquetError> {
    let mut group = file.next_row_group()?;
    column::<_, Int32Type>(&mut group, &batch.variation)?;
    column::<_, FloatType>(&mut group, &batch.time_s)?;
    for values in batch.angles_rad.iter().chain(&batch.root_m) {
        column::<_, FloatType>(&mut group, values)?;
    }
    group.close().map(|_| ())
}

fn write_pieces<W: Write + Send>(
    file: &mut SerializedFileWriter<W>,
    pieces: &Pieces,
) -> Result<(), ParquetError> {
    let mut group = file.next_row_group()?;
    for whole in [&pieces.variation, &pieces.dof, &pieces.shape] {
        column::<_, Int32Type>(&mut group, whole)?;
    }
    for real in
        [&pieces.begin_s, &pieces.duration_s, &pieces.from_rad, &pieces.to_rad, &pieces.peak]
    {
        column::<_, DoubleType>(&mut group, real)?;
    }
    lists(&mut group, &pieces.sample_count, &pieces.samples)?;
    group.close().map(|_| ())
}

/// Writes a column of lists, `values` one list after the other. By the format's encoding of nested
/// columns (Parquet, "Nested Encoding"), an empty list is one level without a value; repetition 0
/// begins a list, 1 goes on with it.
fn lists<W: Write + Send>(
    group: &mut RowGroup<'_, W>,
    lengths: &[usize],
    values: &[f64],
) -> Result<(), ParquetError> {
    let (mut defined, mut repeated) = (Vec::new(), Vec::new());
    for length in lengths {
        defined.resize(defined.len() + (*length).max(1), i16::from(*length > 0));
        repeated.push(0);
        repeated.resize(defined.len(), 1);
    }
    let next = group.next_column()?;
    let mut column = next.ok_or_else(|| ParquetError::General("a column too many".to_owned()))?;
    column.typed::<DoubleType>().write_batch(values, Some(&defined), Some(&repeated))?;
    column.close()
}
