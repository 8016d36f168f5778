"""Pictures of a run, one row without balance and one with: film.py GAITWAY MODEL.xml OUT.png MOTION KIND WAY MUCH SEED FROM_S TO_S

Ten frames from one time to another, s since torque was on. Rendered by MuJoCo (MUJOCO_GL=egl, or osmesa).
"""

import struct
import sys
import tempfile
import zlib

sys.dont_write_bytecode = True

import measure
import mujoco
import numpy as np
import world

WIDTH, HEIGHT, FRAMES = 200, 300, 10


def png(picture):
    part = lambda name, data: struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    rows = b"".join(b"\0" + row.tobytes() for row in picture)
    size = struct.pack(">IIBBBBB", picture.shape[1], picture.shape[0], 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + part(b"IHDR", size) + part(b"IDAT", zlib.compress(rows)) + part(b"IEND", b"")


def filmed(tools, job, from_s, to_s):
    at_s, seen = np.linspace(from_s, to_s, FRAMES), []

    def watch(robot):
        if len(seen) < FRAMES and robot.now_s - robot.powered_s >= at_s[len(seen)]:
            seen.append(robot.data.qpos.copy())

    _, fell_s, fell_on, _ = measure.by_mujoco(tools, job, watch)
    measure.programs.pop((job[1], job[3], None)).close()
    print(job, "fell", fell_s, fell_on)
    model = world.model_of(tools["model"])
    model.geom_rgba[model.geom("level").id] = [0.75, 0.8, 0.75, 1]
    model.vis.headlight.ambient[:] = 0.4
    data, renderer = mujoco.MjData(model), mujoco.Renderer(model, HEIGHT, WIDTH)
    options = mujoco.MjvOption()
    options.geomgroup[:] = 1
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 1.0, 150, -12
    frames = []
    for pose in seen:
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        camera.lookat[:] = [pose[0], pose[1], 0.2]
        renderer.update_scene(data, camera, options)
        frames.append(renderer.render())
    return np.hstack(frames)


if __name__ == "__main__":
    gaitway, model, out, motion, kind, way, much, seed, from_s, to_s = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        tools = measure.tools_in(folder, gaitway, model)
        trial = (kind, way, int(much), int(seed))
        rows = [filmed(tools, ("mujoco", motion, "as it is", balance, *trial), float(from_s), float(to_s)) for balance in (False, True)]
    with open(out, "wb") as file:
        file.write(png(np.vstack(rows)))
    print(measure.befalls(motion, *trial))
