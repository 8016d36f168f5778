//! The text of a draft: data, and what a person is to do with it.

use super::{DraftJoint, DraftLine, RAMP_S, RobotDraft};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Steps of the angles in a draft, rad: finer than any encoder.
const STEP_RAD: f64 = 1e-4;

/// What a person is to do with it.
const HEAD: &str = "\
# A draft, made of what answered on the line. Before it is moved:
# 1. Give each joint its name, and find with `gaitway servo move` which way it turns:
#    direction = -1 turns it round.
# 2. Narrow lower_rad and upper_rad to what the body can do without hitting itself;
#    `gaitway calibrate` finds zero and range by hand.
# 3. Say how fast it may be: velocity_rad_s and acceleration_rad_s2 are chosen here.
# 4. `gaitway profile check` this file, and `gaitway play ... --bus sim` with it first.
# To follow a body (captures, actions, live mirroring) each joint needs origin_m and axis,
# and the robot [anatomy]: see a shipped one with `gaitway profile show op3 --json`.
";

/// The whole file.
pub(super) fn text(draft: &RobotDraft, lines: &[(String, DraftLine)]) -> String {
    let mut out = HEAD.to_owned();
    for note in &draft.notes {
        // Nothing a device says may begin a line of its own.
        let _ = writeln!(out, "# NOTE {}", note.replace(['\n', '\r'], " "));
    }
    let _ = write!(
        out,
        "schema = 1\nname = {:?}\ndescription = \"a draft\"\n\
         source = \"unconfirmed: asked of the devices on the line\"\n\
         acceleration_source = \"assumed: full speed reached in {RAMP_S} s\"\n",
        draft.name
    );
    for (name, line) in lines {
        let _ = write!(out, "\n[[line]]\nname = {name:?}\n");
        let _ = match line {
            DraftLine::Serial { baud_bps } => writeln!(out, "baud_bps = {baud_bps}"),
            DraftLine::Can(speed) => {
                let _ = writeln!(out, "kind = \"can\"\nbitrate_bps = {}", speed.bitrate_bps);
                speed
                    .data_bitrate_bps
                    .map_or(Ok(()), |bps| writeln!(out, "data_bitrate_bps = {bps}"))
            }
        };
    }
    setups(&mut out, &draft.joints);
    for joint in &draft.joints {
        one_joint(&mut out, joint);
    }
    out
}

/// A servo profile, firmware, and registers with their raw values.
type Setup<'a> = (&'a str, u16, Vec<(&'a String, &'a i64)>);

/// Servos that are set up alike stand together.
fn setups(out: &mut String, joints: &[DraftJoint]) {
    let mut alike: BTreeMap<Setup<'_>, Vec<&str>> = BTreeMap::new();
    for joint in joints {
        if let Some((firmware, registers)) = &joint.setup {
            let key = (joint.servo.as_str(), *firmware, registers.iter().collect());
            alike.entry(key).or_default().push(&joint.name);
        }
    }
    for ((servo, firmware, registers), of) in alike {
        let _ = write!(
            out,
            "\n[[setup]]\nservo = {servo:?}\njoints = {of:?}\nfirmware = {firmware}\n\
             source = \"asked of the servos\"\n\n[setup.registers]\n"
        );
        for (name, raw) in registers {
            let _ = writeln!(out, "{name:?} = {raw}");
        }
    }
}

fn one_joint(out: &mut String, joint: &DraftJoint) {
    let DraftJoint { name, line, id, servo, velocity_rad_s, .. } = joint;
    // Inwards, so that no rounding leads beyond what the servo takes.
    let lower_rad = (joint.lower_rad / STEP_RAD).ceil() * STEP_RAD;
    let upper_rad = (joint.upper_rad / STEP_RAD).floor() * STEP_RAD;
    let _ = write!(
        out,
        "\n[[joint]]\nname = {name:?}\nline = {line:?}\nid = {id}\nservo = {servo:?}\n\
         direction = 1\nlower_rad = {lower_rad:.4}\nupper_rad = {upper_rad:.4}\n\
         velocity_rad_s = {velocity_rad_s:.3}\nacceleration_rad_s2 = {:.3}\n",
        velocity_rad_s / RAMP_S
    );
    if let Some(present_rad) = joint.present_rad {
        let initial_rad = present_rad.max(lower_rad).min(upper_rad);
        let _ = writeln!(out, "initial_rad = {initial_rad:.4}");
    }
    if let Some(answer_id) = joint.answer_id {
        let _ = writeln!(out, "answer_id = {answer_id}");
    }
}
