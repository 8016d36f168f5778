#!/usr/bin/env python3
"""Shows a scene that `gaitway convert FILE SCENE.mcap --scene` wrote in rerun (https://rerun.io).

rerun reads its transforms, joints and events by itself, but not `foxglove.SceneUpdate`: this adds what hangs on the
frames. Needs PyPI's rerun-sdk, mcap, mcap-protobuf-support.

    python in_rerun.py scene.mcap            opens the viewer
    python in_rerun.py scene.mcap walk.rrd   writes a file for it
"""

import sys

import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def vector(of):
    return [of.x, of.y, of.z]


def turn(of):
    return rr.Quaternion(xyzw=[of.x, of.y, of.z, of.w])


def colour(of):
    return [round(255 * part) for part in (of.r, of.g, of.b, of.a)]


def parts(entity):
    """What an entity is made of, as rerun's archetypes."""
    if entity.cubes:
        yield "boxes", rr.Boxes3D(
            centers=[vector(one.pose.position) for one in entity.cubes],
            sizes=[vector(one.size) for one in entity.cubes],
            quaternions=[turn(one.pose.orientation) for one in entity.cubes],
            colors=[colour(one.color) for one in entity.cubes],
            fill_mode="solid",
        )
    if entity.spheres:
        yield "balls", rr.Points3D(
            [vector(one.pose.position) for one in entity.spheres],
            radii=[one.size.x / 2 for one in entity.spheres],
            colors=[colour(one.color) for one in entity.spheres],
        )
    if entity.cylinders:
        yield "rods", rr.Cylinders3D(
            lengths=[one.size.z for one in entity.cylinders],
            radii=[one.size.x / 2 for one in entity.cylinders],
            centers=[vector(one.pose.position) for one in entity.cylinders],
            quaternions=[turn(one.pose.orientation) for one in entity.cylinders],
            colors=[colour(one.color) for one in entity.cylinders],
            fill_mode="solid",
        )
    if entity.lines:
        strips = [[vector(point) for point in one.points] for one in entity.lines]
        strips = [
            strip + strip[:1] if one.type == 1 else strip
            for one, strip in zip(entity.lines, strips)
        ]
        yield "lines", rr.LineStrips3D(strips, colors=[colour(one.color) for one in entity.lines])


def main():
    scene, output = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None
    recording = rr.RecordingStream("gaitway")
    view = rrb.Spatial3DView(
        origin="/", contents="/drawn/**", spatial_information=rrb.SpatialInformation(target_frame="world")
    )
    if output:
        recording.save(output, default_blueprint=rrb.Blueprint(view))
    else:
        recording.spawn(default_blueprint=rrb.Blueprint(view))
    recording.log_file_from_path(scene)
    begun = set()
    with open(scene, "rb") as file:
        reader = make_reader(file)
        decode = None
        for schema, channel, message in reader.iter_messages():
            if schema.name != "foxglove.SceneUpdate":
                continue
            decode = decode or DecoderFactory().decoder_for("protobuf", schema)
            update = decode(message.data)
            recording.set_time("message_log_time", timestamp=message.log_time * 1e-9)
            for entity in update.entities:
                path = f"drawn{channel.topic}/{entity.id}"
                for name, archetype in parts(entity):
                    part = f"{path}/{name}"
                    if part not in begun:
                        begun.add(part)
                        recording.log(part, rr.CoordinateFrame(entity.frame_id), static=True)
                    recording.log(part, archetype)
    recording.flush()


main()
