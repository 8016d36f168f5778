//! Foxglove's messages (<https://docs.foxglove.dev/docs/sdk/schemas>), as far as a scene needs them. Numbers of fields
//! are those of the descriptors beside this file, which go into each file that is written.

use crate::recording::Schema;
use glam::{DQuat, DVec3};
use prost::Message;

/// Time since 1970.
#[derive(Clone, Copy, PartialEq, Eq, Message)]
pub(super) struct Timestamp {
    #[prost(int64, tag = "1")]
    pub(super) seconds: i64,
    #[prost(int32, tag = "2")]
    pub(super) nanos: i32,
}

impl Timestamp {
    pub(super) const fn of(time_ns: u64) -> Self {
        Self { seconds: (time_ns / 1_000_000_000) as i64, nanos: (time_ns % 1_000_000_000) as i32 }
    }
}

/// A vector, or a point.
#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct Vector {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
}

impl From<DVec3> for Vector {
    fn from(from: DVec3) -> Self {
        Self { x: from.x, y: from.y, z: from.z }
    }
}

#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct Quaternion {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
    #[prost(double, tag = "4")]
    w: f64,
}

impl From<DQuat> for Quaternion {
    fn from(from: DQuat) -> Self {
        Self { x: from.x, y: from.y, z: from.z, w: from.w }
    }
}

#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct Pose {
    #[prost(message, optional, tag = "1")]
    position: Option<Vector>,
    #[prost(message, optional, tag = "2")]
    orientation: Option<Quaternion>,
}

impl Pose {
    pub(super) fn of(at_m: DVec3, turn: DQuat) -> Option<Self> {
        Some(Self { position: Some(at_m.into()), orientation: Some(turn.into()) })
    }
}

/// Red, green, blue, and how opaque, from 0 to 1.
#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct Colour {
    #[prost(double, tag = "1")]
    r: f64,
    #[prost(double, tag = "2")]
    g: f64,
    #[prost(double, tag = "3")]
    b: f64,
    #[prost(double, tag = "4")]
    a: f64,
}

impl Colour {
    pub(super) const fn new([r, g, b, a]: [f64; 4]) -> Self {
        Self { r, g, b, a }
    }
}

/// Where one frame is in another.
#[derive(Clone, PartialEq, Message)]
pub(super) struct FrameTransform {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub(super) parent_frame_id: String,
    #[prost(string, tag = "3")]
    pub(super) child_frame_id: String,
    #[prost(message, optional, tag = "4")]
    pub(super) translation: Option<Vector>,
    #[prost(message, optional, tag = "5")]
    pub(super) rotation: Option<Quaternion>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct FrameTransforms {
    #[prost(message, repeated, tag = "1")]
    pub(super) transforms: Vec<FrameTransform>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct JointState {
    #[prost(string, tag = "1")]
    pub(super) name: String,
    #[prost(double, optional, tag = "2")]
    pub(super) position: Option<f64>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct JointStates {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<Timestamp>,
    #[prost(message, repeated, tag = "2")]
    pub(super) joints: Vec<JointState>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Log {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<Timestamp>,
    #[prost(enumeration = "LogLevel", tag = "2")]
    pub(super) level: i32,
    #[prost(string, tag = "3")]
    pub(super) message: String,
    #[prost(string, tag = "4")]
    pub(super) name: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, prost::Enumeration)]
pub(super) enum LogLevel {
    Unknown = 0,
    Info = 2,
    Warning = 3,
    Error = 4,
}

/// A box, a cylinder along z or an ellipsoid, as large as told along each axis.
#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct Block {
    #[prost(message, optional, tag = "1")]
    pub(super) pose: Option<Pose>,
    #[prost(message, optional, tag = "2")]
    pub(super) size: Option<Vector>,
    #[prost(message, optional, tag = "3")]
    pub(super) color: Option<Colour>,
}

#[derive(Clone, Copy, PartialEq, Message)]
pub(super) struct Cylinder {
    #[prost(message, optional, tag = "1")]
    pub(super) pose: Option<Pose>,
    #[prost(message, optional, tag = "2")]
    pub(super) size: Option<Vector>,
    #[prost(double, tag = "3")]
    pub(super) bottom_scale: f64,
    #[prost(double, tag = "4")]
    pub(super) top_scale: f64,
    #[prost(message, optional, tag = "5")]
    pub(super) color: Option<Colour>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, prost::Enumeration)]
pub(super) enum LineKind {
    Strip = 0,
    Loop = 1,
    List = 2,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Line {
    #[prost(enumeration = "LineKind", tag = "1")]
    pub(super) r#type: i32,
    #[prost(message, optional, tag = "2")]
    pub(super) pose: Option<Pose>,
    #[prost(double, tag = "3")]
    pub(super) thickness: f64,
    #[prost(message, repeated, tag = "5")]
    pub(super) points: Vec<Vector>,
    #[prost(message, optional, tag = "6")]
    pub(super) color: Option<Colour>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Text {
    #[prost(message, optional, tag = "1")]
    pub(super) pose: Option<Pose>,
    #[prost(bool, tag = "2")]
    pub(super) billboard: bool,
    #[prost(double, tag = "3")]
    pub(super) font_size: f64,
    #[prost(message, optional, tag = "5")]
    pub(super) color: Option<Colour>,
    #[prost(string, tag = "6")]
    pub(super) text: String,
}

/// Things in one frame, told together; those told before under the same `id` are gone.
#[derive(Clone, PartialEq, Message)]
pub(super) struct SceneEntity {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub(super) frame_id: String,
    #[prost(string, tag = "3")]
    pub(super) id: String,
    #[prost(bool, tag = "5")]
    pub(super) frame_locked: bool,
    #[prost(message, repeated, tag = "8")]
    pub(super) cubes: Vec<Block>,
    #[prost(message, repeated, tag = "9")]
    pub(super) spheres: Vec<Block>,
    #[prost(message, repeated, tag = "10")]
    pub(super) cylinders: Vec<Cylinder>,
    #[prost(message, repeated, tag = "11")]
    pub(super) lines: Vec<Line>,
    #[prost(message, repeated, tag = "13")]
    pub(super) texts: Vec<Text>,
}

impl SceneEntity {
    /// Nothing yet, in a frame it moves with.
    pub(super) fn of(time_ns: u64, frame_id: &str, id: &str) -> Self {
        Self {
            timestamp: Some(Timestamp::of(time_ns)),
            frame_id: frame_id.to_owned(),
            id: id.to_owned(),
            frame_locked: true,
            ..Self::default()
        }
    }

    pub(super) fn ball(&mut self, at_m: DVec3, radius_m: f64, colour: Colour) {
        self.spheres.push(Block {
            pose: Pose::of(at_m, DQuat::IDENTITY),
            size: Some((DVec3::ONE * 2.0 * radius_m).into()),
            color: Some(colour),
        });
    }

    /// A rod with round ends; of no length a ball.
    pub(super) fn capsule(&mut self, ends_m: [DVec3; 2], radius_m: f64, colour: Colour) {
        ends_m.iter().for_each(|end_m| self.ball(*end_m, radius_m, colour));
        let along_m = ends_m[1] - ends_m[0];
        let Some(direction) = along_m.try_normalize() else { return };
        self.cylinders.push(Cylinder {
            pose: Pose::of(
                (ends_m[0] + ends_m[1]) / 2.0,
                DQuat::from_rotation_arc(DVec3::Z, direction),
            ),
            size: Some(DVec3::new(2.0 * radius_m, 2.0 * radius_m, along_m.length()).into()),
            bottom_scale: 1.0,
            top_scale: 1.0,
            color: Some(colour),
        });
    }

    pub(super) fn line(
        &mut self,
        kind: LineKind,
        points_m: impl IntoIterator<Item = DVec3>,
        thickness_m: f64,
        colour: Colour,
    ) {
        self.lines.push(Line {
            r#type: kind.into(),
            pose: Pose::of(DVec3::ZERO, DQuat::IDENTITY),
            thickness: thickness_m,
            points: points_m.into_iter().map(Vector::from).collect(),
            color: Some(colour),
        });
    }
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct SceneUpdate {
    #[prost(message, repeated, tag = "2")]
    pub(super) entities: Vec<SceneEntity>,
}

/// A message with its published name and descriptor.
pub(super) trait Told: Message {
    const SCHEMA: Schema<'static>;
}

const fn schema(name: &'static str, data: &'static [u8]) -> Schema<'static> {
    Schema { name, encoding: "protobuf", data, messages: "protobuf" }
}

impl Told for FrameTransforms {
    const SCHEMA: Schema<'static> =
        schema("foxglove.FrameTransforms", include_bytes!("FrameTransforms.bin"));
}

impl Told for JointStates {
    const SCHEMA: Schema<'static> =
        schema("foxglove.JointStates", include_bytes!("JointStates.bin"));
}

impl Told for Log {
    const SCHEMA: Schema<'static> = schema("foxglove.Log", include_bytes!("Log.bin"));
}

impl Told for SceneUpdate {
    const SCHEMA: Schema<'static> =
        schema("foxglove.SceneUpdate", include_bytes!("SceneUpdate.bin"));
}
