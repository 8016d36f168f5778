//! Joint angles of a body as a person reads them.

use crate::body::{Dof, JointAngles, Segment};
use crate::cli::Remarks;
use crate::cli::output::say_over;
use std::fmt::Write;
use std::io::IsTerminal;

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
        if std::io::stderr().is_terminal() {
            let text = text(angles, worn);
            say_over(self.lines, &text);
            self.lines = text.lines().count();
        } else if self.tables.is_multiple_of(LINE_EVERY) {
            remarks.say(&line(angles));
        }
        self.tables += 1;
    }
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
