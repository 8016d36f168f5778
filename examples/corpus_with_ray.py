#!/usr/bin/env python3
"""Makes a corpus on many machines with Ray (https://ray.io): each makes parts of it, and one looks at last whether all is there.

Every command of gaitway that takes `--part K/N` can be given. What it writes to is a folder that all machines see. A part
that is broken off is made again; what is there already is kept. Needs PyPI's ray, and gaitway on every machine.

    python corpus_with_ray.py 100 gaitway synth --class nod=bow --variations 1000000 -o corpus/
    python corpus_with_ray.py 33 gaitway corpus generate moves generalisation

Ray's own settings (an address of a cluster, processors) are as it has them: RAY_ADDRESS, `ray start`.
"""

import json
import subprocess
import sys

import ray

ATTEMPTS = 3


def run(command):
    """Runs a command; its report."""
    done = subprocess.run([*command, "--json"], capture_output=True, text=True)
    # 3: it was done, with something in it that its report names.
    if done.returncode not in (0, 3):
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")
    return json.loads(done.stdout)


@ray.remote(num_cpus=1, max_retries=ATTEMPTS, retry_exceptions=True)
def part(command, number, count):
    return run([*command, "--part", f"{number}/{count}"])


def main():
    if len(sys.argv) < 3 or not sys.argv[1].isdigit():
        sys.exit(__doc__)
    count, command = int(sys.argv[1]), sys.argv[2:]
    ray.init(include_dashboard=False, logging_level="ERROR")
    waiting = [part.remote(command, number, count) for number in range(1, count + 1)]
    made = []
    while waiting:
        ready, waiting = ray.wait(waiting)
        made += ray.get(ready)
        print(f"{len(made)} of {count} parts", file=sys.stderr)
    print(json.dumps({"parts": len(made), "whole": run(command)}, indent=2))


if __name__ == "__main__":
    main()
