#!/usr/bin/env bash
# Writes the files that are generated from packets.rs of serving/skin and catching/packets, and from the description of a test. With --check it
# compares them instead. The book has the pages (tests/book.py).
# Usage: tests/generated_packets.sh [--check] [TACTNET]
set -euo pipefail
cd "$(dirname "$0")/.."
check=
[ "${1:-}" != --check ] || { check=1; shift; }
tactnet=${1:-${CARGO_TARGET_DIR:-target}/release/tactnet}
own=channel/packet/tests/own_packets
while read -r option of language file; do
  if [ -n "$check" ]; then
    "$tactnet" channel packets "$option" "$of" --language "$language" | diff -u "$file" - ||
      { echo "$file is not what its source says: run tests/generated_packets.sh"; exit 1; }
  else
    mkdir -p "$(dirname "$file")"
    "$tactnet" channel packets "$option" "$of" --language "$language" >"$file"
  fi
done <<EOF
--of tactile c bindings/c/include/tactnet/packets.h
--of tactile cpp bindings/c/include/tactnet/packets.hpp
--of tactile python bindings/python/python/tactnet/packets.py
--of tactile proto channel/recording/proto/tactnet.proto
--of catching proto channel/recording/proto/tactnet_catching.proto
--from $own/arm.toml rust $own/arm_packets.rs
EOF
