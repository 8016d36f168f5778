//! Parquet tables: rows in groups, column by column, packed by zstd, with statistics of every column of
//! every group; read back group by group, only the columns and rows that are wanted.

pub mod pages;

use crate::error::{Error, ErrorKind, counted};
use bytes::Bytes;
use pages::{Packing, UnpackedPages, ZstdPages};
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::column::reader::{ColumnReader, get_column_reader, get_typed_column_reader};
use parquet::column::writer::{
    ColumnCloseResult, get_column_writer, get_typed_column_writer_mut as typed,
};
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type,
};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesPtr};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::serialized_reader::SerializedPageReader;
use parquet::file::statistics::Statistics;
use parquet::file::writer::{SerializedFileWriter, SerializedPageWriter, TrackedWrite};
use parquet::schema::parser::parse_message_type;
use parquet::schema::types::{ColumnDescPtr, ColumnPath, SchemaDescriptor, TypePtr};
use std::fs::File;
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Most bytes of a word that statistics keep; longer ones are rounded.
const STATISTICS_BYTES: usize = 64;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// Words, or nothing.
    Text,
    /// Whole numbers, or nothing.
    Whole,
    /// Numbers, or nothing.
    Real,
    /// Numbers of single precision, in every row.
    Single,
    /// Yes or no, in every row.
    Flag,
    /// A list of words in every row.
    Texts,
    /// A list of whole numbers in every row.
    Wholes,
    /// A list of numbers in every row.
    Reals,
    /// A list of numbers of single precision in every row.
    Singles,
}

/// What a column is called and holds.
pub type ColumnSpec = (String, ColumnKind);

/// A column of a row group.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// As [`ColumnKind::Text`].
    Text(Vec<Option<Word>>),
    /// As [`ColumnKind::Whole`].
    Whole(Vec<Option<i64>>),
    /// As [`ColumnKind::Real`].
    Real(Vec<Option<f64>>),
    /// As [`ColumnKind::Single`].
    Single(Vec<f32>),
    /// As [`ColumnKind::Flag`].
    Flag(Vec<bool>),
    /// As [`ColumnKind::Texts`].
    Texts(Vec<Vec<Word>>),
    /// As [`ColumnKind::Wholes`].
    Wholes(Vec<Vec<i64>>),
    /// As [`ColumnKind::Reals`].
    Reals(Vec<Vec<f64>>),
    /// As [`ColumnKind::Singles`].
    Singles(Vec<Vec<f32>>),
}

/// A word in a column: many rows may share one.
#[derive(Clone, Debug, PartialEq)]
pub struct Word(ByteArray);

impl Word {
    /// As text; empty if the file holds something else.
    #[must_use]
    pub fn text(&self) -> &str {
        self.0.as_utf8().unwrap_or_default()
    }
}

impl From<&str> for Word {
    fn from(text: &str) -> Self {
        Self(ByteArray::from(text))
    }
}

impl Column {
    /// One without rows.
    #[must_use]
    pub const fn empty(kind: ColumnKind) -> Self {
        match kind {
            ColumnKind::Text => Self::Text(Vec::new()),
            ColumnKind::Whole => Self::Whole(Vec::new()),
            ColumnKind::Real => Self::Real(Vec::new()),
            ColumnKind::Single => Self::Single(Vec::new()),
            ColumnKind::Flag => Self::Flag(Vec::new()),
            ColumnKind::Texts => Self::Texts(Vec::new()),
            ColumnKind::Wholes => Self::Wholes(Vec::new()),
            ColumnKind::Reals => Self::Reals(Vec::new()),
            ColumnKind::Singles => Self::Singles(Vec::new()),
        }
    }

    /// How many rows it has.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Text(all) => all.len(),
            Self::Whole(all) => all.len(),
            Self::Real(all) => all.len(),
            Self::Single(all) => all.len(),
            Self::Flag(all) => all.len(),
            Self::Texts(all) => all.len(),
            Self::Wholes(all) => all.len(),
            Self::Reals(all) => all.len(),
            Self::Singles(all) => all.len(),
        }
    }

    /// True of one without rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The word in a row; nothing in a column of another kind.
    #[must_use]
    pub fn text(&self, row: usize) -> Option<&str> {
        let Self::Text(all) = self else { return None };
        all.get(row)?.as_ref().map(Word::text)
    }

    /// The whole number in a row.
    #[must_use]
    pub fn whole(&self, row: usize) -> Option<i64> {
        let Self::Whole(all) = self else { return None };
        *all.get(row)?
    }

    /// The number in a row, of whatever precision.
    #[must_use]
    pub fn real(&self, row: usize) -> Option<f64> {
        match self {
            Self::Real(all) => *all.get(row)?,
            Self::Single(all) => all.get(row).map(|value| f64::from(*value)),
            Self::Whole(all) => all.get(row)?.map(|value| value as f64),
            _ => None,
        }
    }

    /// Yes or no in a row.
    #[must_use]
    pub fn flag(&self, row: usize) -> Option<bool> {
        let Self::Flag(all) = self else { return None };
        all.get(row).copied()
    }
}

/// How a table is laid out.
pub struct TableSchema {
    columns: Vec<ColumnSpec>,
    schema: TypePtr,
    descriptor: SchemaDescriptor,
    properties: WriterPropertiesPtr,
}

impl TableSchema {
    /// A table called `name` with these columns. Numbers of single precision are split by place unless their column
    /// is one of `repeating`, which have few values.
    ///
    /// # Errors
    /// Columns that the format cannot hold.
    pub fn new(name: &str, columns: Vec<ColumnSpec>, repeating: &[&str]) -> Result<Self, Error> {
        let described: String = columns.iter().map(|(name, kind)| described(name, *kind)).collect();
        let schema = parse_message_type(&format!("message {name} {{ {described} }}"));
        let schema = Arc::new(schema.map_err(unwritable)?);
        let mut properties = WriterProperties::builder()
            .set_compression(Compression::UNCOMPRESSED)
            .set_dictionary_enabled(true)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_statistics_truncate_length(Some(STATISTICS_BYTES))
            .set_offset_index_disabled(true)
            .set_created_by("gaitway".to_owned());
        for (name, kind) in &columns {
            if places(name, *kind, repeating) > 1 {
                let path = ColumnPath::from(name.as_str());
                properties = properties
                    .set_column_dictionary_enabled(path.clone(), false)
                    .set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT);
            }
        }
        let descriptor = SchemaDescriptor::new(Arc::clone(&schema));
        Ok(Self { columns, schema, descriptor, properties: Arc::new(properties.build()) })
    }

    /// Its columns.
    #[must_use]
    pub fn columns(&self) -> &[ColumnSpec] {
        &self.columns
    }

    /// The number of a column.
    #[must_use]
    pub fn index(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|(known, _)| known == name)
    }

    /// A row group without rows, to be filled.
    #[must_use]
    pub fn empty(&self) -> Vec<Column> {
        self.columns.iter().map(|(_, kind)| Column::empty(*kind)).collect()
    }

    fn packed(
        &self,
        index: usize,
        column: &Column,
    ) -> Result<(Bytes, ColumnCloseResult), ParquetError> {
        let mut sink = TrackedWrite::new(Vec::new());
        let (_, kind) = self.columns[index];
        let of = self.descriptor.column(index);
        let is_split = self.properties.encoding(of.path()) == Some(Encoding::BYTE_STREAM_SPLIT);
        let places = if is_split && kind == ColumnKind::Single { 4 } else { 1 };
        let pages = ZstdPages::new(SerializedPageWriter::new(&mut sink), places);
        let mut writer = get_column_writer(of, Arc::clone(&self.properties), Box::new(pages));
        match column {
            Column::Text(all) => {
                let (values, levels) = dense(all.iter().map(|v| v.as_ref().map(|w| w.0.clone())));
                typed::<ByteArrayType>(&mut writer).write_batch(&values, Some(&levels), None)?
            }
            Column::Whole(all) => {
                let (values, levels) = dense(all.iter().copied());
                typed::<Int64Type>(&mut writer).write_batch(&values, Some(&levels), None)?
            }
            Column::Real(all) => {
                let (values, levels) = dense(all.iter().copied());
                typed::<DoubleType>(&mut writer).write_batch(&values, Some(&levels), None)?
            }
            Column::Single(all) => typed::<FloatType>(&mut writer).write_batch(all, None, None)?,
            Column::Flag(all) => typed::<BoolType>(&mut writer).write_batch(all, None, None)?,
            Column::Texts(all) => {
                let (values, levels, starts) = listed(all, |word| word.0.clone());
                let into = typed::<ByteArrayType>(&mut writer);
                into.write_batch(&values, Some(&levels), Some(&starts))?
            }
            Column::Wholes(all) => {
                let (values, levels, starts) = listed(all, |value| *value);
                let into = typed::<Int64Type>(&mut writer);
                into.write_batch(&values, Some(&levels), Some(&starts))?
            }
            Column::Reals(all) => {
                let (values, levels, starts) = listed(all, |value| *value);
                let into = typed::<DoubleType>(&mut writer);
                into.write_batch(&values, Some(&levels), Some(&starts))?
            }
            Column::Singles(all) => {
                let (values, levels, starts) = listed(all, |value| *value);
                let into = typed::<FloatType>(&mut writer);
                into.write_batch(&values, Some(&levels), Some(&starts))?
            }
        };
        let mut close = writer.close()?;
        let packed = Compression::ZSTD(ZstdLevel::default());
        close.metadata = close.metadata.into_builder().set_compression(packed).build()?;
        Ok((Bytes::from(sink.into_inner()?), close))
    }
}

fn described(name: &str, kind: ColumnKind) -> String {
    match kind {
        ColumnKind::Text => format!("optional binary {name} (STRING); "),
        ColumnKind::Whole => format!("optional int64 {name}; "),
        ColumnKind::Real => format!("optional double {name}; "),
        ColumnKind::Single => format!("required float {name}; "),
        ColumnKind::Flag => format!("required boolean {name}; "),
        ColumnKind::Texts => list_described(name, "binary", " (STRING)"),
        ColumnKind::Wholes => list_described(name, "int64", ""),
        ColumnKind::Reals => list_described(name, "double", ""),
        ColumnKind::Singles => list_described(name, "float", ""),
    }
}

/// A list as the format's own rules have it, and as Arrow writes it.
fn list_described(name: &str, of: &str, kind: &str) -> String {
    format!(
        "optional group {name} (LIST) {{ repeated group list {{ optional {of} element{kind}; }} }} "
    )
}

fn places(name: &str, kind: ColumnKind, repeating: &[&str]) -> usize {
    if kind == ColumnKind::Single && !repeating.contains(&name) { 4 } else { 1 }
}

/// The values that are there, and for each row whether one is (1) or not (0).
fn dense<T>(all: impl Iterator<Item = Option<T>>) -> (Vec<T>, Vec<i16>) {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    for value in all {
        levels.push(i16::from(value.is_some()));
        values.extend(value);
    }
    (values, levels)
}

/// The values of all lists; for each how deep it is (3: a value, 1: a list without any), and whether it goes on with a list
/// (1) or begins one (0).
fn listed<T, V>(lists: &[Vec<T>], value: impl Fn(&T) -> V) -> (Vec<V>, Vec<i16>, Vec<i16>) {
    let (mut values, mut levels, mut starts) = (Vec::new(), Vec::new(), Vec::new());
    for list in lists {
        levels.extend(if list.is_empty() { vec![1] } else { vec![3; list.len()] });
        starts.push(0);
        starts.extend(list.iter().skip(1).map(|_| 1));
        values.extend(list.iter().map(&value));
    }
    (values, levels, starts)
}

/// A table in the making.
pub struct TableFile<'a, W: Write + Send> {
    schema: &'a TableSchema,
    file: SerializedFileWriter<W>,
    groups: usize,
}

impl<'a, W: Write + Send> TableFile<'a, W> {
    /// Begins a table that notes `notes` about itself.
    ///
    /// # Errors
    /// As the file system says.
    pub fn new(
        schema: &'a TableSchema,
        into: W,
        notes: Vec<(String, String)>,
    ) -> Result<Self, Error> {
        let begun = SerializedFileWriter::new(
            into,
            Arc::clone(&schema.schema),
            Arc::clone(&schema.properties),
        );
        let mut file = begun.map_err(unwritable)?;
        for (key, value) in notes {
            file.append_key_value_metadata(KeyValue::new(key, value));
        }
        Ok(Self { schema, file, groups: 0 })
    }

    /// How many row groups there are.
    #[must_use]
    pub const fn groups(&self) -> usize {
        self.groups
    }

    /// Appends a row group.
    ///
    /// # Errors
    /// As the file system says; columns that are not those of the table, or of different lengths.
    pub fn write(&mut self, columns: &[Column]) -> Result<(), Error> {
        let group = || -> Result<(), ParquetError> {
            let rows = columns.first().map_or(0, Column::len);
            if columns.len() != self.schema.columns.len()
                || columns.iter().any(|column| column.len() != rows)
            {
                return Err(ParquetError::General("columns of different lengths".to_owned()));
            }
            let mut into = self.file.next_row_group()?;
            for (index, column) in columns.iter().enumerate() {
                let (bytes, close) = self.schema.packed(index, column)?;
                into.append_column(&bytes, close)?;
            }
            into.close().map(|_| ())
        };
        let mut group = group;
        group().map_err(unwritable)?;
        self.groups += 1;
        Ok(())
    }

    /// Writes its end, and gives back where it went.
    ///
    /// # Errors
    /// As the file system says.
    pub fn finish(self) -> Result<W, Error> {
        self.file.into_inner().map_err(unwritable)
    }
}

/// The least and the greatest value of a column in a row group; they may be a little wider than that.
#[derive(Clone, Debug, PartialEq)]
pub enum Span {
    /// Of words, as bytes.
    Text(Vec<u8>, Vec<u8>),
    /// Of numbers.
    Real(f64, f64),
    /// Of yes and no.
    Flag(bool, bool),
    /// There is nothing in it.
    Nothing,
    /// Nobody knows.
    Unknown,
}

/// A table that is read.
pub struct TableReader {
    file: SerializedFileReader<File>,
    input: Arc<File>,
    names: Vec<String>,
}

impl TableReader {
    /// Opens a table and reads its end.
    ///
    /// # Errors
    /// A file that is not there, or is no Parquet file.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let open = || -> Result<Self, ParquetError> {
            // A pipe would be waited for.
            if !path.metadata()?.is_file() {
                return Err(ParquetError::General("it is no file".to_owned()));
            }
            let file = File::open(path)?;
            let input = Arc::new(file.try_clone()?);
            let file = SerializedFileReader::new(file)?;
            let of = file.metadata().file_metadata().schema_descr();
            let names = of.columns().iter().map(|c| c.path().string()).collect();
            Ok(Self { file, input, names })
        };
        open().map_err(|cause| unreadable(cause, path))
    }

    /// How many row groups there are.
    #[must_use]
    pub fn groups(&self) -> usize {
        self.file.num_row_groups()
    }

    /// How many rows all groups have.
    #[must_use]
    pub fn rows(&self) -> u64 {
        u64::try_from(self.file.metadata().file_metadata().num_rows()).unwrap_or(0)
    }

    /// How many rows a group has.
    #[must_use]
    pub fn rows_in(&self, group: usize) -> usize {
        let groups = self.file.metadata().row_groups();
        groups.get(group).map_or(0, |of| usize::try_from(of.num_rows()).unwrap_or(0))
    }

    /// What the table notes about itself.
    #[must_use]
    pub fn note(&self, key: &str) -> Option<&str> {
        let notes = self.file.metadata().file_metadata().key_value_metadata()?;
        notes.iter().find(|note| note.key == key)?.value.as_deref()
    }

    fn index(&self, column: &str) -> Option<usize> {
        self.names.iter().position(|name| name == column)
    }

    /// Whether there is a column.
    #[must_use]
    pub fn has(&self, column: &str) -> bool {
        self.index(column).is_some()
    }

    /// Between which values a column of a group lies.
    #[must_use]
    pub fn span(&self, group: usize, column: &str) -> Span {
        let groups = self.file.metadata().row_groups();
        let found = groups.get(group).zip(self.index(column));
        let Some(chunk) = found.and_then(|(of, index)| of.columns().get(index)) else {
            return Span::Unknown;
        };
        let Some(all) = chunk.statistics() else { return Span::Unknown };
        let is_empty = all.null_count_opt().is_some_and(|n| n.cast_signed() == chunk.num_values());
        let spanned = match all {
            _ if is_empty => Some(Span::Nothing),
            Statistics::ByteArray(of) => of
                .min_opt()
                .zip(of.max_opt())
                .map(|(least, most)| Span::Text(least.data().to_vec(), most.data().to_vec())),
            Statistics::Int64(of) => {
                of.min_opt().zip(of.max_opt()).map(|(a, b)| Span::Real(*a as f64, *b as f64))
            }
            Statistics::Double(of) => {
                of.min_opt().zip(of.max_opt()).map(|(a, b)| Span::Real(*a, *b))
            }
            Statistics::Float(of) => of
                .min_opt()
                .zip(of.max_opt())
                .map(|(a, b)| Span::Real(f64::from(*a), f64::from(*b))),
            Statistics::Boolean(of) => {
                of.min_opt().zip(of.max_opt()).map(|(a, b)| Span::Flag(*a, *b))
            }
            _ => None,
        };
        spanned.unwrap_or(Span::Unknown)
    }

    /// A column of a group: only these rows of it, which are in order; all of them for `None`.
    ///
    /// # Errors
    /// A table without such a column, or a damaged one.
    pub fn column(
        &self,
        group: usize,
        column: &str,
        rows: Option<&[Range<usize>]>,
    ) -> Result<Column, Error> {
        let all = 0..self.rows_in(group);
        let rows = rows.unwrap_or(std::slice::from_ref(&all));
        self.read(group, column, rows).map_err(|cause| {
            Error::of(ErrorKind::Malformed, "a column of a table cannot be read")
                .at(column)
                .got(cause.to_string())
        })
    }

    /// A column of a group whose rows are lists of numbers, in a file of strangers: these rows of it, each of
    /// `width` numbers.
    ///
    /// # Errors
    /// A table without such a column, a damaged one, a row with more or fewer numbers.
    pub fn lists(
        &self,
        group: usize,
        column: &str,
        rows: Range<usize>,
        width: usize,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let within = |name: &&String| {
            name.strip_prefix(column).is_some_and(|rest| rest.starts_with('.') && rest.len() > 1)
        };
        let read = || -> Result<Vec<Vec<f64>>, ParquetError> {
            let missing = || ParquetError::General(format!("there is no list {column}"));
            let mut leaves = self.names.iter().filter(within);
            let (leaf, None) = (leaves.next().ok_or_else(missing)?, leaves.next()) else {
                return Err(ParquetError::General(format!("{column} is more than a list")));
            };
            let (reader, of, given) = self.opened(group, leaf)?;
            if of.max_rep_level() != 1 {
                return Err(ParquetError::General(format!("{column} is no list")));
            }
            let deepest = of.max_def_level();
            match reader {
                ColumnReader::FloatColumnReader(_) => {
                    let single = |value: f32| f64::from(value);
                    lists::<FloatType>(reader, deepest, rows, width, &given, single)
                }
                ColumnReader::DoubleColumnReader(_) => {
                    lists::<DoubleType>(reader, deepest, rows, width, &given, |value| value)
                }
                _ => Err(ParquetError::General("a list of another kind".to_owned())),
            }
        };
        read().map_err(|cause| {
            Error::of(ErrorKind::Malformed, "a column of a table cannot be read")
                .at(column)
                .got(cause.to_string())
        })
    }

    /// A column of a group, unpacked as it is read, and how many values it gave since that was last set to none.
    fn opened(
        &self,
        group: usize,
        column: &str,
    ) -> Result<(ColumnReader, ColumnDescPtr, Arc<AtomicUsize>), ParquetError> {
        let missing = || ParquetError::General(format!("there is no column {column}"));
        let index = self.index(column).ok_or_else(missing)?;
        let of = self.file.metadata().row_groups().get(group).ok_or_else(missing)?;
        let chunk = of.columns().get(index).ok_or_else(missing)?;
        let described = chunk.clone().into_builder();
        let described = described.set_compression(Compression::UNCOMPRESSED).build()?;
        let total = usize::try_from(of.num_rows())?;
        let packing = match chunk.compression() {
            Compression::ZSTD(_) => Packing::Zstd,
            Compression::SNAPPY => Packing::Snappy,
            Compression::UNCOMPRESSED => Packing::Nothing,
            other => {
                return Err(ParquetError::General(format!(
                    "packed by {other}; zstd, snappy and what is not packed are read"
                )));
            }
        };
        let pages = SerializedPageReader::new(Arc::clone(&self.input), &described, total, None)?;
        let of = self.file.metadata().file_metadata().schema_descr().column(index);
        let pages = UnpackedPages::new(pages, packing);
        let given = pages.given();
        Ok((get_column_reader(Arc::clone(&of), Box::new(pages)), of, given))
    }

    fn read(
        &self,
        group: usize,
        column: &str,
        rows: &[Range<usize>],
    ) -> Result<Column, ParquetError> {
        let (reader, of, given) = self.opened(group, column)?;
        let optional = of.max_def_level() > 0;
        if of.max_rep_level() > 0 {
            return Err(ParquetError::General("a column of lists".to_owned()));
        }
        match reader {
            ColumnReader::ByteArrayColumnReader(_) => {
                let all = values::<ByteArrayType>(reader, rows, &given)?;
                Ok(Column::Text(all.into_iter().map(|value| value.map(Word)).collect()))
            }
            ColumnReader::Int64ColumnReader(_) => {
                Ok(Column::Whole(values::<Int64Type>(reader, rows, &given)?))
            }
            ColumnReader::Int32ColumnReader(_) => {
                let all = values::<Int32Type>(reader, rows, &given)?;
                Ok(Column::Whole(all.into_iter().map(|value| value.map(i64::from)).collect()))
            }
            ColumnReader::DoubleColumnReader(_) => {
                Ok(Column::Real(values::<DoubleType>(reader, rows, &given)?))
            }
            ColumnReader::FloatColumnReader(_) if !optional => Ok(Column::Single(
                values::<FloatType>(reader, rows, &given)?.into_iter().flatten().collect(),
            )),
            ColumnReader::BoolColumnReader(_) if !optional => Ok(Column::Flag(
                values::<BoolType>(reader, rows, &given)?.into_iter().flatten().collect(),
            )),
            // Those of strangers, in which a value may be missing.
            ColumnReader::FloatColumnReader(_) => {
                let all = values::<FloatType>(reader, rows, &given)?;
                Ok(Column::Real(all.into_iter().map(|value| value.map(f64::from)).collect()))
            }
            ColumnReader::BoolColumnReader(_) => {
                let all = values::<BoolType>(reader, rows, &given)?;
                Ok(Column::Whole(all.into_iter().map(|value| value.map(i64::from)).collect()))
            }
            _ => Err(ParquetError::General("a column of another kind".to_owned())),
        }
    }
}

fn values<T: DataType>(
    reader: ColumnReader,
    rows: &[Range<usize>],
    given: &AtomicUsize,
) -> Result<Vec<Option<T::T>>, ParquetError> {
    let mut reader = get_typed_column_reader::<T>(reader);
    let wanted = rows.iter().map(ExactSizeIterator::len).sum();
    // A table of strangers may say anything of its rows.
    let mut all = Vec::with_capacity(usize::min(wanted, MOST_AT_ONCE));
    let (mut dense, mut levels, mut at) = (Vec::new(), Vec::new(), 0);
    for range in rows {
        given.store(0, Ordering::Relaxed);
        let skipped = reader.skip_records(range.start.saturating_sub(at))?;
        at += skipped;
        dense.clear();
        levels.clear();
        let (read, count, _) =
            reader.read_records(range.len(), Some(&mut levels), None, &mut dense)?;
        if at != range.start || read != range.len() {
            return Err(ParquetError::General("fewer rows than it says".to_owned()));
        }
        at += read;
        if levels.is_empty() {
            all.extend(dense.drain(..count).map(Some));
        } else {
            let mut values = dense.drain(..);
            all.extend(levels.iter().map(|level| if *level > 0 { values.next() } else { None }));
        }
    }
    Ok(all)
}

/// Rows for which there is room before any is read.
const MOST_AT_ONCE: usize = 1 << 20;
/// Rows of lists that are read at once.
const ROWS_AT_ONCE: usize = 1024;

fn lists<T: DataType>(
    reader: ColumnReader,
    deepest: i16,
    rows: Range<usize>,
    width: usize,
    given: &AtomicUsize,
    number: impl Fn(T::T) -> f64,
) -> Result<Vec<Vec<f64>>, ParquetError> {
    let wrong = |got: String| Err(ParquetError::General(got));
    let mut reader = get_typed_column_reader::<T>(reader);
    let mut at = 0;
    while at < rows.start {
        given.store(0, Ordering::Relaxed);
        let skipped = reader.skip_records((rows.start - at).min(ROWS_AT_ONCE))?;
        if skipped == 0 {
            return wrong("fewer rows than it says".to_owned());
        }
        at += skipped;
    }
    let mut all = Vec::new();
    let (mut dense, mut levels, mut starts) = (Vec::new(), Vec::new(), Vec::new());
    while at < rows.end {
        given.store(0, Ordering::Relaxed);
        dense.clear();
        levels.clear();
        starts.clear();
        let most = (rows.end - at).min(ROWS_AT_ONCE);
        let (read, count, _) =
            reader.read_records(most, Some(&mut levels), Some(&mut starts), &mut dense)?;
        if read == 0 {
            return wrong("fewer rows than it says".to_owned());
        }
        if count != read * width
            || levels.iter().any(|level| *level != deepest)
            || starts.iter().enumerate().any(|(n, start)| (n % width == 0) != (*start == 0))
        {
            return wrong(format!(
                "a row with more or fewer than {width}",
                width = counted(width, "number")
            ));
        }
        let mut values = dense.drain(..).map(&number);
        all.extend((0..read).map(|_| values.by_ref().take(width).collect::<Vec<f64>>()));
        at += read;
    }
    Ok(all)
}

fn unreadable(cause: ParquetError, path: &Path) -> Error {
    let kind = of_system(&cause).map_or(ErrorKind::Malformed, Into::into);
    Error::of(kind, "the table cannot be read")
        .at(path.display().to_string())
        .got(cause.to_string())
}

fn unwritable(cause: ParquetError) -> Error {
    unwritten("the table cannot be written", &cause)
}

/// What the system said when a table was to be written, with what to do about it.
pub fn unwritten(what: &str, cause: &ParquetError) -> Error {
    match of_system(cause) {
        Some(io) => Error::unwritten(what, io),
        None => Error::of(ErrorKind::Io, what).got(cause.to_string()),
    }
}

fn of_system(cause: &ParquetError) -> Option<&io::Error> {
    let ParquetError::External(inner) = cause else { return None };
    inner.downcast_ref()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schema() -> TableSchema {
        let columns = [
            ("word", ColumnKind::Text),
            ("count", ColumnKind::Whole),
            ("size_m", ColumnKind::Real),
            ("angle_rad", ColumnKind::Single),
            ("is", ColumnKind::Flag),
        ];
        let columns = columns.map(|(name, kind)| (name.to_owned(), kind)).to_vec();
        TableSchema::new("rows", columns, &[]).expect("a schema")
    }

    /// Rows of every kind, with gaps, from `from` on.
    fn group(from: i64, rows: i64) -> Vec<Column> {
        let all = || from..from + rows;
        let some = |n: i64, each: i64| n % each != 0;
        vec![
            Column::Text(
                all().map(|n| some(n, 7).then(|| Word::from(&*format!("w{}", n % 13)))).collect(),
            ),
            Column::Whole(all().map(|n| some(n, 5).then_some(n)).collect()),
            Column::Real(all().map(|n| some(n, 3).then_some(n as f64 / 8.0)).collect()),
            Column::Single(all().map(|n| n as f32 / 4.0).collect()),
            Column::Flag(all().map(|n| n % 2 == 0).collect()),
        ]
    }

    fn written(name: &str, groups: &[Vec<Column>]) -> std::path::PathBuf {
        let path =
            std::env::temp_dir().join(format!("columnar-{name}-{}.parquet", std::process::id()));
        let schema = schema();
        let notes = vec![("about".to_owned(), "a test".to_owned())];
        let file = File::create(&path).expect("a file");
        let mut table = TableFile::new(&schema, file, notes).expect("a table");
        groups.iter().for_each(|group| table.write(group).expect("a row group"));
        table.finish().expect("an end");
        path
    }

    #[test]
    fn what_is_written_is_read_back_and_of_some_rows_those_alone() {
        let groups = [group(0, 5000), group(5000, 77)];
        let table = TableReader::open(&written("back", &groups)).expect("a table");
        assert_eq!((table.groups(), table.rows(), table.note("about")), (2, 5077, Some("a test")));
        for (index, (name, _)) in schema().columns().iter().enumerate() {
            for (group, columns) in groups.iter().enumerate() {
                assert_eq!(table.column(group, name, None).expect("a column"), columns[index]);
            }
            let some = table.column(0, name, Some(&[3..5, 4000..4003])).expect("rows");
            let picked = [3, 4, 4000, 4001, 4002];
            assert_eq!(some.len(), picked.len());
            for (at, row) in picked.into_iter().enumerate() {
                assert_eq!(some.text(at), groups[0][index].text(row));
                assert_eq!(some.real(at), groups[0][index].real(row));
                assert_eq!(some.flag(at), groups[0][index].flag(row));
            }
        }
        assert!(table.column(0, "other", None).is_err());
        assert!(
            table.column(0, "is", Some(&[3..5, 4000..6000])).is_err(),
            "more rows than there are"
        );
    }

    #[test]
    fn statistics_say_between_which_values_a_group_lies() {
        let empty = vec![
            Column::Text(vec![None; 3]),
            Column::Whole(vec![None; 3]),
            Column::Real(vec![None; 3]),
            Column::Single(vec![1.0; 3]),
            Column::Flag(vec![true; 3]),
        ];
        let table = TableReader::open(&written("spans", &[group(1, 100), empty])).expect("a table");
        assert_eq!(table.span(0, "word"), Span::Text(b"w0".to_vec(), b"w9".to_vec()));
        assert_eq!(table.span(0, "count"), Span::Real(1.0, 99.0));
        assert_eq!(table.span(0, "angle_rad"), Span::Real(0.25, 25.0));
        assert_eq!(table.span(0, "is"), Span::Flag(false, true));
        assert_eq!(table.span(1, "size_m"), Span::Nothing);
        assert_eq!(table.span(0, "other"), Span::Unknown);
    }

    #[test]
    fn a_file_that_was_cut_off_or_changed_is_said_and_nothing_breaks() {
        let path = written("cut", &[group(0, 300)]);
        let whole = std::fs::read(&path).expect("bytes");
        for length in (0..whole.len()).step_by(97) {
            std::fs::write(&path, &whole[..length]).expect("a file");
            assert!(TableReader::open(&path).is_err(), "{length} bytes");
        }
        for at in (0..whole.len()).step_by(31) {
            let mut changed = whole.clone();
            changed[at] ^= 0x5a;
            std::fs::write(&path, &changed).expect("a file");
            if let Ok(table) = TableReader::open(&path) {
                for (name, _) in schema().columns() {
                    let _ = table.column(0, name, None);
                    let _ = table.span(0, name);
                }
            }
        }
    }
}
