//! A table whose columns nobody here knows: what they are called, and what stands in them.

use crate::error::{Error, ErrorKind};
use crate::job::report::counted;
use crate::table::{self, Row};
use serde::Serialize;
use std::path::Path;

/// Most columns of a table.
const MOST_COLUMNS: usize = 4_096;

/// A table of columns that are not known.
#[derive(Clone, Debug, Serialize)]
pub struct ColumnsOverview {
    /// `columns`.
    pub format: &'static str,
    /// Rows below the titles.
    pub rows: usize,
    /// Rows that have not one cell per column.
    pub uneven_rows: usize,
    /// In their order.
    pub columns: Vec<ColumnFigures>,
    /// What a person should know.
    pub notes: Vec<String>,
}

/// One column.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ColumnFigures {
    /// Its title.
    pub name: String,
    /// Cells that are numbers.
    pub numbers: usize,
    /// Cells with nothing in them.
    pub empty: usize,
    /// Line of the first cell with something in it that is no finite number; null without one.
    pub first_no_number_line: Option<u64>,
    /// Least number; null without one.
    pub least: Option<f64>,
    /// Greatest number; null without one.
    pub greatest: Option<f64>,
    /// True if every row has a number, and each is greater than the one before: perhaps a time.
    pub rises: bool,
}

impl ColumnFigures {
    fn take(&mut self, cell: &str, line: u64, last: &mut f64) {
        let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
        self.empty += usize::from(cell.is_empty());
        self.rises &= number.is_some_and(|number| number > *last);
        let Some(number) = number else {
            if !cell.is_empty() {
                self.first_no_number_line.get_or_insert(line);
            }
            return;
        };
        self.numbers += 1;
        self.least = Some(self.least.map_or(number, |least| least.min(number)));
        self.greatest = Some(self.greatest.map_or(number, |greatest| greatest.max(number)));
        *last = number;
    }
}

/// Looks into the text of a table.
///
/// # Errors
/// A text without rows, or that is no table; too many columns.
pub(super) fn overview(path: &Path, text: &str) -> Result<ColumnsOverview, Error> {
    let no_table = |got: String| {
        Error::of(ErrorKind::Malformed, "this is no table")
            .in_file(path)
            .got(got)
            .allowed("a row of titles, and rows of as many cells")
    };
    let mut rows = table::rows(text);
    let titles = rows.next().transpose().map_err(|error| error.in_file(path))?;
    let titles = titles.ok_or_else(|| no_table("no row".to_owned()))?;
    if titles.width() > MOST_COLUMNS {
        return Err(no_table(counted(titles.width(), "column"))
            .allowed(format!("at most {MOST_COLUMNS} columns")));
    }
    let of_title = |name: &str| ColumnFigures {
        name: name.to_owned(),
        rises: true,
        ..ColumnFigures::default()
    };
    let mut columns: Vec<ColumnFigures> = titles.cells().map(of_title).collect();
    let mut last = vec![f64::NEG_INFINITY; columns.len()];
    let (mut count, mut uneven_rows) = (0, 0);
    for row in rows {
        let row: Row = row.map_err(|error| error.in_file(path))?;
        count += 1;
        uneven_rows += usize::from(row.width() != columns.len());
        for ((column, last), cell) in columns.iter_mut().zip(&mut last).zip(row.cells()) {
            column.take(cell, row.line, last);
        }
    }
    if columns.iter().all(|column| column.numbers == 0) {
        return Err(no_table(format!("{count} without a number", count = counted(count, "row"))));
    }
    for column in &mut columns {
        column.rises &= column.numbers == count && count > 1;
    }
    let note = "no columns of markers (LABEL_x_m, ...), of angles of the body (time_s and left_knee_flexion_rad, ...) \
                or of labels (file and class). Of inertial sensors: declare the columns in a file and say \
                --sensors FILE.toml, here and to convert (docs/capture.md)";
    Ok(ColumnsOverview {
        format: "columns",
        rows: count,
        uneven_rows,
        columns,
        notes: vec![note.to_owned()],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_gaps_and_texts_of_a_column_are_told_apart() {
        let text = "time,gyr_x,who\n0.0,1.5,ann\n0.1,,bob\n0.2,-2,\n";
        let found = overview(Path::new("a.csv"), text).expect("a table");
        assert_eq!((found.rows, found.uneven_rows), (3, 0));
        let of = |at: usize| {
            let column = &found.columns[at];
            (column.name.as_str(), column.numbers, column.empty, column.least, column.rises)
        };
        assert_eq!(of(0), ("time", 3, 0, Some(0.0), true));
        assert_eq!(of(1), ("gyr_x", 2, 1, Some(-2.0), false));
        assert_eq!(of(2), ("who", 0, 1, None, false));
        assert_eq!(found.columns[1].greatest, Some(1.5));
        assert_eq!(found.columns[1].first_no_number_line, None, "an empty cell is no wrong one");
        let found = overview(Path::new("a.csv"), "time,a\n0,1\n\n1,NaN\n2,inf\n").expect("a table");
        assert_eq!((found.columns[1].numbers, found.columns[1].first_no_number_line), (1, Some(4)));
    }

    #[test]
    fn rows_of_another_length_are_counted_and_a_text_without_numbers_is_no_table() {
        let found = overview(Path::new("a.csv"), "a,b\n1,2\n3\n4,5,6\n").expect("a table");
        assert_eq!((found.rows, found.uneven_rows), (3, 2));
        for text in ["", "a,b\n", "a,b\nx,y\n"] {
            let said = overview(Path::new("a.csv"), text).expect_err("no table").to_string();
            assert!(said.contains("a row of titles"), "{said}");
        }
    }
}
