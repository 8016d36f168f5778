"""Reads C3D files with other people's packages and writes what they found, for the test beside this file.

    read.py FOLDER FILE...

For each file and package one in FOLDER, called NUMBER.PACKAGE: a line of JSON, then little-endian 64-bit
numbers: x, y, z, residual of each point of each frame (not a number where it was not seen), then each
channel of each analog sample.
"""

import json
import sys
import warnings

import c3d
import ezc3d
import numpy as np

warnings.simplefilter("ignore")


def by_ezc3d(path):
    found = ezc3d.c3d(path)
    points = found["data"]["points"][:3]
    residuals = found["data"]["meta_points"]["residuals"]
    analog = found["data"]["analogs"][0]
    parameters = found["parameters"]
    head = {
        "rate_hz": float(found["header"]["points"]["frame_rate"]),
        "first": int(found["header"]["points"]["first_frame"]) + 1,
        "labels": list(parameters["POINT"]["LABELS"]["value"])[: points.shape[1]],
    }
    samples = np.concatenate([points, residuals], axis=0).transpose(2, 1, 0)
    return head, samples, analog.T


def by_c3d(path):
    with open(path, "rb") as file:
        reader = c3d.Reader(file)
        frames = list(reader.read_frames())
        head = {
            "rate_hz": float(reader.point_rate),
            "first": int(reader.first_frame),
            "labels": [str(label).strip() for label in reader.point_labels][: reader.point_used],
        }
    points = np.array([frame[1] for frame in frames], dtype=np.float64)
    points = points.reshape(len(frames), -1, 5)
    points[points[:, :, 3] < 0] = np.nan
    analog = [np.asarray(frame[2], dtype=np.float64).T for frame in frames]
    analog = np.concatenate(analog, axis=0) if analog and analog[0].size else np.zeros((0, 0))
    return head, points[:, :, :4], analog


def main():
    folder, paths = sys.argv[1], sys.argv[2:]
    for number, path in enumerate(paths):
        for name, read in [("ezc3d", by_ezc3d), ("c3d", by_c3d)]:
            try:
                head, samples, analog = read(path)
                head["frames"], head["points"] = samples.shape[:2]
                head["samples"], head["channels"] = analog.shape
            except Exception as cause:  # whatever they raise, they refuse
                head = {"refused": f"{type(cause).__name__}: {cause}"[:200]}
                samples = analog = np.zeros(0)
            with open(f"{folder}/{number}.{name}", "wb") as out:
                out.write(json.dumps(head).encode() + b"\n")
                out.write(np.ascontiguousarray(samples, dtype="<f8").tobytes())
                out.write(np.ascontiguousarray(analog, dtype="<f8").tobytes())


main()
