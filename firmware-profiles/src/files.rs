//! Where profiles come from: compiled into the crate, or a file the user names.

use crate::error::ProfileError;
use crate::extends;
use crate::form;
use crate::from_toml::from_toml;
use crate::own::{self, OwnFile, own_file, own_files};
use crate::plain::advice;
use crate::schema::{Actuator, Adapter, Board, Origin, Robot, Sensor, Servo};
use crate::unconfirmed::Profile;
use crate::validate;
use serde::de::DeserializeOwned;
use std::fs;
use std::io::Read as _;
use std::path::Path;
use std::sync::OnceLock;

/// Longest profile file that is read, in bytes.
pub const MAX_FILE_BYTES: u64 = 1024 * 1024;

/// A profile file as it was when the crate was built.
pub(crate) struct EmbeddedFile {
    /// File name without `.toml`, by which the profile is found.
    name: &'static str,
    /// Path inside this crate.
    file: &'static str,
    text: &'static str,
}

include!(concat!(env!("OUT_DIR"), "/embedded.rs"));

fn shipped() -> impl Iterator<Item = &'static EmbeddedFile> + Clone {
    SERVOS.iter().chain(ACTUATORS).chain(ROBOTS).chain(ADAPTERS).chain(SENSORS).chain(BOARDS)
}

/// True if a profile of this name, of whatever kind, ships with this crate.
pub(crate) fn is_shipped(name: &str) -> bool {
    shipped().any(|embedded| embedded.name == name)
}

/// Names of the servo profiles: those that ship in alphabetical order, then the user's own.
pub fn servo_names() -> impl Iterator<Item = &'static str> {
    let is_servo = |own: &&'static OwnFile| {
        !own.has_key("imu") && (own.has_key("register") || own.has_key(extends::KEY))
    };
    let own = own_files().into_iter().filter(is_servo).map(OwnFile::name);
    SERVOS.iter().map(|embedded| embedded.name).chain(own)
}

/// Names of the CAN actuators, as [`servo_names`].
pub fn actuator_names() -> impl Iterator<Item = &'static str> {
    let own = own_files().into_iter().filter(|own| own.has_key("dialect")).map(OwnFile::name);
    ACTUATORS.iter().map(|embedded| embedded.name).chain(own)
}

/// Names of the shipped robots, in alphabetical order.
pub fn robot_names() -> impl Iterator<Item = &'static str> {
    ROBOTS.iter().map(|embedded| embedded.name)
}

/// Names of the adapters, as [`servo_names`].
pub fn adapter_names() -> impl Iterator<Item = &'static str> {
    ADAPTERS.iter().map(|embedded| embedded.name).chain(own_adapters().map(OwnFile::name))
}

fn own_adapters() -> impl Iterator<Item = &'static OwnFile> {
    own_files().into_iter().filter(|own| own.has_key("usb_ids"))
}

/// Names of the shipped sensors, in alphabetical order.
pub fn sensor_names() -> impl Iterator<Item = &'static str> {
    SENSORS.iter().map(|embedded| embedded.name)
}

/// Names of the boards, as [`servo_names`].
pub fn board_names() -> impl Iterator<Item = &'static str> {
    let own = own_files().into_iter().filter(|own| own.has_key("imu")).map(OwnFile::name);
    BOARDS.iter().map(|embedded| embedded.name).chain(own)
}

/// A servo by name: a shipped one, or one of the user's own ([`crate::add_folder`]). Read and
/// validated at the first call, then kept.
///
/// # Errors
/// An unknown name (the message lists those there are), or an invalid shipped file.
pub fn servo(name: &str) -> Result<&'static Servo, ProfileError> {
    static CACHE: [OnceLock<Result<Servo, ProfileError>>; SERVOS.len()] =
        [const { OnceLock::new() }; SERVOS.len()];
    let entry = SERVOS.iter().zip(&CACHE).find(|(embedded, _)| embedded.name == name);
    let Some((embedded, cell)) = entry else {
        let unknown = || unknown("servo", name, servo_names(), ONE_OF_THESE);
        return own_file(name).ok_or_else(unknown)?.servo();
    };
    cell.get_or_init(|| parse_servo(embedded.file, embedded.text))
        .as_ref()
        .map_err(ProfileError::clone)
}

/// A CAN actuator by name: a shipped one, or one of the user's own.
///
/// # Errors
/// As [`servo`].
pub fn actuator(name: &str) -> Result<Actuator, ProfileError> {
    match ACTUATORS.iter().find(|embedded| embedded.name == name) {
        Some(embedded) => parse_actuator(embedded.file, embedded.text),
        None => {
            let unknown = || unknown("actuator", name, actuator_names(), ONE_OF_THESE);
            let own = own_file(name).ok_or_else(unknown)?;
            parse_actuator(&own.path().display().to_string(), own.text()?)
        }
    }
}

/// A board by name: a shipped one, or one of the user's own.
///
/// # Errors
/// As [`servo`].
pub fn board(name: &str) -> Result<Board, ProfileError> {
    match BOARDS.iter().find(|embedded| embedded.name == name) {
        Some(embedded) => parse_board(embedded.file, embedded.text),
        None => {
            let unknown = || unknown("board", name, board_names(), ONE_OF_THESE);
            let own = own_file(name).ok_or_else(unknown)?;
            parse_board(&own.path().display().to_string(), own.text()?)
        }
    }
}

/// A robot: a shipped one, or one of the user's own, by name (`[a-z0-9-]+`), or a file by a path that
/// ends in `.toml`. Servos and actuators that it names may lie beside it.
///
/// # Errors
/// An unknown name (the message lists those there are), a file that cannot be read or is longer
/// than [`MAX_FILE_BYTES`], or what the validator has against it.
pub fn robot(name_or_path: &str) -> Result<Robot, ProfileError> {
    if name_or_path.ends_with(".toml") {
        let text = read_text(Path::new(name_or_path))?;
        if let Ok(table) = from_toml::<toml::Table>(&text) {
            own::add_beside(Path::new(name_or_path), &table)?;
        }
        let mut robot = parse_robot(name_or_path, &text)?;
        let path = fs::canonicalize(name_or_path).unwrap_or_else(|_| name_or_path.into());
        robot.origin = Some(Origin { path, text });
        return Ok(robot);
    }
    if let Some(own) = own_file(name_or_path) {
        return robot(&own.path().display().to_string());
    }
    match ROBOTS.iter().find(|embedded| embedded.name == name_or_path) {
        Some(embedded) => parse_robot(embedded.file, embedded.text),
        None => Err(unknown("robot", name_or_path, robot_names(), OR_A_FILE)),
    }
}

/// The text of a robot file, by name or path.
///
/// # Errors
/// As [`robot`].
pub fn robot_text(name_or_path: &str) -> Result<String, ProfileError> {
    let found = robot(name_or_path)?;
    let shipped = ROBOTS.iter().find(|embedded| embedded.name == name_or_path);
    match (found.origin, shipped) {
        (Some(origin), _) => Ok(origin.text),
        (None, Some(embedded)) => Ok(embedded.text.to_owned()),
        (None, None) => Err(unknown("robot", name_or_path, robot_names(), OR_A_FILE)),
    }
}

/// A sensor: a shipped one by name (`[a-z0-9-]+`), or a file by a path that ends in `.toml`.
///
/// # Errors
/// As [`robot`].
pub fn sensor(name_or_path: &str) -> Result<Sensor, ProfileError> {
    if name_or_path.ends_with(".toml") {
        let text = read_text(Path::new(name_or_path))?;
        return parse_sensor(name_or_path, &text);
    }
    if let Some(own) = own_file(name_or_path) {
        return parse_sensor(&own.path().display().to_string(), own.text()?);
    }
    match SENSORS.iter().find(|embedded| embedded.name == name_or_path) {
        Some(embedded) => parse_sensor(embedded.file, embedded.text),
        None => Err(unknown("sensor", name_or_path, sensor_names(), OR_A_FILE)),
    }
}

/// A profile of any kind: a shipped one by name, or a file by a path that ends in `.toml`. What
/// kind a file is shows in its keys: `usb_ids` an adapter, `channel` a sensor, `dialect` a CAN
/// actuator, `imu` a board, `register` or `extends` a servo, all else a robot.
///
/// # Errors
/// As [`servo`] and [`robot`].
pub fn profile(name_or_path: &str) -> Result<Profile, ProfileError> {
    let parse_any = |file: &str, text: &str| {
        let table: toml::Table = parse(file, text)?;
        let has = |key: &str| table.contains_key(key);
        if has("usb_ids") {
            parse_adapter(file, text).map(|adapter| Profile::Adapter(Box::new(adapter)))
        } else if has("channel") {
            parse_sensor(file, text).map(|sensor| Profile::Sensor(Box::new(sensor)))
        } else if has("dialect") {
            parse_actuator(file, text).map(|actuator| Profile::Actuator(Box::new(actuator)))
        } else if has("imu") {
            parse_board(file, text).map(|board| Profile::Board(Box::new(board)))
        } else if has("register") || has(extends::KEY) {
            parse_servo(file, text).map(|servo| Profile::Servo(Box::new(servo)))
        } else {
            own::add_beside(Path::new(file), &table)?;
            parse_robot(file, text).map(|robot| Profile::Robot(Box::new(robot)))
        }
    };
    if name_or_path.ends_with(".toml") {
        return parse_any(name_or_path, &read_text(Path::new(name_or_path))?);
    }
    if let Some(own) = own_file(name_or_path) {
        return parse_any(&own.path().display().to_string(), own.text()?);
    }
    match shipped().find(|embedded| embedded.name == name_or_path) {
        Some(embedded) => parse_any(embedded.file, embedded.text),
        None => {
            let names = servo_names().chain(actuator_names()).chain(robot_names());
            let names = names.chain(adapter_names()).chain(sensor_names()).chain(board_names());
            Err(unknown("profile", name_or_path, names, OR_A_FILE))
        }
    }
}

/// The whole file of a profile of any kind as it is written, `extends` resolved: for those who show
/// it. Named as for [`profile`], and valid.
///
/// # Errors
/// As [`profile`].
pub fn whole_table(name_or_path: &str) -> Result<toml::Table, ProfileError> {
    profile(name_or_path)?;
    let own = own_file(name_or_path);
    let text = match shipped().find(|embedded| embedded.name == name_or_path) {
        Some(embedded) => embedded.text.to_owned(),
        None if own.is_some() => own.map_or(Ok(""), OwnFile::text)?.to_owned(),
        None => read_text(Path::new(name_or_path))?,
    };
    let table = parse(name_or_path, &text)?;
    extends::resolve(name_or_path, table, |base| {
        SERVOS.iter().find(|embedded| embedded.name == base).map(|embedded| embedded.text)
    })
}

/// Every adapter, in the order of [`adapter_names`].
///
/// # Errors
/// An invalid file.
pub fn adapters() -> Result<Vec<&'static Adapter>, ProfileError> {
    static CACHE: OnceLock<Result<Vec<Adapter>, ProfileError>> = OnceLock::new();
    let shipped = CACHE.get_or_init(|| {
        ADAPTERS.iter().map(|embedded| parse_adapter(embedded.file, embedded.text)).collect()
    });
    let shipped = shipped.as_ref().map_err(ProfileError::clone)?;
    let own = own_adapters().map(OwnFile::adapter).collect::<Result<Vec<_>, _>>()?;
    Ok(shipped.iter().chain(own).collect())
}

/// The adapter with these USB ids, if there is one; one of the user's own before a shipped one.
///
/// # Errors
/// An invalid file.
pub fn adapter_for_usb(
    vendor: u16,
    product: u16,
) -> Result<Option<&'static Adapter>, ProfileError> {
    let id = format!("{vendor:04x}:{product:04x}");
    Ok(adapters()?.into_iter().rev().find(|adapter| adapter.usb_ids.contains(&id)))
}

/// Reads and validates the text of a servo profile; `file` is its path, used for messages and for
/// the rule that the profile has the file's name.
///
/// # Errors
/// What the validator has against it.
pub fn parse_servo(file: &str, text: &str) -> Result<Servo, ProfileError> {
    let extending = from_toml::<toml::Table>(text).ok().filter(extends::has_base);
    let servo: Servo = match extending {
        Some(table) => {
            let shipped =
                |name: &str| SERVOS.iter().find(|base| base.name == name).map(|base| base.text);
            let whole = extends::resolve(file, table, shipped)?;
            // Of two files joined no line can be named; the message names the key.
            whole.try_into().map_err(|error| malformed(file, &error))?
        }
        None => parse(file, text)?,
    };
    validate::servo(file, &servo)?;
    Ok(servo)
}

/// Reads and validates the text of a CAN actuator's profile; `file` as in [`parse_servo`].
///
/// # Errors
/// What the validator has against it.
pub fn parse_actuator(file: &str, text: &str) -> Result<Actuator, ProfileError> {
    let actuator: Actuator = parse(file, text)?;
    validate::actuator(file, &actuator)?;
    Ok(actuator)
}

/// Reads and validates the text of a robot; `file` as in [`parse_servo`].
///
/// # Errors
/// What the validator has against it.
pub fn parse_robot(file: &str, text: &str) -> Result<Robot, ProfileError> {
    let robot: Robot = parse(file, text)?;
    validate::robot(file, &robot)?;
    Ok(robot)
}

/// Reads and validates the text of an adapter profile; `file` as in [`parse_servo`].
///
/// # Errors
/// What the validator has against it.
pub fn parse_adapter(file: &str, text: &str) -> Result<Adapter, ProfileError> {
    let adapter: Adapter = parse(file, text)?;
    validate::adapter(file, &adapter)?;
    Ok(adapter)
}

/// Reads and validates the text of a sensor profile; `file` as in [`parse_servo`].
///
/// # Errors
/// What the validator has against it.
pub fn parse_sensor(file: &str, text: &str) -> Result<Sensor, ProfileError> {
    let sensor: Sensor = parse(file, text)?;
    validate::sensor(file, &sensor)?;
    Ok(sensor)
}

/// Reads and validates the text of a board's profile; `file` as in [`parse_servo`].
///
/// # Errors
/// What the validator has against it.
pub fn parse_board(file: &str, text: &str) -> Result<Board, ProfileError> {
    let board: Board = parse(file, text)?;
    validate::board(file, &board)?;
    Ok(board)
}

/// Reads a profile file whole.
///
/// # Errors
/// Not a regular file, longer than [`MAX_FILE_BYTES`], unreadable, or not UTF-8.
pub fn read_text(path: &Path) -> Result<String, ProfileError> {
    let file = path.display().to_string();
    let unreadable = |cause: std::io::Error| {
        ProfileError::new(&file, "the file cannot be read")
            .got(cause)
            .remedy("check the path and the permissions")
    };
    // Asked before opening: opening a FIFO would wait for a writer.
    if !fs::metadata(path).map_err(unreadable)?.is_file() {
        return Err(ProfileError::new(&file, "this is not a regular file")
            .remedy("give the path of a .toml file"));
    }
    let mut bytes = Vec::new();
    let opened = fs::File::open(path).map_err(unreadable)?;
    // One byte more than allowed tells a file that is too long, even one that grows meanwhile.
    opened.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(ProfileError::new(&file, "the file is too long for a profile")
            .got(format!("more than {MAX_FILE_BYTES} bytes"))
            .allowed(format!("at most {MAX_FILE_BYTES} bytes")));
    }
    String::from_utf8(bytes).map_err(|error| {
        ProfileError::new(&file, "the file is not UTF-8 text")
            .at(format!("byte {}", error.utf8_error().valid_up_to()))
    })
}

fn parse<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, ProfileError> {
    from_toml(text).map_err(|error| {
        if let Err(all) = form::faults::<T>(file, text) {
            return all;
        }
        let refusal = malformed(file, &error);
        match error.span() {
            None => refusal,
            Some(span) => {
                let before = text.as_bytes().iter().take(span.start);
                refusal.at(format!("line {}", 1 + before.filter(|&&byte| byte == b'\n').count()))
            }
        }
    })
}

fn malformed(file: &str, error: &toml::de::Error) -> ProfileError {
    form::malformed(file, error.message())
}

/// What to do where a name is none of those that there are.
const ONE_OF_THESE: &str = "take one of these names";
const OR_A_FILE: &str = "take one of these names, or give the path of a .toml file";

fn unknown(
    kind: &str,
    name: &str,
    available: impl Iterator<Item = &'static str>,
    otherwise: &str,
) -> ProfileError {
    let available: Vec<_> = available.collect();
    let remedy = advice(name, &available, otherwise);
    ProfileError::new(name, format!("there is no {kind} of this name"))
        .got(format!("{name:?}"))
        .allowed(available.join(", "))
        .remedy(remedy)
}
