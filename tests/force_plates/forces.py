"""Ground forces of C3D files as the package ezc3d computes them, for the test beside this file.

    forces.py FOLDER FILE...

For each file one in FOLDER, called by its number: a line of JSON (`refused`, or `plates` with type, units and
samples of each), then for every plate and sample twelve little-endian 64-bit numbers: force, moment about the
middle of the plate, centre of pressure, free moment.
"""

import json
import sys
import warnings

import ezc3d
import numpy as np

warnings.simplefilter("ignore")


def main():
    folder, paths = sys.argv[1], sys.argv[2:]
    for number, path in enumerate(paths):
        blocks = []
        try:
            found = ezc3d.c3d(path, extract_forceplat_data=True)
            plates = found["data"]["platform"]
            kinds = found["parameters"]["FORCE_PLATFORM"]["TYPE"]["value"]
            head = {"plates": []}
            for kind, plate in zip(kinds, plates):
                names = ["force", "moment", "center_of_pressure", "Tz"]
                block = np.concatenate([plate[name] for name in names], axis=0).T
                head["plates"].append(
                    {"type": int(kind), "length": plate["unit_position"], "samples": len(block)}
                )
                blocks.append(block)
        except Exception as cause:
            head, blocks = {"refused": str(cause)}, []
        with open(f"{folder}/{number}", "wb") as out:
            out.write(json.dumps(head).encode() + b"\n")
            for block in blocks:
                out.write(np.ascontiguousarray(block, dtype="<f8").tobytes())


main()
