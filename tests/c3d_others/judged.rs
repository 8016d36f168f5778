//! Where readers differ, and who is right by the raw bytes; what is known of files that anybody can get (the
//! samples of c3d.org as they lie in BTKData of the Biomechanical ToolKit, pyCGM's sample data, HDM05).

use gaitway::mocap::parameters::{Parameters, text_of};

/// A difference that was looked into.
pub struct Judged {
    pub file: &'static str,
    pub reader: &'static str,
    pub what: &'static str,
    /// What the bytes say, and whose defect it is.
    pub why: &'static str,
}

const fn judged(
    file: &'static str,
    reader: &'static str,
    what: &'static str,
    why: &'static str,
) -> Judged {
    Judged { file, reader, what, why }
}

const MIPS: &str = "ezc3d: \"MIPS processor type not supported yet\"";
/// 0x0302 is told as a residual of 3 steps, 0x3F0C as one of 6: it takes the byte of the cameras, and the
/// User Guide has the residual in the low one, as c3d and c3dio read it.
const HIGH_BYTE: &str = "ezc3d: takes the byte of the cameras for the residual";

/// Differences when files are read as others wrote them.
pub const JUDGED: &[Judged] = &[
    judged("Dec_real.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("Eb015pi.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("Eb015vr.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("pc_int.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("ADemo1_float.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("FP1.C3D", "ezc3d", "residuals", HIGH_BYTE),
    judged("Gait.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("MotionMonitorC3D.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("PlugInC3D.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("TESTAPI.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("TYPE-2.C3D", "ezc3d", "residuals", HIGH_BYTE),
    judged("sample21.c3d", "ezc3d", "residuals", HIGH_BYTE),
    judged("Eb015sr.c3d", "ezc3d", "refused", MIPS),
    judged("sgi_real.c3d", "ezc3d", "refused", MIPS),
    judged(
        "PiG_Calibration-FlatFoot-Full.c3d",
        "c3d",
        "refused",
        "c3d: a parameter that comes twice (PROCESSING:BODYMASS) is an error to it",
    ),
    judged(
        "1123x01EMG.c3d",
        "c3dio",
        "channels",
        "c3dio: finds no analog data where there are no points; 8 channels of 4564 samples are there",
    ),
    judged("1123x01EMG.c3d", "c3dio", "frames", "c3dio: no frames where there are no points"),
    judged(
        "1123x01EMG.c3d",
        "c3d",
        "refused",
        "c3d: wants POINT:LABELS also where there are no points",
    ),
    judged(
        "ADemo1_float.c3d",
        "c3dio",
        "they see",
        "c3dio: the fourth word is -32768 in 85 samples, whose sign it does not look at",
    ),
    judged(
        "Analysis.c3d",
        "c3dio",
        "analog values",
        "the file: OFFSET -32768, and counts of +32768: the offset is meant unsigned, though FORMAT says SIGNED",
    ),
    judged(
        "Analysis.c3d",
        "c3d",
        "analog values",
        "the file, as above: by the letter all is 65536",
    ),
    judged(
        "Dance.c3d",
        "c3dio",
        "refused",
        "c3dio: ANALOG:OFFSET of real numbers is an error to it",
    ),
    judged(
        "Dance.c3d",
        "ezc3d",
        "refused",
        "ezc3d: ANALOG:OFFSET of real numbers is an error to it",
    ),
    judged(
        "Dance.c3d",
        "c3d",
        "analog values",
        "c3d: leaves out ANALOG:GEN_SCALE, which is -1, so that signs are the other way round",
    ),
    judged(
        "FP1.C3D",
        "c3d",
        "refused",
        "c3d: 120 counts are 12 channels of 10 samples, as the header says",
    ),
    judged(
        "MotionMonitorC3D.c3d",
        "c3dio",
        "refused",
        "c3dio: one unit for 16 channels is an error to it",
    ),
    judged(
        "MotionMonitorC3D.c3d",
        "c3d",
        "refused",
        "the file: 16 counts per frame in the header, 112 by 16 channels of 7 samples, which fill it exactly",
    ),
    judged(
        "badParameterOffset.c3d",
        "c3dio",
        "refused",
        "the file: the offset of its last parameter leads out of the section",
    ),
    judged("badParameterOffset.c3d", "ezc3d", "refused", "the file, as above"),
    judged("badParameterOffset.c3d", "c3d", "refused", "the file, as above"),
    judged("dynamic.C3D", "c3dio", "refused", "c3dio: POINT:UNITS is missing"),
    judged(
        "dynamic.C3D",
        "ezc3d",
        "channels",
        "ezc3d: takes no analog data where POINT:RATE is missing, 6 channels by ANALOG:USED",
    ),
    judged(
        "dynamic.C3D",
        "ezc3d",
        "positions",
        "ezc3d: frames of 544 instead of 568 bytes, so all are shifted",
    ),
    judged("dynamic.C3D", "ezc3d", "residuals", "ezc3d: as above"),
    judged("dynamic.C3D", "ezc3d", "they do not see", "ezc3d: as above"),
    judged("dynamic.C3D", "ezc3d", "they see", "ezc3d: as above"),
];

/// Differences when others read what we wrote.
pub const WRITTEN: &[Judged] = &[
    judged("*", "ezc3d", "residuals", HIGH_BYTE),
    judged("1123x01EMG.c3d", "c3dio", "frames", "c3dio: no frames where there are no points"),
    judged("1123x01EMG.c3d", "c3dio", "channels", "c3dio: nor analog data"),
];

/// What is in a file.
pub struct Opened {
    pub file: &'static str,
    pub frames: usize,
    pub points: usize,
    pub rate_hz: f64,
    pub channels: usize,
    pub samples: usize,
}

const fn opened(
    file: &'static str,
    frames: usize,
    points: usize,
    rate_hz: f64,
    channels: usize,
    samples: usize,
) -> Opened {
    Opened { file, frames, points, rate_hz, channels, samples }
}

pub const OPENED: &[Opened] = &[
    opened("cgm_Movement_trial.c3d", 323, 239, 120.0, 69, 2907),
    opened("cgm_Static_trial.c3d", 498, 179, 120.0, 69, 4482),
    opened("PiG_Motion-FlatFoot-Full.c3d", 315, 193, 100.0, 38, 3150),
    opened("PiG_Calibration-FlatFoot-Full.c3d", 94, 137, 100.0, 38, 940),
    opened("HDM_dg_06-03_03_120.c3d", 202, 44, 120.0, 0, 0),
    opened("Eb015pi.c3d", 450, 26, 50.0, 16, 1800),
    opened("Eb015sr.c3d", 450, 26, 50.0, 16, 1800),
    opened("Eb015vr.c3d", 450, 26, 50.0, 16, 1800),
    opened("Dec_real.c3d", 89, 36, 50.0, 16, 356),
    opened("pc_int.c3d", 89, 36, 50.0, 16, 356),
    opened("sgi_real.c3d", 89, 36, 50.0, 16, 356),
    opened("TESTAPI.c3d", 450, 26, 50.0, 16, 1800),
    opened("PlugInC3D.c3d", 281, 86, 60.0, 36, 5620),
    opened("TYPE-2.C3D", 199, 13, 60.0, 6, 3980),
    opened("Dance.c3d", 499, 40, 65.0533, 8, 499),
    opened("FP1.C3D", 480, 8, 60.0, 12, 4800),
    opened("sample21.c3d", 574, 14, 60.0, 12, 9758),
    opened("MotionMonitorC3D.c3d", 840, 8, 140.0, 16, 5880),
    opened("dynamic.C3D", 296, 34, 100.0, 6, 296),
    opened("1123x01EMG.c3d", 4564, 0, 1000.0, 8, 4564),
    opened("ADemo1_float.c3d", 512, 24, 200.0, 16, 1024),
    opened("Analysis.c3d", 101, 24, 100.0, 16, 101),
    opened("Gait.c3d", 487, 33, 100.0, 28, 4870),
    opened("badParameterOffset.c3d", 111, 41, 250.0, 0, 0),
    opened("parameterOverflow.c3d", 101, 142, 100.0, 36, 101),
];

/// Groups whose parameters must agree with the data, so that the writer corrects them.
const OURS: [&str; 5] = ["POINT", "ANALOG", "EVENT", "TRIAL", "FORCE_PLATFORM"];

/// Fails unless every parameter that nobody here knows was kept byte for byte: name, type, dimensions, data,
/// description and lock.
pub fn keeps_unknown_groups(name: &str, before: &Parameters, after: &Parameters) {
    let mut kept = 0;
    for group in &before.groups {
        let of = text_of(&group.name);
        if OURS.iter().any(|ours| ours.eq_ignore_ascii_case(of.trim())) {
            continue;
        }
        for parameter in &group.parameters {
            // A group that is only a number has to have a name for others to read it.
            let unnamed = format!("GROUP{}", group.id).into_bytes();
            let in_group = after.groups.iter().filter(|after| {
                after.name == group.name || (group.name.is_empty() && after.name == unnamed)
            });
            let mut same = in_group.flat_map(|group| &group.parameters).filter(|after| {
                (after.kind, &after.dimensions, &after.data, after.locked)
                    == (parameter.kind, &parameter.dimensions, &parameter.data, parameter.locked)
                    && after.description == parameter.description
            });
            let what = text_of(&parameter.name);
            assert!(same.next().is_some(), "{name}: {of}:{what} was not kept");
            kept += 1;
        }
    }
    assert!(kept > 0 || before.groups.len() <= OURS.len(), "{name}: {:?}", before.groups.len());
}
