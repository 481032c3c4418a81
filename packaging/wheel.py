#!/usr/bin/env python3
"""Packs a built extension as a wheel, without compiling anything: the Python package, its types and the library.

    cargo build --release --locked -p tactnet-python
    python3 packaging/wheel.py --library target/release/lib_tactnet.so --out dist
    pip install dist/tactnet-*.whl

The wheel is for CPython 3.10 and later (abi3). Its platform tag, manylinux_2_N, is that of the newest version of glibc that the library
needs; a library that needs others than PEP 599 allows is refused. Needs `readelf` and `strip` of binutils. Prints the path of the wheel.
"""

import argparse
import base64
import hashlib
import os
import platform
import re
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
BINDING = REPOSITORY / "bindings/python"
#: Libraries of the C library and the compiler, which every Linux with glibc has.
ALLOWED = re.compile(r"(libc|libm|libdl|librt|libpthread|libgcc_s)\.so\.\d+|ld-linux-.*")


def readelf(option: str, library: Path) -> str:
    environment = os.environ | {"LC_ALL": "C"}
    return subprocess.run(["readelf", option, "--wide", library], check=True, capture_output=True, text=True, env=environment).stdout


def platform_tag(library: Path) -> str:
    """Returns the platform tag of a library; exits if it needs libraries that a Linux may lack."""
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", readelf("-d", library))
    others = [name for name in needed if not ALLOWED.fullmatch(name)]
    if others:
        sys.exit(f"error: {library}: expected libraries of every Linux, found {', '.join(others)}")
    versions = [tuple(map(int, version)) for version in re.findall(r"\bGLIBC_(\d+)\.(\d+)", readelf("-V", library))]
    # manylinux2014, the oldest that pip knows by numbers.
    major, minor = max([(2, 17), *versions])
    return f"manylinux_{major}_{minor}_{platform.machine()}"


def metadata(project: dict, version: str) -> str:
    lines = ["Metadata-Version: 2.1", f"Name: {project['name']}", f"Version: {version}", f"Summary: {project['description']}"]
    lines += [f"License: {project['license']}", f"Requires-Python: {project['requires-python']}"]
    lines += [f"Classifier: {classifier}" for classifier in project["classifiers"]]
    lines += [f"Requires-Dist: {dependency}" for dependency in project["dependencies"]]
    for extra, dependencies in project["optional-dependencies"].items():
        lines.append(f"Provides-Extra: {extra}")
        lines += [f"Requires-Dist: {dependency} ; extra == '{extra}'" for dependency in dependencies]
    lines.append("Description-Content-Type: text/markdown")
    return "\n".join(lines) + "\n\n" + (BINDING / project["readme"]).read_text()


def pack(library: Path, out: Path) -> Path:
    """Writes the wheel and returns its path. Equal inputs give equal bytes."""
    project = tomllib.loads((BINDING / "pyproject.toml").read_text())["project"]
    version = tomllib.loads((REPOSITORY / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    tag = f"cp310-abi3-{platform_tag(library)}"
    about = f"{project['name']}-{version}.dist-info"
    files = {f"tactnet/{path.name}": path.read_bytes() for path in (BINDING / "python/tactnet").iterdir() if path.suffix in (".py", ".pyi", ".typed")}
    with tempfile.TemporaryDirectory() as work:
        stripped = Path(work) / library.name
        subprocess.run(["strip", "-o", stripped, library], check=True)
        files["tactnet/_tactnet.abi3.so"] = stripped.read_bytes()
    files[f"{about}/METADATA"] = metadata(project, version).encode()
    files[f"{about}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: tactnet packaging/wheel.py\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    for licence in REPOSITORY.glob("LICENSE-*"):
        files[f"{about}/licenses/{licence.name}"] = licence.read_bytes()
    record = ""
    for name, content in sorted(files.items()):
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record += f"{name},sha256={digest},{len(content)}\n"
    files[f"{about}/RECORD"] = (record + f"{about}/RECORD,,\n").encode()
    out.mkdir(parents=True, exist_ok=True)
    wheel = out / f"{project['name']}-{version}-{tag}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return wheel


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", type=Path, default=REPOSITORY / "target/release/lib_tactnet.so", metavar="FILE")
    parser.add_argument("--out", type=Path, default=REPOSITORY / "dist", metavar="FOLDER")
    arguments = parser.parse_args()
    print(pack(arguments.library, arguments.out))


if __name__ == "__main__":
    main()
