#!/usr/bin/env bash
# Writes the generated part of docs/cli.md anew. Usage: cli_reference.sh [TACTNET], a program with the feature `full`.
set -euo pipefail
cd "$(dirname "$0")/.."
tactnet=${1:-${CARGO_TARGET_DIR:-target}/release/tactnet}
marker='<!-- tactnet man --markdown -->'
head=$(sed "/$marker/q" docs/cli.md)
{ printf '%s\n\n' "$head"; "$tactnet" man --markdown; } >docs/cli.md.new
mv docs/cli.md.new docs/cli.md
