//! Robots on CAN lines, as files.

use std::fmt::Write;

/// Joints of a leg, with the gains and the speed of each.
const LEG: [&str; 6] = ["hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll"];

/// What a fixture needs of an actuator besides its name.
#[derive(Clone, Copy)]
pub struct Kind {
    pub servo: &'static str,
    /// Keys of its joints besides those that all have; `{id}` stands for the id.
    pub keys: &'static str,
    /// Further keys of the line.
    pub line: &'static str,
}

/// Told their gains; the watch over the host is a register.
pub const DAMIAO: Kind = Kind {
    servo: "dm4310",
    keys: "answer_id = {answer}\nkp_nm_rad = 40.0\nkd_nm_s_rad = 1.5",
    line: "bitrate_bps = 1000000",
};
/// Its watch is set with the maker's tool.
pub const CUBEMARS: Kind = Kind {
    servo: "ak80-9",
    keys: "kp_nm_rad = 40.0\nkd_nm_s_rad = 1.5\ntimeout_configured_s = 0.2",
    line: "bitrate_bps = 1000000",
};
pub const ROBSTRIDE: Kind = Kind {
    servo: "rs02",
    keys: "kp_nm_rad = 40.0\nkd_nm_s_rad = 1.5",
    line: "bitrate_bps = 1000000",
};
/// Keeps its own gains and asks to be asked.
pub const ODRIVE: Kind =
    Kind { servo: "odrive-s1", keys: "timeout_configured_s = 0.2", line: "bitrate_bps = 1000000" };
/// CAN FD; each goal says how long it holds.
pub const MOTEUS: Kind = Kind {
    servo: "moteus-r4",
    keys: "",
    line: "bitrate_bps = 1000000\ndata_bitrate_bps = 5000000",
};
pub const RECOIL: Kind = Kind {
    servo: "recoil-5010",
    keys: "timeout_configured_s = 1.0",
    line: "bitrate_bps = 1000000",
};
pub const CUBEMARS_SERVO: Kind = Kind {
    servo: "ak80-9-servo",
    keys: "timeout_configured_s = 0.2",
    line: "bitrate_bps = 1000000",
};

/// The keys every joint has. It turns by 1 rad to either side, as fast as a small leg.
fn joint(out: &mut String, name: &str, line: &str, servo: &str, id: usize, keys: &str) {
    let keys = keys.replace("{answer}", &(0x10 + id).to_string());
    let _ = write!(
        out,
        "[[joint]]\nname = \"{name}\"\nline = \"{line}\"\nid = {id}\nservo = \"{servo}\"\n{keys}\n\
         direction = 1\noffset_rad = 0.0\nlower_rad = -1.0\nupper_rad = 1.0\n\
         velocity_rad_s = 4.0\nacceleration_rad_s2 = 20.0\ninitial_rad = 0.0\n\
         origin_m = [0.0, 0.0, 0.1]\naxis = [0.0, 1.0, 0.0]\n\n"
    );
}

fn head(name: &str, rate_hz: f64) -> String {
    format!(
        "schema = 1\nname = \"{name}\"\ndescription = \"a fixture\"\nsource = \"made up\"\n\
         rate_hz = {rate_hz:.1}\nacceleration_source = \"made up\"\n\n\
         [anatomy]\nbase = [\"pelvis\", \"torso\"]\nsource = \"made up\"\nn_pose_rad = {{}}\n\
         segment = []\n\n"
    )
}

/// Two legs of six actuators on one line, driven at `rate_hz`.
pub fn legs(kind: Kind, rate_hz: f64) -> String {
    let mut out = head("legs", rate_hz);
    let _ = write!(out, "[[line]]\nname = \"legs\"\nkind = \"can\"\n{}\n\n", kind.line);
    for (side, prefix) in ["l", "r"].into_iter().enumerate() {
        for (index, name) in LEG.into_iter().enumerate() {
            let id = 1 + 6 * side + index;
            joint(&mut out, &format!("{prefix}_{name}"), "legs", kind.servo, id, kind.keys);
        }
    }
    out
}

/// `count` actuators on one line.
pub fn few(kind: Kind, count: usize, rate_hz: f64) -> String {
    let mut out = head("few", rate_hz);
    let _ = write!(out, "[[line]]\nname = \"body\"\nkind = \"can\"\n{}\n\n", kind.line);
    for id in 1..=count {
        joint(&mut out, &format!("joint_{id}"), "body", kind.servo, id, kind.keys);
    }
    out
}

/// CAN legs on a line each, and two Dynamixel arms of three servos on a serial line.
pub fn mixed(rate_hz: f64) -> String {
    let mut out = head("mixed", rate_hz);
    for line in ["left_leg", "right_leg"] {
        let _ = write!(out, "[[line]]\nname = \"{line}\"\nkind = \"can\"\n{}\n\n", DAMIAO.line);
    }
    out.push_str("[[line]]\nname = \"arms\"\nbaud_bps = 1000000\n\n");
    out.push_str(
        "[[setup]]\nservo = \"xm430-w350\"\nfirmware = 45\nsource = \"made up\"\n\
         registers = { \"Baud Rate\" = 3, \"Return Delay Time\" = 0 }\n\n",
    );
    for (line, prefix) in [("left_leg", "l"), ("right_leg", "r")] {
        for (index, name) in LEG.into_iter().enumerate() {
            let name = format!("{prefix}_{name}");
            joint(&mut out, &name, line, DAMIAO.servo, 1 + index, DAMIAO.keys);
        }
    }
    for (side, prefix) in ["l", "r"].into_iter().enumerate() {
        for (index, name) in ["sho_pitch", "sho_roll", "elbow"].into_iter().enumerate() {
            let id = 1 + 3 * side + index;
            joint(&mut out, &format!("{prefix}_{name}"), "arms", "xm430-w350", id, "");
        }
    }
    out
}

/// The legs of Berkeley Humanoid Lite as its file has them, all twelve on one line.
pub fn berkeley_legs() -> String {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/firmware-profiles/robots/berkeley-humanoid-lite.toml"
    );
    let text = std::fs::read_to_string(path).expect("a shipped robot");
    let of_a_leg = |block: &str| ["hip", "knee", "ankle"].iter().any(|part| block.contains(part));
    // A block reaches from one head to the next.
    let mut kept = Vec::new();
    let mut line_is_there = false;
    for block in text.split("\n[") {
        let keep = if block.starts_with("[line]") {
            !std::mem::replace(&mut line_is_there, true)
        } else if block.starts_with("[joint]") || block.starts_with("[anatomy.segment]") {
            of_a_leg(block)
        } else {
            // What the whole body weighs its legs do not.
            !block.trim_start_matches('[').starts_with("body")
        };
        if keep && block.starts_with("anatomy]") {
            let poses = block.lines().filter(|line| !line.contains("shoulder"));
            let poses: Vec<&str> = poses.collect();
            kept.push(format!("{}\nn_pose_rad = {{}}\n", poses.join("\n")));
        } else if keep {
            kept.push(block.to_owned());
        }
    }
    let mut legs = kept.join("\n[");
    for line in ["left_arm", "left_leg", "right_leg"] {
        legs = legs.replace(&format!("\"{line}\""), "\"legs\"");
    }
    legs.replace("name = \"berkeley-humanoid-lite\"", "name = \"berkeley-legs\"")
}
