#!/usr/bin/env bash
# Writes the files that are generated from packets.rs of serving/skin and catching/packets. With --check it compares them instead. The book has
# the pages (tests/book.py).
# Usage: tests/generated_packets.sh [--check] [TACTNET]
set -euo pipefail
cd "$(dirname "$0")/.."
check=
[ "${1:-}" != --check ] || { check=1; shift; }
tactnet=${1:-${CARGO_TARGET_DIR:-target}/release/tactnet}
while read -r of language file; do
  if [ -n "$check" ]; then
    "$tactnet" channel packets --of "$of" --language "$language" | diff -u "$file" - ||
      { echo "$file is not what packets.rs says: run tests/generated_packets.sh"; exit 1; }
  else
    mkdir -p "$(dirname "$file")"
    "$tactnet" channel packets --of "$of" --language "$language" >"$file"
  fi
done <<EOF
tactile c bindings/c/include/tactnet/packets.h
tactile cpp bindings/c/include/tactnet/packets.hpp
tactile python bindings/python/python/tactnet/packets.py
tactile proto channel/recording/proto/tactnet.proto
catching proto channel/recording/proto/tactnet_catching.proto
EOF
