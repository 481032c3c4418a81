#!/usr/bin/env bash
# Installs a wheel of the Python package in a Debian with Python and NumPy alone, without network, and trains, saves and loads there.
# Usage: check_wheel.sh WHEEL FOLDER_OF_DEBIAN
#
# Needs root. debootstrap fills the folder if it is empty; otherwise it is used again.
set -euo pipefail
wheel=$(realpath "$1") debian=$2
if [ ! -x "$debian/usr/bin/dpkg" ]; then
  debootstrap --variant=minbase --include=python3,python3-venv,python3-numpy bookworm "$debian" >/dev/null
fi
debian=$(realpath "$debian")
home=$debian/home/lab
rm -rf "$home"
mkdir -p "$home" "$debian/dev/shm"
cp "$wheel" "$home/"
cat >"$home/try.py" <<'PY'
import os, pickle, time
import numpy as np
import tactnet
from tactnet import channel

data = tactnet.Dataset.twin(materials=3, sweeps=20, steps=200)
train, test = data.folds()[0]
lda = tactnet.LdaClassifier(rate=750).fit(data.X[train], data.y[train])
assert lda.score(data.X[test], data.y[test]) > 0.5
lda.save("saved")
assert (tactnet.SweepClassifier.load("saved").predict(data.X) == pickle.loads(pickle.dumps(lda)).predict(data.X)).all()
with channel.Hub(bus="wheel") as hub, channel.Bus(hub.table) as bus, bus.commands() as commands:
    commands.stop()
print("tactnet", tactnet.__version__, "numpy", np.__version__)
PY
from=$SECONDS
unshare --net --mount --pid --fork --mount-proc="$debian/proc" -- bash -c '
  mount --rbind /dev "$0/dev"
  exec chroot "$0" /usr/bin/env -i HOME=/home/lab PATH=/usr/bin:/bin bash -ec "
    cd
    python3 -m venv --system-site-packages v
    v/bin/pip install --quiet --no-index ./*.whl
    v/bin/python try.py"' "$debian"
echo "fine: $(basename "$wheel") in $(grep PRETTY_NAME "$debian/etc/os-release" | cut -d'"' -f2), $((SECONDS - from)) s without network"
