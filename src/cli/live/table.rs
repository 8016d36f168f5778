//! Joint angles of a body as a person reads them.

use crate::body::{Dof, JointAngles, Segment};
use crate::cli::Remarks;
use crate::cli::output::{knows_commands, say_over};
use rustix::stdio::stderr;
use rustix::termios::tcgetwinsize;
use std::fmt::Write;

/// The angles that place each segment on the one that carries it.
const ROWS: [(Segment, &[Dof]); 12] = [
    (Segment::Torso, &[Dof::TorsoFlexion, Dof::TorsoLateralBend, Dof::TorsoAxial]),
    (Segment::Head, &[Dof::NeckFlexion]),
    (
        Segment::LeftUpperArm,
        &[Dof::LeftShoulderFlexion, Dof::LeftShoulderAbduction, Dof::LeftShoulderRotation],
    ),
    (Segment::LeftForearm, &[Dof::LeftElbowFlexion]),
    (
        Segment::RightUpperArm,
        &[Dof::RightShoulderFlexion, Dof::RightShoulderAbduction, Dof::RightShoulderRotation],
    ),
    (Segment::RightForearm, &[Dof::RightElbowFlexion]),
    (Segment::LeftThigh, &[Dof::LeftHipFlexion, Dof::LeftHipAbduction, Dof::LeftHipRotation]),
    (Segment::LeftShank, &[Dof::LeftKneeFlexion]),
    (Segment::LeftFoot, &[Dof::LeftAnkleDorsiflexion]),
    (Segment::RightThigh, &[Dof::RightHipFlexion, Dof::RightHipAbduction, Dof::RightHipRotation]),
    (Segment::RightShank, &[Dof::RightKneeFlexion]),
    (Segment::RightFoot, &[Dof::RightAnkleDorsiflexion]),
];

/// Without a terminal a line is said once in so many tables.
const LINE_EVERY: usize = 4;

/// The table on standard error, each over the one before, or a line now and then without a terminal.
#[derive(Debug, Default)]
pub struct Shown {
    tables: usize,
    lines: usize,
}

impl Shown {
    /// Shows the angles of a moment.
    pub fn show(&mut self, angles: &JointAngles, worn: &[bool; 13], remarks: Remarks) {
        if let Some(columns) = table_columns() {
            let text = cut(&text(angles, worn), columns);
            say_over(self.lines, &text);
            self.lines = text.lines().count();
        } else {
            self.goes_on_below();
            if self.tables.is_multiple_of(LINE_EVERY) {
                remarks.say(&line(angles));
            }
        }
        self.tables += 1;
    }

    /// Something else was said below the table: the next one stands below that.
    pub fn goes_on_below(&mut self) {
        self.lines = 0;
    }
}

/// How wide a terminal is on which the table can be written over and over; `None`: standard error is none, or too low.
fn table_columns() -> Option<usize> {
    let size = tcgetwinsize(stderr()).ok().filter(|_| knows_commands())?;
    // Of some terminals nobody knows how large they are.
    let is_high = size.ws_row == 0 || usize::from(size.ws_row) > ROWS.len();
    is_high.then(|| if size.ws_col == 0 { 80 } else { size.ws_col.into() })
}

/// So much of each line as is seen: one that goes on below would not be written over.
fn cut(text: &str, columns: usize) -> String {
    let line =
        |line: &str| line.chars().take(columns.saturating_sub(1)).chain(['\n']).collect::<String>();
    text.lines().map(line).collect()
}

/// One line per segment: its angles in degrees, and whether a sensor says so.
fn text(angles: &JointAngles, worn: &[bool; 13]) -> String {
    let mut out = String::new();
    for (segment, dofs) in ROWS {
        for dof in dofs {
            let _ = write!(out, "{:<26}{:>7.1} deg  ", dof.name(), angles[*dof].to_degrees());
        }
        out.push_str(if worn[segment.index()] { "\n" } else { "not worn\n" });
    }
    out
}

/// The largest angles in one line, for where there is no terminal.
fn line(angles: &JointAngles) -> String {
    let mut dofs = Dof::ALL;
    dofs.sort_by(|a, b| angles[*b].abs().total_cmp(&angles[*a].abs()));
    let largest = dofs[..5].iter().map(|dof| {
        let degrees = angles[*dof].to_degrees();
        format!("{} {degrees:.1} deg", dof.name())
    });
    largest.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_line_is_longer_than_the_window_and_none_is_left_out() {
        let whole = text(&JointAngles::default(), &[true; 13]);
        assert!(whole.lines().any(|line| line.len() > 100));
        let cut = cut(&whole, 80);
        assert_eq!(cut.lines().count(), ROWS.len());
        let all = cut.lines().zip(whole.lines());
        assert!(all.clone().all(|(cut, whole)| whole.starts_with(cut)));
        assert_eq!(all.map(|(cut, _)| cut.len()).max(), Some(79));
    }

    #[test]
    fn every_angle_is_in_the_table_once_and_what_is_not_worn_is_marked() {
        let listed: Vec<Dof> = ROWS.iter().flat_map(|(_, dofs)| dofs.iter().copied()).collect();
        assert_eq!(listed.len(), 22);
        assert!(Dof::ALL.iter().all(|dof| listed.contains(dof)));
        let mut worn = [true; 13];
        worn[Segment::LeftFoot.index()] = false;
        let text = text(&JointAngles::default(), &worn);
        let marked: Vec<&str> = text.lines().filter(|line| line.contains("not worn")).collect();
        assert_eq!(marked.len(), 1);
        assert!(marked[0].contains("ankle"), "{marked:?}");
    }
}
