#!/usr/bin/env bash
# The first hour of a new user as a script, in an empty folder: own data, training, live predictions, a report, errors of the command line.
#
#   tests/first_hour.sh [--json] [--tactnet FILE] [--python FILE]
#
# Python needs NumPy; with onnxruntime the exported network runs, too. `--json` prints `steps` and `passed` at the end.
set -uo pipefail
repository=$(cd "$(dirname "$0")/.." && pwd)
json='' tactnet=$repository/target/release/tactnet python=python3
while [ $# -gt 0 ]; do
  case $1 in
    --json) json=1 ;;
    --tactnet) tactnet=$(realpath "$2"); shift ;;
    --python) python=$2; case $2 in */*) python=$(cd "$(dirname "$2")" && pwd)/$(basename "$2") ;; esac; shift ;;
    *) sed -n '2,6s/^# \{0,1\}//p' "$0"; [ "$1" = --help ] && exit 0; exit 2 ;;
  esac
  shift
done
[ -x "$tactnet" ] || { echo "$tactnet: no program; build it with \`cargo build --release\` or name it with --tactnet" >&2; exit 2; }
work=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null; rm -rf "$work"' EXIT
cd "$work"
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-$work}

steps=0 passed=0 failed=()
# step WORDS COMMAND...: one check; prints the command's output on failure.
step() {
  local words=$1 begun=$SECONDS
  shift
  steps=$((steps + 1))
  if "$@" >said 2>&1; then
    passed=$((passed + 1))
    echo "ok      $words ($((SECONDS - begun)) s)" >&2
  else
    failed+=("$words")
    { echo "FAILED  $words"; sed 's/^/        /' said | tail -15; } >&2
  fi
}
# exits CODE WORDS COMMAND...: checks the exit code, the words in one line, and that at most one line starts with `error:`.
exits() {
  local code=$1 words=$2 found=0
  shift 2
  "$@" >out 2>err </dev/null || found=$?
  cat err
  [ $found = "$code" ] || { echo "expected exit code $code, found $found"; return 1; }
  grep -qF -- "$words" err || { echo "expected \`$words\`"; return 1; }
  [ "$code" = 0 ] || [ "$(grep -c '^error' err)" = 1 ] || { echo "expected one line of error"; return 1; }
  ! grep -q 'error:.*error:' err
}
t() { "$tactnet" "$@"; }
# t runs the program with stdout and stderr combined.
says() {
  local words=$1
  shift
  "$@" 2>&1 </dev/null | tee shown
  grep -qF -- "$words" shown
}

# --- help
step 'version names the commit and the features' says 'optional features' t version
step 'help COMMAND is COMMAND --help' says '--calibrate' t help train
manual() { t man --out man && man=$(cat man/tactnet-train.1) && [[ $man == *calibrate* ]]; }
step 'manual pages of every command' manual
completed() { t completions bash >c.bash && bash -n c.bash && grep -q experiment c.bash && t completions zsh >c.zsh && t completions fish >c.fish; }
step 'completions for three shells' completed
plain_help() { NO_COLOR=1 t train --help | grep -q $'\033' && return 1; return 0; }
step 'NO_COLOR is honoured' plain_help

# --- own data
make_data() {
  "$python" - <<'PY'
import csv, os
import numpy
random = numpy.random.default_rng(1)
time = numpy.arange(150)[:, None]
names = ["cork", "felt", "steel"]
def sweep(n):
    return numpy.sin(time * (0.2 + 0.3 * (n % 3)) + random.uniform(0, 6, 16)) * 8 + 20 + random.normal(0, 1, (150, 16))
X = numpy.array([sweep(n) for n in range(300)])
y = [names[n % 3] for n in range(300)]
numpy.savez("own.npz", X=X.astype("f2"), y=y)
numpy.savez("rated.npz", X=X[:90].reshape(90, 150, 4, 4).astype("f4"), y=numpy.arange(90) % 3, sample_rate_hz=200)
numpy.savez("few.npz", X=X[:9].astype("f4"), y=y[:9], sample_rate_hz=200)
numpy.savez("axes.npz", X=X[:90].reshape(90, 150, 4, 4).transpose(0, 2, 3, 1).astype("f4"), y=y[:90], sample_rate_hz=200)
numpy.savez("nothing.npz", Z=X)
for n in range(9):
    os.makedirs(f"table/{y[n]}", exist_ok=True)
    numpy.savetxt(f"table/{y[n]}/{n}.csv", X[n], fmt="%.2f", delimiter=",")
PY
}
step 'six lines of NumPy write a data set' make_data
step 'check: the sample rate is assumed, and says so' says 'assumed' t data check own.npz
step 'check: axes in a suspicious order' says 'axes' t data check axes.npz
step 'check: too few sweeps, with the remedy' says '3 folds' t data check few.npz
step 'a file without X names what it wants' exits 2 'X' t data check nothing.npz
step 'import: a folder of CSV' t data import table --out table.npz --rate 200 --shape 4x4
step 'import: a table that is none is what the error names' exits 2 'nothing.csv' t data import nothing.csv --out z.npz
step 'train on own data, at a rate that is named' t train --data own.npz --rate 200 --epochs 6 --calibrate --out own
step 'train on integers as materials' t train --data rated.npz --model knn-h --out rated
step 'train on three sweeps a material: hold-out' t train --data few.npz --split hold-out --model knn-l --out few
step 'train at an assumed rate warns' says '750 Hz is assumed' t train --data own.npz --epochs 1 --out assumed
step 'evaluate again' says 'fine' sh -c "'$tactnet' eval own --json && echo fine"
from_elsewhere() { mkdir -p elsewhere && (cd elsewhere && "$tactnet" eval ../own --json >/dev/null); }
step 'evaluate from any folder' from_elsewhere

resumed() {
  "$tactnet" train --data rated.npz --epochs 40 --out later >/dev/null 2>&1 &
  local process=$!
  for _ in $(seq 200); do [ -s later/members/0/metrics.jsonl ] && break; sleep 0.05; done
  kill -INT $process
  wait $process
  cd elsewhere && "$tactnet" train --resume ../later --json >/dev/null
}
step 'stopped and resumed from another folder' resumed
cd "$work"

# --- live predictions
free_port() { "$python" -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }
port_taken() {
  local port
  port=$(free_port)
  "$python" -c "import socket, time; s = socket.socket(); s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1); s.bind(('127.0.0.1', $port)); s.listen(); print('bound', flush=True); time.sleep(20)" >bound &
  local holder=$!
  for _ in $(seq 100); do grep -q bound bound && break; sleep 0.05; done
  local begun=$SECONDS code=0
  exits 2 "(process $holder) uses that port" t demo --listen "127.0.0.1:$port" || code=1
  kill $holder
  [ $code = 0 ] && [ $((SECONDS - begun)) -le 5 ] && grep -q 'is free' err
}
step 'a port that is taken: at once, its holder and a free one' port_taken
live() {
  local port demo code=0
  port=$(free_port)
  "$tactnet" demo --run own --listen "127.0.0.1:$port" >demo 2>demo.err &
  demo=$!
  "$python" - "$port" <<'PY' || code=1
import json, sys, time, urllib.request
address = f"http://127.0.0.1:{sys.argv[1]}"
for _ in range(300):
    try:
        page = urllib.request.urlopen(address, timeout=5).read().decode()
        break
    except OSError:
        time.sleep(0.1)
assert "fingertip" in page
begun = time.monotonic()
for line in urllib.request.urlopen(address + "/events", timeout=30):
    if line.startswith(b"data:"):
        view = json.loads(line[5:])
        if view.get("score") and view["score"].get("all", 0) >= 1:
            print(view["score"])
            break
    assert time.monotonic() - begun < 60, "no object was finished in a minute"
PY
  kill -INT $demo
  wait $demo || code=1
  cat demo.err
  return $code
}
step 'a live belief from the own network, with truth and score' live

# --- a report
report() {
  t experiment run crossval_baselines --set 'data="rated.npz"' --set folds=2 --set 'models=["knn-l", "knn-h"]' --out report >/dev/null 2>&1 && [ -s report/report.html ]
}
step 'a report on own data' report
headline() { "$python" - <<'PY'
import re
text = open("report/report.html").read()
body = re.sub(r"<(style|script)[^>]*>.*?</\1>", "", text, flags=re.S)
words = re.sub(r"\s+", " ", re.sub("<[^>]+>", " ", body[body.index("<body"):]))
assert "%" in words[:600], words[:600]
PY
}
step 'it begins with the best result' headline

# --- errors
step 'did you mean: recipes' exits 2 'did you mean `thesis`?' t train --recipe tesis
step 'did you mean: studies' exits 2 'did you mean `nshot`?' t experiment run nshto
step 'did you mean: settings' exits 2 'did you mean `folds`?' t experiment run crossval_baselines --set fold=2
step 'did you mean: materials' exits 2 'did you mean `felt`?' t enroll own --data own.npz --material fetl --out with-felt
step '--mc of a baseline' exits 2 'without dropout' t eval rated --mc 10
step 'a data set that was moved' exits 2 '--data' sh -c "mv few.npz moved.npz; exec '$tactnet' eval few"
step 'a table that is not there' exits 2 'robot.toml' t record --table robot.toml --out a.mcap
t serve --print-table >robot.toml 2>/dev/null
sed -i "s/^bus = .*/bus = \"hour$$\"/" robot.toml
step 'no hub: record' exits 2 'hub' t record --table robot.toml --out a.mcap
step 'no hub: simulate' exits 2 'hub' t simulate skin --table robot.toml
left_out() {
  if t version --json | "$python" -c 'import json, sys; sys.exit("rerun" in json.load(sys.stdin)["features"])'; then
    exits 2 '--features rerun' t data view own.npz
  fi
}
step 'a feature that is not built in names the build that has it' left_out

# --- the exported network
onnx() {
  t export own --out plain.onnx && t export own --out masks.onnx --masks || return 1
  "$python" -c 'import onnxruntime' 2>/dev/null || { echo 'onnxruntime is not there: left out'; return 0; }
  "$python" - <<'PY'
import os, subprocess, sys
import onnxruntime
for name in ("plain", "masks"):
    os.replace(f"{name}.onnx", "model.onnx")
    program = onnxruntime.InferenceSession("model.onnx").get_modelmeta().description.split("\n\n")[1]
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert ran.stdout.strip() in ("cork", "felt", "steel") and not ran.stderr, (name, ran)
PY
}
step 'ONNX: what its description says runs, without a warning, with masks too' onnx

if [ -n "$json" ]; then
  printf '{"steps": %s, "passed": %s, "failed": [' "$steps" "$passed"
  for ((i = 0; i < ${#failed[@]}; i++)); do printf '%s"%s"' "$([ $i = 0 ] || echo ', ')" "${failed[$i]//\"/\'}"; done
  printf ']}\n'
fi
[ "$passed" = "$steps" ]
