#!/usr/bin/env bash
# Writes the files that are generated from serving/skin/src/packets.rs; with --check it compares them instead.
# Usage: tests/generated_packets.sh [--check] [TACTNET]
set -euo pipefail
cd "$(dirname "$0")/.."
check=
[ "${1:-}" != --check ] || { check=1; shift; }
tactnet=${1:-${CARGO_TARGET_DIR:-target}/ci/tactnet}
while read -r language file; do
  if [ -n "$check" ]; then
    "$tactnet" channel packets --language "$language" | diff -u "$file" - ||
      { echo "$file is not what serving/skin/src/packets.rs says: run tests/generated_packets.sh"; exit 1; }
  else
    mkdir -p "$(dirname "$file")"
    "$tactnet" channel packets --language "$language" >"$file"
  fi
done <<EOF
markdown docs/packets.md
c serving/c/include/tactnet/packets.h
cpp serving/c/include/tactnet/packets.hpp
python serving/python/python/tactnet/packets.py
proto serving/recording/proto/tactnet.proto
EOF
