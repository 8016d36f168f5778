//! Corpora as Parquet files: poses, the actionlets they were made from, and a row for each variation.
//!
//! Numbers are split by place and compressed by zstd; with statistics of every column, so that a query
//! that asks for a class or a few variations skips the row groups that have none of them.

use crate::action::corpus::{Batch, Corpus, Pieces, VariationRow};
use crate::action::frames;
use crate::body::Dof;
use crate::columnar;
use crate::columnar::pages::ZstdPages;
use crate::error::{Error, ErrorKind, counted};
use bytes::Bytes;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::column::writer::{
    ColumnCloseResult, get_column_writer, get_typed_column_writer_mut as typed,
};
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DoubleType, FloatType, Int32Type, Int64Type,
};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, RowGroupMetaData};
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesPtr};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::statistics::Statistics;
use parquet::file::writer::{SerializedFileWriter, SerializedPageWriter, TrackedWrite};
use parquet::schema::parser::parse_message_type;
use parquet::schema::types::{ColumnPath, SchemaDescriptor, TypePtr};
use std::borrow::Cow;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A column of a row group: its values.
enum Values<'a> {
    Whole(Cow<'a, [i32]>),
    Long(Vec<i64>),
    /// A number without a sign, the same in all rows.
    Natural(u64, usize),
    Real(Cow<'a, [f32]>),
    Double(Cow<'a, [f64]>),
    Flag(&'a [bool]),
    /// The same in all rows.
    Word(&'a str, usize),
    Words(Vec<&'a str>),
    /// `values` one list after the other.
    Lists {
        lengths: &'a [usize],
        values: &'a [f64],
    },
}

/// A column and what it is called.
struct Column<'a> {
    name: String,
    values: Values<'a>,
}

impl<'a> Column<'a> {
    fn new(name: impl Into<String>, values: Values<'a>) -> Self {
        Self { name: name.into(), values }
    }

    fn schema(&self) -> String {
        let name = &self.name;
        match self.values {
            Values::Whole(_) => format!("required int32 {name}; "),
            Values::Long(_) => format!("required int64 {name}; "),
            Values::Natural(..) => format!("required int64 {name} (INTEGER(64,false)); "),
            Values::Real(_) => format!("required float {name}; "),
            Values::Double(_) => format!("required double {name}; "),
            Values::Flag(_) => format!("required boolean {name}; "),
            Values::Word(..) | Values::Words(_) => format!("required binary {name} (STRING); "),
            Values::Lists { .. } => {
                format!(
                    "required group {name} (LIST) {{ repeated group list {{ required double \
                     element; }} }} "
                )
            }
        }
    }

    /// Bytes of a number that are split by place; 1 if they are not.
    fn places(&self) -> usize {
        match self.values {
            Values::Real(_) if !self.repeats() => 4,
            Values::Double(_) => 8,
            _ => 1,
        }
    }

    /// Whether it has few different values, which are told once.
    fn repeats(&self) -> bool {
        match self.values {
            Values::Whole(_) | Values::Word(..) | Values::Words(_) => true,
            // The times of all variations are the same; a stature is one for each.
            Values::Real(_) => ["time_s", "stature_m"].contains(&self.name.as_str()),
            _ => false,
        }
    }
}

/// A row group of one file, packed: its columns, and what the file is to know of each.
struct Group(Vec<(Bytes, ColumnCloseResult)>);

/// A row group of poses and one of actionlets, packed, and the variations in them.
pub struct Packed {
    poses: Group,
    pieces: Group,
    rows: Vec<VariationRow>,
}

impl Packed {
    /// What it takes on the disk, bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let columns = self.poses.0.iter().chain(&self.pieces.0);
        // Of each column the end of a file says where it is and what it holds.
        columns.map(|(bytes, _)| bytes.len() as u64 + ABOUT_COLUMN).sum()
    }

    /// Its variations.
    #[must_use]
    pub fn rows(&self) -> &[VariationRow] {
        &self.rows
    }

    /// Its poses.
    #[must_use]
    pub fn poses(&self) -> u64 {
        self.rows.iter().map(|row| row.poses as u64).sum()
    }
}

/// Under this name a file tells how it was made.
pub const NOTES: &str = "gaitway";
/// Under these names the file of variations tells how long those beside it are.
const POSES_BYTES: &str = "gaitway.poses_bytes";
const PIECES_BYTES: &str = "gaitway.actionlets_bytes";

/// What the end of a file says of a column of a row group takes, about, bytes.
const ABOUT_COLUMN: u64 = 130;

/// What all rows of a class have in common.
struct Common {
    label: String,
    class: String,
    subject: String,
    seed: u64,
    rounds: i32,
}

/// How the three files of a class are laid out.
pub struct TableLayout {
    common: Common,
    poses: Table,
    pieces: Table,
    variations: Table,
}

struct Table {
    schema: TypePtr,
    columns: SchemaDescriptor,
    properties: WriterPropertiesPtr,
}

impl Table {
    fn new(name: &str, of: &[Column<'_>], notes: &str) -> Result<Self, ParquetError> {
        let columns: String = of.iter().map(Column::schema).collect();
        let schema = Arc::new(parse_message_type(&format!("message {name} {{ {columns} }}"))?);
        let notes = KeyValue::new(NOTES.to_owned(), notes.to_owned());
        let mut properties = WriterProperties::builder()
            .set_compression(Compression::UNCOMPRESSED)
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_offset_index_disabled(true)
            .set_key_value_metadata(Some(vec![notes]))
            .set_created_by("gaitway".to_owned());
        for column in of {
            let path = ColumnPath::from(column.name.as_str());
            if column.repeats() {
                properties = properties.set_column_dictionary_enabled(path, true);
            } else if column.places() > 1 {
                properties = properties.set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT);
            }
        }
        let columns = SchemaDescriptor::new(Arc::clone(&schema));
        Ok(Self { schema, columns, properties: Arc::new(properties.build()) })
    }

    fn begun<W: Write + Send>(&self, file: W) -> Result<SerializedFileWriter<W>, ParquetError> {
        SerializedFileWriter::new(file, Arc::clone(&self.schema), Arc::clone(&self.properties))
    }

    fn packed(&self, columns: &[Column<'_>]) -> Result<Group, ParquetError> {
        let packed = columns.iter().enumerate().map(|(index, column)| self.column(index, column));
        packed.collect::<Result<_, _>>().map(Group)
    }

    fn column(
        &self,
        index: usize,
        column: &Column<'_>,
    ) -> Result<(Bytes, ColumnCloseResult), ParquetError> {
        let mut sink = TrackedWrite::new(Vec::new());
        let pages = ZstdPages::new(SerializedPageWriter::new(&mut sink), column.places());
        let of = self.columns.column(index);
        let mut writer = get_column_writer(of, Arc::clone(&self.properties), Box::new(pages));
        match &column.values {
            Values::Whole(all) => typed::<Int32Type>(&mut writer).write_batch(all, None, None)?,
            Values::Long(all) => typed::<Int64Type>(&mut writer).write_batch(all, None, None)?,
            Values::Natural(value, count) => {
                let all = vec![value.cast_signed(); *count];
                typed::<Int64Type>(&mut writer).write_batch(&all, None, None)?
            }
            Values::Real(all) => typed::<FloatType>(&mut writer).write_batch(all, None, None)?,
            Values::Double(all) => typed::<DoubleType>(&mut writer).write_batch(all, None, None)?,
            Values::Flag(all) => typed::<BoolType>(&mut writer).write_batch(all, None, None)?,
            Values::Word(word, count) => {
                let all = vec![ByteArray::from(*word); *count];
                typed::<ByteArrayType>(&mut writer).write_batch(&all, None, None)?
            }
            Values::Words(words) => {
                let all: Vec<ByteArray> = words.iter().map(|word| ByteArray::from(*word)).collect();
                typed::<ByteArrayType>(&mut writer).write_batch(&all, None, None)?
            }
            Values::Lists { lengths, values } => {
                let (defined, repeated) = levels(lengths);
                let writer = typed::<DoubleType>(&mut writer);
                writer.write_batch(values, Some(&defined), Some(&repeated))?
            }
        };
        let mut close = writer.close()?;
        let packed = Compression::ZSTD(ZstdLevel::default());
        close.metadata = close.metadata.into_builder().set_compression(packed).build()?;
        Ok((Bytes::from(sink.into_inner()?), close))
    }
}

/// Definition and repetition levels of lists: by the format's encoding of nested columns (Parquet,
/// "Nested Encoding"), an empty list is one level without a value; repetition 0 begins a list, 1 goes
/// on with it.
fn levels(lengths: &[usize]) -> (Vec<i16>, Vec<i16>) {
    let (mut defined, mut repeated) = (Vec::new(), Vec::new());
    for length in lengths {
        defined.resize(defined.len() + (*length).max(1), i16::from(*length > 0));
        repeated.push(0);
        repeated.resize(defined.len(), 1);
    }
    (defined, repeated)
}

/// Where a variation is in the file of poses, and what it is.
struct Placed {
    row_group: usize,
    first_row: u64,
    row: VariationRow,
}

impl Common {
    fn poses<'a>(&'a self, batch: &'a Batch) -> Vec<Column<'a>> {
        let poses = batch.variation.len();
        let real = |all: &'a Vec<f32>| Values::Real(Cow::from(all));
        let mut columns = vec![
            Column::new("variation", Values::Whole(Cow::from(&batch.variation))),
            Column::new("time_s", real(&batch.time_s)),
        ];
        let angles = Dof::ALL.map(|dof| format!("{}_rad", dof.name()));
        let root = ["x", "y", "z"].map(|axis| format!("root_{axis}_m"));
        let turned = ["w", "x", "y", "z"].map(|part| format!("root_q{part}"));
        let names = angles.into_iter().chain(root).chain(turned);
        let reals = batch.angles_rad.iter().chain(&batch.root_m).chain(&batch.pelvis);
        columns.extend(names.zip(reals).map(|(name, all)| Column::new(name, real(all))));
        for (sole, all) in frames::SOLES.iter().zip(&batch.carries) {
            columns.push(Column::new(format!("contact_{sole}"), Values::Flag(all)));
        }
        columns.extend(self.of_all(poses, batch.stature_m.clone()));
        let axes = frames::point_names()
            .flat_map(|point| ["x", "y", "z"].map(|axis| format!("{point}_{axis}_m")));
        columns.extend(axes.zip(&batch.points_m).map(|(name, all)| Column::new(name, real(all))));
        columns
    }

    fn pieces<'a>(&'a self, pieces: &'a Pieces) -> Vec<Column<'a>> {
        let mut columns = Vec::new();
        for (name, all) in
            [("variation", &pieces.variation), ("dof", &pieces.dof), ("shape", &pieces.shape)]
        {
            columns.push(Column::new(name, Values::Whole(Cow::from(all))));
        }
        for (name, all) in [
            ("begin_s", &pieces.begin_s),
            ("duration_s", &pieces.duration_s),
            ("from_rad", &pieces.from_rad),
            ("to_rad", &pieces.to_rad),
            ("peak", &pieces.peak),
        ] {
            columns.push(Column::new(name, Values::Double(Cow::from(all))));
        }
        let lists = Values::Lists { lengths: &pieces.sample_count, values: &pieces.samples };
        columns.push(Column::new("samples", lists));
        let rows = pieces.variation.len();
        columns.push(Column::new("label", Values::Word(&self.label, rows)));
        columns.push(Column::new("class", Values::Word(&self.class, rows)));
        columns
    }

    fn of_all(&self, rows: usize, stature_m: Vec<f32>) -> [Column<'_>; 4] {
        [
            Column::new("label", Values::Word(&self.label, rows)),
            Column::new("class", Values::Word(&self.class, rows)),
            Column::new("subject", Values::Word(&self.subject, rows)),
            Column::new("stature_m", Values::Real(stature_m.into())),
        ]
    }

    fn variations<'a>(&'a self, rows: &'a [Placed], file: &'a str) -> Vec<Column<'a>> {
        let count = rows.len();
        let numbers: Vec<i32> = rows.iter().map(|placed| placed.row.number).collect();
        let durations_s: Vec<f64> = rows.iter().map(|placed| placed.row.duration_s).collect();
        // At most as many as draws.
        let rejected: Vec<i32> = rows.iter().map(|placed| placed.row.rejected as i32).collect();
        let states = rows.iter().map(|placed| placed.row.status.name()).collect();
        let long = |of: fn(&Placed) -> u64| {
            Values::Long(rows.iter().map(|placed| of(placed).cast_signed()).collect())
        };
        let mut columns = vec![Column::new("variation", Values::Whole(numbers.into()))];
        let stature_m = rows.iter().map(|placed| placed.row.stature_m as f32).collect();
        columns.extend(self.of_all(count, stature_m));
        columns.extend([
            Column::new("seed", Values::Natural(self.seed, count)),
            Column::new("duration_s", Values::Double(durations_s.into())),
            Column::new("rounds", Values::Whole(vec![self.rounds; count].into())),
            Column::new("status", Values::Words(states)),
            Column::new("rejected", Values::Whole(rejected.into())),
            Column::new("file", Values::Word(file, count)),
            Column::new("row_group", long(|placed| placed.row_group as u64)),
            Column::new("first_row", long(|placed| placed.first_row)),
            Column::new("rows", long(|placed| placed.row.poses as u64)),
        ]);
        columns
    }
}

impl TableLayout {
    /// The layout of a class whose body is called `subject`. `notes` are kept in its files: how they
    /// were made.
    ///
    /// # Errors
    /// If the format cannot hold it.
    pub fn new(corpus: &Corpus, subject: &str, notes: &str) -> Result<Self, Error> {
        let common = Common {
            label: corpus.label.clone(),
            class: corpus.class(),
            subject: subject.to_owned(),
            seed: corpus.seed,
            rounds: i32::try_from(corpus.rounds()).unwrap_or(i32::MAX),
        };
        let mut empty = Batch::default();
        if corpus.has_points {
            empty.points_m.resize(frames::POINTS * 3, Vec::new());
        }
        let table = |name: &str, of: &[Column<'_>]| Table::new(name, of, notes).map_err(unwritable);
        Ok(Self {
            poses: table("poses", &common.poses(&empty))?,
            pieces: table("actionlets", &common.pieces(&empty.pieces))?,
            variations: table("variations", &common.variations(&[], ""))?,
            common,
        })
    }

    /// A batch as one row group of each file, packed.
    ///
    /// # Errors
    /// If the format cannot hold it.
    pub fn pack(&self, batch: Batch) -> Result<Packed, Error> {
        Ok(Packed {
            poses: self.poses.packed(&self.common.poses(&batch)).map_err(unwritable)?,
            pieces: self.pieces.packed(&self.common.pieces(&batch.pieces)).map_err(unwritable)?,
            rows: batch.rows,
        })
    }
}

/// Three files of a class that grow together.
pub struct CorpusWriter<'a, W: Write + Send> {
    layout: &'a TableLayout,
    /// What the file of poses is called.
    file: String,
    poses: SerializedFileWriter<W>,
    pieces: SerializedFileWriter<W>,
    variations: SerializedFileWriter<W>,
    row_groups: usize,
    rows: Vec<Placed>,
    first_row: u64,
}

impl<'a, W: Write + Send> CorpusWriter<'a, W> {
    /// Begins the files of poses, which will be called `file`, of actionlets and of variations.
    ///
    /// # Errors
    /// If one cannot be written.
    pub fn new(layout: &'a TableLayout, file: &str, into: [W; 3]) -> Result<Self, Error> {
        let [poses, pieces, variations] = into;
        Ok(Self {
            layout,
            file: file.to_owned(),
            poses: layout.poses.begun(poses).map_err(unwritable)?,
            pieces: layout.pieces.begun(pieces).map_err(unwritable)?,
            variations: layout.variations.begun(variations).map_err(unwritable)?,
            row_groups: 0,
            rows: Vec::new(),
            first_row: 0,
        })
    }

    /// Goes on with another class: the files then hold several.
    pub const fn turn_to(&mut self, layout: &'a TableLayout) {
        self.layout = layout;
    }

    /// Appends a row group of poses and one of actionlets.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&mut self, packed: Packed) -> Result<(), Error> {
        append(&mut self.poses, packed.poses).map_err(unwritable)?;
        append(&mut self.pieces, packed.pieces).map_err(unwritable)?;
        for row in packed.rows {
            let placed = Placed { row_group: self.row_groups, first_row: self.first_row, row };
            self.first_row += placed.row.poses as u64;
            self.rows.push(placed);
        }
        self.row_groups += 1;
        Ok(())
    }

    /// Writes the variations since the last call as a row group.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn end_class(&mut self) -> Result<(), Error> {
        let rows = std::mem::take(&mut self.rows);
        let columns = self.layout.common.variations(&rows, &self.file);
        let group = self.layout.variations.packed(&columns).map_err(unwritable)?;
        append(&mut self.variations, group).map_err(unwritable)
    }

    /// Completes all files. That of variations says how long the others are.
    ///
    /// # Errors
    /// If one cannot be written.
    pub fn finish(mut self) -> Result<(), Error> {
        self.end_class()?;
        for (file, key) in [(&mut self.poses, POSES_BYTES), (&mut self.pieces, PIECES_BYTES)] {
            file.finish().map_err(unwritable)?;
            let length = file.bytes_written().to_string();
            self.variations.append_key_value_metadata(KeyValue::new(key.to_owned(), length));
        }
        self.variations.finish().map_err(unwritable)?;
        Ok(())
    }
}

fn append<W: Write + Send>(
    file: &mut SerializedFileWriter<W>,
    group: Group,
) -> Result<(), ParquetError> {
    let mut into = file.next_row_group()?;
    for (bytes, close) in group.0 {
        into.append_column(&bytes, close)?;
    }
    into.close().map(|_| ())
}

/// How long the last part of a Parquet file is, which tells how long its end is, bytes.
const TAIL_BYTES: u64 = 8;

/// What a file says of itself at its end.
struct TableEnd {
    length: u64,
    /// The number of its first variation.
    first: Option<i32>,
    rows: u64,
    notes: Vec<KeyValue>,
}

impl TableEnd {
    fn of(path: &Path) -> Result<Self, ParquetError> {
        // A pipe would be waited for.
        if !path.metadata()?.is_file() {
            return Err(ParquetError::General("it is no file".to_owned()));
        }
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        let mut tail = [0; 4];
        if length >= TAIL_BYTES {
            file.seek(SeekFrom::End(-(TAIL_BYTES as i64)))?;
            file.read_exact(&mut tail)?;
        }
        let reader = SerializedFileReader::new(file)?;
        let of = reader.metadata();
        let columns = of.row_groups().iter().flat_map(RowGroupMetaData::columns);
        let ends = columns.flat_map(|column| {
            let (begin, bytes) = column.byte_range();
            let index = |at: Option<i64>, bytes: Option<i32>| {
                u64::try_from(at?).ok()?.checked_add(u64::try_from(bytes?).ok()?)
            };
            [
                begin.checked_add(bytes),
                index(column.column_index_offset(), column.column_index_length()),
                index(column.offset_index_offset(), column.offset_index_length()),
            ]
        });
        let told = ends.flatten().max().unwrap_or(0);
        let told =
            told.saturating_add(u64::from(u32::from_le_bytes(tail))).saturating_add(TAIL_BYTES);
        if told != length {
            return Err(ParquetError::General(format!(
                "{length}; by its end {told}",
                length = counted(length, "byte")
            )));
        }
        let numbers = of.row_groups().first().and_then(|group| group.columns().first());
        let first = match numbers.and_then(|column| column.statistics()) {
            Some(Statistics::Int32(numbers)) => numbers.min_opt().copied(),
            _ => None,
        };
        let of = of.file_metadata();
        Ok(Self {
            length,
            first,
            rows: u64::try_from(of.num_rows()).unwrap_or(0),
            notes: of.key_value_metadata().cloned().unwrap_or_default(),
        })
    }

    fn note(&self, key: &str) -> Option<&str> {
        self.notes.iter().find(|note| note.key == key)?.value.as_deref()
    }
}

/// A set of three files, as far as their ends tell: they belong together, and are as long as they were when
/// they were written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SetEnd {
    /// How many variations it has.
    pub variations: u64,
    /// The number of the first.
    pub first: Option<i32>,
    /// How they were made, as was noted.
    pub notes: Option<String>,
}

impl SetEnd {
    /// Looks at files of poses, actionlets and variations. Their pages are not read: a byte that changed in the
    /// middle of a file is not seen.
    ///
    /// # Errors
    /// Which file is not whole, and why.
    pub fn of(paths: &[PathBuf; 3]) -> Result<Self, Error> {
        let wrong = |path: &Path, got: String| {
            Error::of(ErrorKind::Malformed, "this file of the corpus is not whole, or another")
                .at(path.display().to_string())
                .got(got)
        };
        let end = |path: &Path| TableEnd::of(path).map_err(|e| wrong(path, e.to_string()));
        let [poses, pieces, variations] = paths;
        let rows = end(variations)?;
        for (path, key) in [(poses, POSES_BYTES), (pieces, PIECES_BYTES)] {
            let found = end(path)?;
            let length = found.length.to_string();
            if rows.note(key) != Some(&length) {
                let was = rows.note(key).unwrap_or("unknown");
                return Err(wrong(
                    path,
                    format!("{length}; when it was made {was}", length = counted(length, "byte")),
                ));
            }
            if found.note(NOTES) != rows.note(NOTES) || found.first != rows.first {
                return Err(wrong(path, "made otherwise than those beside it".to_owned()));
            }
        }
        let notes = rows.note(NOTES).map(str::to_owned);
        Ok(Self { variations: rows.rows, first: rows.first, notes })
    }
}

fn unwritable(cause: ParquetError) -> Error {
    columnar::unwritten("cannot write the corpus", &cause)
}
