//! Tables of comma-separated values: the one way they are written and read. Cells that hold a comma, a
//! quote or a line break are quoted (RFC 4180).

use crate::error::{Error, ErrorKind};
use std::io::Write;

/// Writes a table row by row.
pub struct TableWriter<W: Write>(csv::Writer<W>);

impl<W: Write> TableWriter<W> {
    /// A table without rows yet. The first row is its titles, and all have its length.
    pub fn new(out: W) -> Self {
        Self(csv::Writer::from_writer(out))
    }

    /// Writes a row.
    ///
    /// # Errors
    /// As the file system says; a row of another length than the first.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl AsRef<[u8]>>) -> Result<(), Error> {
        self.0.write_record(cells).map_err(|cause| unwritable(&cause.into()))
    }

    /// Writes what is not written yet, and gives back where it went.
    ///
    /// # Errors
    /// As the file system says.
    pub fn finish(self) -> Result<W, Error> {
        self.0.into_inner().map_err(|cause| unwritable(cause.error()))
    }
}

fn unwritable(cause: &std::io::Error) -> Error {
    Error::unwritten("the table cannot be written", cause)
}

/// One row of a table, without the blanks around its cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Line of the file in which it begins, the first is 1.
    pub line: u64,
    record: csv::StringRecord,
}

impl Row {
    /// Its cells in their order.
    pub fn cells(&self) -> impl Iterator<Item = &str> + Clone {
        self.record.iter()
    }

    /// How many they are.
    #[must_use]
    pub fn width(&self) -> usize {
        self.record.len()
    }

    /// True if nothing stands in any of its cells.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cells().all(str::is_empty)
    }
}

/// The rows of a table, the first being its titles; empty lines are passed over. Rows may differ in
/// length: what is wrong with that says whoever knows the table.
pub fn rows(text: &str) -> impl Iterator<Item = Result<Row, Error>> + '_ {
    all_rows(text).filter(|row| !row.as_ref().is_ok_and(Row::is_empty))
}

/// Fails if the columns of a table with these titles are separated by semicolons or tabs, as spreadsheets of many
/// countries write them.
///
/// # Errors
/// As said.
pub fn check_commas(titles: &str) -> Result<(), Error> {
    let titles = titles.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let separated = |by: char| !titles.contains(',') && titles.trim().contains(by);
    let Some((_, word)) =
        [(';', "semicolons"), ('\t', "tabs")].into_iter().find(|of| separated(of.0))
    else {
        return Ok(());
    };
    let begins: String = titles.chars().take(60).collect();
    Err(Error::of(
        ErrorKind::Malformed,
        format!("the columns of this table are separated by {word}"),
    )
    .got(begins)
    .allowed("commas between columns, and numbers with a point: 0.5")
    .remedy("write it anew so; a spreadsheet has it as \"CSV, separated by commas\""))
}

/// The same with rows that have cells and nothing in them.
pub fn all_rows(text: &str) -> impl Iterator<Item = Result<Row, Error>> + '_ {
    let refused = check_commas(text).err().map(Err);
    let read = refused.is_none().then(|| rows_of(text));
    refused.into_iter().chain(read.into_iter().flatten())
}

fn rows_of(text: &str) -> impl Iterator<Item = Result<Row, Error>> + '_ {
    let reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let (mut line, mut counted) = (1, 0);
    reader.into_records().map(move |record| {
        let record = record.map_err(|cause| {
            Error::of(ErrorKind::Malformed, "not a table").got(cause.to_string())
        })?;
        // The reader says where it was before it passed over empty lines.
        let start = record.position().map_or(0, |at| usize::try_from(at.byte()).unwrap_or(0));
        let passed = text.as_bytes().get(counted..).unwrap_or_default().iter().enumerate();
        let mut passed =
            passed.take_while(|&(at, &byte)| counted + at < start || matches!(byte, b'\n' | b'\r'));
        let mut read = 0;
        for (at, &byte) in passed.by_ref() {
            line += u64::from(byte == b'\n');
            read = at + 1;
        }
        counted += read;
        Ok(Row { line, record })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back_whatever_stands_in_the_cells() {
        let rows_written =
            [vec!["time_s", "a, b"], vec!["1", "say \"no\""], vec!["2", "two\nlines"]];
        let mut table = TableWriter::new(Vec::new());
        for row in &rows_written {
            table.row(row).expect("a row");
        }
        let text = String::from_utf8(table.finish().expect("a table")).expect("a text");
        let read: Vec<Row> = rows(&text).map(|row| row.expect("a row")).collect();
        assert_eq!(read.iter().map(|row| row.line).collect::<Vec<_>>(), [1, 2, 3]);
        let cells = |row: &Row| row.cells().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(read.iter().map(cells).collect::<Vec<_>>(), rows_written);
    }

    #[test]
    fn a_table_with_semicolons_or_tabs_says_so_and_one_of_a_single_column_is_one() {
        for (text, word) in [("a;b\n0,5;1\n", "semicolons"), ("\na\tb\n1\t2\n", "tabs")] {
            let refused = rows(text).next().expect("a refusal").expect_err(word);
            assert!(refused.what.ends_with(word), "{refused}");
            assert_eq!(rows(text).count(), 1, "and no row");
        }
        for text in ["a\n1;2\n", "a, b;c\n", "", "\n\n", "a\t\n1\n"] {
            assert!(rows(text).all(|row| row.is_ok()), "{text:?}");
        }
    }

    #[test]
    fn plain_cells_are_written_as_they_are_and_lines_end_as_in_a_text() {
        let mut table = TableWriter::new(Vec::new());
        table.row(["a", "b"]).and_then(|()| table.row(["", "-1.5"])).expect("rows");
        assert_eq!(table.finish().expect("a table"), b"a,b\n,-1.5\n");
        let mut table = TableWriter::new(Vec::new());
        table.row(["a", "b"]).expect("titles");
        assert!(table.row(["alone"]).is_err(), "a row that lacks a cell");
    }

    #[test]
    fn lines_are_counted_with_those_passed_over_and_blanks_are_no_part_of_a_cell() {
        let text = "\u{feff}time_s, a_rad \r\n\r\n   \r\n0 ,1\n1,2,3\n";
        let read: Vec<Row> = rows(text).map(|row| row.expect("a row")).collect();
        let read: Vec<(u64, Vec<&str>)> =
            read.iter().map(|row| (row.line, row.cells().collect())).collect();
        let expected =
            [(1, vec!["time_s", "a_rad"]), (4, vec!["0", "1"]), (5, vec!["1", "2", "3"])];
        assert_eq!(read, expected);
    }
}
