//! What each servo, adapter, robot and sensor is, as data, with the schema and the validator.
//!
//! The files under `servos/`, `actuators/`, `boards/`, `adapters/`, `robots/` and `sensors/` are compiled into the crate. A file is
//! validated before anyone sees it; whoever holds a [`Servo`] or a [`Robot`] from [`servo()`] or
//! [`robot()`] may rely on it.
//!
//! # How to add a servo
//!
//! 1. Copy the nearest file under `servos/` to `servos/MAKER/NAME.toml`; `NAME` is lower case,
//!    `[a-z0-9-]+`, and stands again in the file as `name`.
//! 2. Go through the maker's control table line by line, in order of address. Keep the maker's
//!    word as `name`, give our word as `role` where [`Role`] has one, and say in `source` where
//!    the line is written: the manual's section, `measured DATE, UNIT`, or `unconfirmed: why`.
//!    Leave out no register: a table with holes makes a virtual servo with holes.
//! 3. Units and scales are the manual's own (`rpm` and 0.229, not 0.0239 rad/s).
//! 4. If it differs from a shipped servo in a few values, write `extends = "that-one"` and only
//!    what differs: see the head of `src/extends.rs`.
//! 5. Run `cargo test -p gaitway-profiles`. Each shipped file is a test of its own, and the first
//!    rule it breaks is named with file, register, what was found and what is allowed.
//!
//! # How to add a CAN actuator
//!
//! Copy the nearest file under `actuators/`. The ranges are those the device's firmware codes its
//! numbers with: where sources disagree, say so in `source`. No code is needed if it speaks one of
//! the [`Dialect`]s.
//!
//! # How to add a robot
//!
//! 1. Copy `robots/op3.toml`, or let `gaitway robot new --from BUS` write a draft of what answers
//!    on a line. The file's name need not be its `name`.
//! 2. One `[[line]]` for each line (a CAN line has `kind = "can"` and `bitrate_bps`), one `[[joint]]`
//!    for each joint, parents first, and one `[[setup]]` for each servo model whose registers differ
//!    from what it leaves the factory with, or must not change. That is enough for tables, recordings
//!    and motions taught by hand.
//! 3. To follow a body: put the robot in the pose where all joints read zero. Every link frame is then parallel to
//!    the base (X forward, Y left, Z up); write each joint's origin and axis in that frame.
//! 4. `[anatomy]`: which joint angles make the robot stand as a person stands with the arms at
//!    the sides (`n_pose_rad`), and which link plays which segment of a human.
//! 5. Run the tests, as above. A file outside this folder is checked by the same rules when it is
//!    loaded by [`robot()`].
//!
//! # How to add a sensor
//!
//! Copy the nearest file in `sensors/`. Each `[[channel]]` says what one raw number is worth, in the
//! unit the manual uses, and where that is written. A sample is whole when every channel that is
//! not `optional` has arrived. [`sensor()`] takes a file outside this folder as well.
//!
//! # How to add a board
//!
//! A board with an inertial sensor that answers on the servos' line: copy the nearest file in `boards/`. A
//! robot names it in `[body.imu]`, with the axes by which it is screwed to the base.
//!
//! # Example
//!
//! ```
//! use gaitway_profiles::{Role, servo};
//!
//! let servo = servo("xm430-w350")?;
//! let goal = servo.register(Role::GoalPosition).map(|register| register.address);
//! assert_eq!(goal, Some(116));
//! # Ok::<(), gaitway_profiles::ProfileError>(())
//! ```

mod access;
mod counted;
mod error;
mod extends;
mod files;
mod form;
mod from_toml;
mod own;
mod plain;
pub mod schema;
mod unconfirmed;
mod validate;

pub use counted::{counted, either};
pub use error::ProfileError;
pub use files::{
    MAX_FILE_BYTES, actuator, actuator_names, adapter_for_usb, adapter_names, adapters, board,
    board_names, parse_actuator, parse_adapter, parse_board, parse_robot, parse_sensor,
    parse_servo, profile, read_text, robot, robot_names, robot_text, sensor, sensor_names, servo,
    servo_names, whole_table,
};
pub use from_toml::{from_toml, toml_bytes};
pub use own::{OwnFile, add_folder, own_file, own_files};
pub use plain::{advice, plain_words};
pub use schema::*;
pub use unconfirmed::{Profile, Unconfirmed};
