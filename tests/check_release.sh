#!/usr/bin/env bash
# Checks the links of a release archive's documents. With a folder, it also unpacks the archive in a minimal Debian, trains there and runs the demo.
# Usage: check_release.sh ARCHIVE [FOLDER_OF_DEBIAN]
#
# The second part needs root. debootstrap fills the folder if it is empty; otherwise it is used again.
set -euo pipefail
archive=$(realpath "$1") debian=${2:-}
unpacked=$(mktemp -d)
trap 'rm -rf "$unpacked"' EXIT
tar -xzf "$archive" -C "$unpacked" --strip-components=1
"${PYTHON:-python3}" - "$unpacked" <<'PY'
import pathlib, re, sys
folder = pathlib.Path(sys.argv[1])
links = [
    (page.relative_to(folder), link)
    for page in sorted(folder.rglob("*.md"))
    for link in re.findall(r"\]\(([^)#\s]+)", page.read_text())
    if not re.match("[a-z]+:", link)
]
dead = [f"{page}: {link}" for page, link in links if not (folder / page.parent / link).exists()]
assert (folder / "INSTALL.md").exists() and len(links) > 30, links
sys.exit("\n".join(["links of the archive that lead nowhere:", *dead]) if dead else 0)
PY
[ -n "$debian" ] || { echo "fine: links of $(basename "$archive")"; exit 0; }
if [ ! -x "$debian/usr/bin/dpkg" ]; then
  debootstrap --variant=minbase bookworm "$debian" >/dev/null
fi
debian=$(realpath "$debian")
home=$debian/home/lab
rm -rf "$home" "$debian/opt"
mkdir -p "$home" "$debian/opt" "$debian/dev/shm"
tar -xzf "$archive" -C "$debian/opt" --strip-components=1
# Two materials with different vibrations, in NumPy's format.
"${PYTHON:-python3}" - "$home/own.npz" <<'PY'
import sys
import numpy
random = numpy.random.default_rng(1)
time = numpy.arange(150)[None, :, None]
X = [numpy.sin(time * (0.3 + 0.4 * (n % 2)) + random.uniform(0, 6, (1, 1, 16))) * 8 + 20 + random.normal(0, 1, (1, 150, 16)) for n in range(60)]
numpy.savez(sys.argv[1], X=numpy.concatenate(X), y=["cork", "felt"] * 30, sample_rate_hz=200)
PY
inside() {
  unshare --mount --pid --fork --mount-proc="$debian/proc" -- bash -c '
    mount --rbind /dev "$0/dev"
    exec chroot "$0" /usr/bin/env -i HOME=/home/lab PATH=/opt/bin:/usr/bin:/bin bash -ec "cd; $1"' "$debian" "$1"
}
inside 'tactnet version && tactnet train --data own.npz --epochs 4 --out own --json >own.json && tactnet train --recipe fast --data twin --steps 100 --epochs 1 --out twin >/dev/null'
grep -q '"accuracy\|"one_sweep' "$home/own.json"
inside 'tactnet demo --run own --listen 127.0.0.1:18750 >ready & demo=$!
  for i in $(seq 300); do grep -q ready ready && break; sleep 0.1; done
  exec 3<>/dev/tcp/127.0.0.1/18750; printf "GET / HTTP/1.0\r\n\r\n" >&3; timeout 5 cat <&3 | grep -q "fingertip"; kill -INT $demo; wait $demo'
echo "fine: $(basename "$archive") in $(grep PRETTY_NAME "$debian/etc/os-release" | cut -d'"' -f2)"
