#!/usr/bin/env bash
# Files with every fault of other people's data that is known, and sound ones: compares what `tactnet data check` and `data import` say
# with what they should say. Prints a table, with --json one object. Exit code 1 if any case is wrong.
#
#   tests/cases/run.sh --json
#   tests/cases/run.sh --only '^5 spike' --keep /tmp/spikes
#   tests/cases/run.sh --without parquet,mcap        for a program without these features
#
# --tactnet PROGRAM [default: target/release/tactnet, built if missing]
# --python PYTHON   with numpy, scipy, h5py, pyarrow, mcap and rosbags [default: a virtual environment in target/cases, made if missing]
set -euo pipefail
repository=$(cd "$(dirname "$0")/../.." && pwd)
here=$repository/tests/cases
tactnet='' python='' rest=()
while [ $# -gt 0 ]; do
  case $1 in
    --tactnet) tactnet=$(realpath "$2"); shift ;;
    --python) python=$2; shift ;;
    --json | --list) rest+=("$1") ;;
    --only | --without | --keep) rest+=("$1" "$2"); shift ;;
    *) sed -n '2,10s/^# \{0,1\}//p' "$0"; exit 2 ;;
  esac
  shift
done
if [ -z "$tactnet" ]; then
  tactnet=$repository/target/release/tactnet
  [ -x "$tactnet" ] || (cd "$repository" && cargo build --release --locked --features parquet,recording)
fi
if [ -z "$python" ]; then
  python=$repository/target/cases/bin/python
  if [ ! -x "$python" ]; then
    python3 -m venv "$repository/target/cases"
    "$python" -m pip install --quiet --disable-pip-version-check -r "$here/requirements.txt"
  fi
fi
exec "$python" "$here/cases.py" --tactnet "$tactnet" "${rest[@]}"
