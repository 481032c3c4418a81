#!/usr/bin/env bash
# Hostile input for all readers of files and foreign packets, and kills at random moments. Prints one JSON document with a row for each attack, and
# the attacks that were skipped because the build lacks an optional feature.
#
#   tests/attacks/run.sh --quick     a minute, in CI
#   tests/attacks/run.sh --full      hours: ten million inputs or an hour per target, 200 kills of each kind, 500 on the channels
#
#   tests/attacks/run.sh --full --part inputs     one part of it: inputs, kills or long
#
# Failing inputs are kept in the folder tactnet-attacks in the folder for temporary files.
# --programs DIR names the folder with `tactnet` and `tactnet-attacks` [default: target/release, built if missing].
set -euo pipefail
repository=$(cd "$(dirname "$0")/../.." && pwd)
programs=$repository/target/release how='' parts='inputs kills long'
while [ $# -gt 0 ]; do
  case $1 in
    --quick) how=quick ;;
    --full) how=full ;;
    --part) parts=$2; shift ;;
    --programs) programs=$(realpath "$2"); shift ;;
    *) how='' && break ;;
  esac
  shift
done
[ -n "$how" ] || { sed -n '2,11s/^# \{0,1\}//p' "$0"; exit 2; }
if [ ! -x "$programs/tactnet" ] || [ ! -x "$programs/tactnet-attacks" ]; then
  (cd "$repository" && cargo build --release --locked --package tactnet --package tactnet-attacks)
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [ $how = quick ]; then
  # The channel holds 0.34 s at six times the speed, as on a robot.
  inputs=(--seconds 2) kills=(--kills 2) long=(--frames 100000 --speed 6 --depth 1536)
else
  inputs=(--seconds 3600 --executions 10000000) kills=(--kills 200 --channel-kills 500)
  # A day of skin data in 36 minutes; the channel holds 0.14 s of it, on a robot 0.34 s.
  long=(--frames 64800000 --speed 40 --depth 4096)
fi
failed=0
for part in $parts; do
  case $part in
    inputs) attack=("$programs/tactnet-attacks" "${inputs[@]}" --out "${TMPDIR:-/tmp}/tactnet-attacks") ;;
    kills) attack=(python3 "$repository/tests/attacks/kills.py" --tactnet "$programs/tactnet" "${kills[@]}") ;;
    long) attack=(python3 "$repository/tests/attacks/long_run.py" --tactnet "$programs/tactnet" "${long[@]}") ;;
    *) echo "error: --part: expected inputs, kills or long, found $part" >&2; exit 2 ;;
  esac
  "${attack[@]}" >"$work/$part.json" || failed=1
  [ -s "$work/$part.json" ] || { echo "error: part $part printed no report" >&2; exit 1; }
done
"$programs/tactnet" version --json >"$work/version"
python3 - "$how" "$work/version" "$work"/*.json <<'PY'
import json, sys
how, version, *files = sys.argv[1:]
parts = [json.load(open(file)) for file in sorted(files)]
rows = [row for part in parts for row in part["rows"]]
skipped = [target for part in parts for target in part.get("skipped", [])]
print(json.dumps({"schema_version": 1, "how": how, "program": json.load(open(version)), "rows": rows, "skipped": skipped}, indent=2))
PY
exit $failed
