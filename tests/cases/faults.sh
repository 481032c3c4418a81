#!/usr/bin/env bash
# Faults under load and in other people's programs: runs the tests that hold each promise, and prints a table, with --json one object with
# `cases` and `right`. A test that is missing or leaves itself out counts as wrong. Exit code 1 if any case is wrong.
#
#   tests/cases/faults.sh --json
#   tests/cases/faults.sh --only order,losses
#   tests/cases/faults.sh --check                    only that every test exists, in seconds
#
# FEATURES and CARGO_TARGET_DIR are those of tests/run. --python PYTHON has numpy, scikit-learn and pytest [default: python3].
# The priority under load is measured: its bar needs a machine that does nothing else.
set -euo pipefail
exec python3 "$(dirname "$0")/faults.py" "$@"
