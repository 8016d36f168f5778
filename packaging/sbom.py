#!/usr/bin/env python3
"""What is in a program, as a CycloneDX 1.5 document: every crate with its version, licence and checksum.

    cargo metadata --format-version 1 --locked --filter-platform TRIPLE | packaging/sbom.py [--table]

Checksums come out of the Cargo.lock beside it. Only what the program is built of: nothing that tests or build scripts alone need. --table prints name, version and
licence instead, a line for each crate. The document has no time and no random number in it: the same sources give the
same bytes.
"""

import json
import sys
import tomllib
import uuid
from pathlib import Path


def used(metadata: dict) -> list[dict]:
    """The packages that the program is built of, by name, the program itself among them."""
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    found, waiting = set(), [metadata["resolve"]["root"]]
    while waiting:
        node = waiting.pop()
        if node in found:
            continue
        found.add(node)
        for dep in nodes[node]["deps"]:
            if any(kind["kind"] is None for kind in dep["dep_kinds"]):
                waiting.append(dep["pkg"])
    packages = (package for package in metadata["packages"] if package["id"] in found)
    return sorted(packages, key=lambda package: (package["name"], package["version"]))


def checksums(lock: Path) -> dict[tuple[str, str], str]:
    """SHA-256 of each crate that came from a registry."""
    packages = tomllib.loads(lock.read_text())["package"]
    return {(p["name"], p["version"]): p["checksum"] for p in packages if "checksum" in p}


def purl(package: dict) -> str:
    return f"pkg:cargo/{package['name']}@{package['version']}"


def component(package: dict, sums: dict[tuple[str, str], str], kind: str) -> dict:
    told = {
        "type": kind,
        "bom-ref": purl(package),
        "name": package["name"],
        "version": package["version"],
        "purl": purl(package),
    }
    if package.get("license"):
        # Cargo allows a slash for OR; SPDX does not.
        told["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    if package.get("description"):
        told["description"] = " ".join(package["description"].split())
    checksum = sums.get((package["name"], package["version"]))
    if checksum:
        told["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    return told


def document(metadata: dict, sums: dict[tuple[str, str], str]) -> dict:
    packages = used(metadata)
    by_id = {package["id"]: package for package in packages}
    root = by_id[metadata["resolve"]["root"]]
    depends = []
    for node in metadata["resolve"]["nodes"]:
        if node["id"] in by_id:
            needs = (
                dep["pkg"]
                for dep in node["deps"]
                if any(kind["kind"] is None for kind in dep["dep_kinds"])
            )
            on = sorted({purl(by_id[need]) for need in needs})
            depends.append({"ref": purl(by_id[node["id"]]), "dependsOn": on})
    inside = [component(package, sums, "library") for package in packages if package is not root]
    told = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": component(root, sums, "application")},
        "components": inside,
        "dependencies": sorted(depends, key=lambda entry: entry["ref"]),
    }
    name = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(told, sort_keys=True))
    return {**told, "serialNumber": f"urn:uuid:{name}"}


def main() -> None:
    metadata = json.load(sys.stdin)
    if sys.argv[1:] == ["--table"]:
        for package in used(metadata):
            licence = package["license"] or package["license_file"] or "not said"
            print(package["name"], package["version"], licence, sep="\t")
        return
    sums = checksums(Path(metadata["workspace_root"]) / "Cargo.lock")
    json.dump(document(metadata, sums), sys.stdout, indent=1, sort_keys=True)
    print()


if __name__ == "__main__":
    main()
