#!/usr/bin/env bash
# Coverage-guided fuzzing with libFuzzer. The first corpus consists of valid inputs; inputs that reach new code are mutated further.
#
#   tests/attacks/fuzz/run.sh mcap 3600          one target for 3600 s
#   tests/attacks/fuzz/run.sh all 600            every target
#
# Needs `rustup toolchain install nightly` and `cargo install cargo-fuzz`. Prints a JSON row for each target. Corpora and failing inputs stay in
# the target folder, under fuzz-corpus and fuzz-artifacts.
set -euo pipefail
cd "$(dirname "$0")"
[ $# = 2 ] || { sed -n '2,8s/^# \{0,1\}//p' "$0"; exit 2; }
targets=(npz npz-members hdf5 mat csv parquet mcap messages run tables)
[ "$1" = all ] || targets=("$1")
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/../../../target/fuzz}
mkdir -p "$CARGO_TARGET_DIR"
failed=0
for target in "${targets[@]}"; do
  corpus=$CARGO_TARGET_DIR/fuzz-corpus/$target artifacts=$CARGO_TARGET_DIR/fuzz-artifacts/$target
  mkdir -p "$corpus" "$artifacts"
  # Instrumented by the compiler, checked by AddressSanitizer.
  cargo +nightly fuzz build --fuzz-dir . "$target" >&2
  program=$CARGO_TARGET_DIR/x86_64-unknown-linux-gnu/release/$target
  TACTNET_FUZZ_SEEDS=$corpus "$program" -runs=0 >/dev/null 2>&1
  code=0
  "$program" "$corpus" "-artifact_prefix=$artifacts/" "-max_total_time=$2" -timeout=20 -rss_limit_mb=4096 -max_len=65536 \
    -print_final_stats=1 >"$CARGO_TARGET_DIR/fuzz-$target.log" 2>&1 || code=$?
  [ $code = 0 ] || failed=1
  python3 - "$target" "$CARGO_TARGET_DIR/fuzz-$target.log" "$corpus" "$artifacts" $code <<'PY'
import json, pathlib, re, sys
target, log, corpus, artifacts, code = sys.argv[1:]
text = pathlib.Path(log).read_text(errors="replace")
number = lambda pattern: int((re.findall(pattern, text) or ["0"])[-1])
found = [path.name for path in pathlib.Path(artifacts).iterdir()]
print(json.dumps({"target": target, "how": "libFuzzer", "executions": number(r"number_of_executed_units: (\d+)"), "covered": number(r"cov: (\d+)"),
                  "corpus": len(list(pathlib.Path(corpus).iterdir())), "exit": int(code), "found": found}), flush=True)
PY
done
exit $failed
