#!/usr/bin/env bash
# Tests the C and C++ library as users have it: installed, found by CMake and pkg-config, compiled without warnings, with a real hub and a
# real classifier, under AddressSanitizer, and with the speed of Rust.
#
#   tests/c/run.sh [--built FOLDER] [--rounds N] [--json]
#
# Needs cc, c++, cmake and pkg-config. `--built` names the folder of a build of all crates and examples, with the program `tactnet`.
set -euo pipefail
repository=$(cd "$(dirname "$0")/../.." && pwd)
built=${CARGO_TARGET_DIR:-$repository/target}/release rounds=20000 json=''
while [ $# -gt 0 ]; do
  case $1 in
    --built) built=$(realpath "$2"); shift ;;
    --rounds) rounds=$2; shift ;;
    --json) json=1 ;;
    *) sed -n '2,7s/^# \{0,1\}//p' "$0"; [ "$1" = --help ] && exit 0; exit 2 ;;
  esac
  shift
done
tactnet=$built/tactnet
for file in "$tactnet" "$built/libtactnet_c.so" "$built/libtactnet_c.a" "$built/examples/round_trip"; do
  [ -e "$file" ] || { echo "error: $file is missing: cargo build --release -p tactnet -p tactnet-c --bins --lib --examples" >&2; exit 2; }
done
work=$(mktemp -d)
pids=()
finish() {
  kill "${pids[@]}" 2>/dev/null || true
  wait 2>/dev/null || true
  rm -rf "$work"
}
trap finish EXIT
cd "$work"
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-$work}
say() { echo "ok      $*" >&2; }
# until_ready FILE: waits for its first line.
until_ready() {
  for _ in $(seq 200); do
    ! grep -q . "$1" 2>/dev/null || return 0
    sleep 0.05
  done
  echo "error: $1 stayed empty" >&2
  return 1
}

# --- installed, found, compiled
"$repository/bindings/c/install.sh" --prefix "$work/prefix" --built "$built" >/dev/null
flags=(-O2 -Wall -Wextra -Wpedantic -Wconversion -Werror)
export PKG_CONFIG_PATH=$work/prefix/lib/pkgconfig LD_LIBRARY_PATH=$work/prefix/lib
read -ra linked < <(pkg-config --cflags --libs tactnet_channel)
for example in skin_driver belief_reader round_trip; do
  cc -std=c11 -D_POSIX_C_SOURCE=200809L "${flags[@]}" -fsanitize=address,undefined -g "$repository/bindings/c/examples/$example.c" \
    "${linked[@]}" -o "$example.checked"
done
cc -std=c11 "${flags[@]}" "$repository/bindings/c/examples/round_trip.c" "${linked[@]}" -o round_trip
cc -std=c11 -D_POSIX_C_SOURCE=200809L "${flags[@]}" -fsanitize=address,undefined -g "$repository/tests/c/faults.c" "${linked[@]}" -pthread -o faults
cc -std=c11 "${flags[@]}" "$repository/tests/c/packet_bytes.c" "${linked[@]}" -o packet_bytes
cmake -S "$repository/tests/c/app" -B app -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_BUILD_TYPE=Release >cmake.log || { cat cmake.log; exit 1; }
cmake --build app >cmake.log 2>&1 || { cat cmake.log; exit 1; }
say "installed; found by pkg-config and by CMake, shared and static; C11 and C++17 without a warning"

# --- bytes
"$built/examples/packet_bytes" >rust.txt
./packet_bytes >c.txt
diff rust.txt c.txt
say "the same packets have the same bytes in Rust and C ($(wc -l <rust.txt) packets)"

# --- a private hub for faults, threads and round trips
cat >bench.toml <<'EOF'
bus = "c-bench"
[channels.ping]
packet = "SkinFrame"
version = 2
item_bytes = 4120
[channels.pong]
packet = "SkinFrame"
version = 2
item_bytes = 4120
EOF
"$tactnet" channel hub --table bench.toml >hub.log 2>&1 &
pids+=($!)
until_ready hub.log
timeout 60 ./faults bench.toml
timeout 60 app/round_trip_cpp bench.toml
timeout 60 app/round_trip_static bench.toml
say "wrong calls are answered with code and text; packets are given back; priorities, losses, own channels; C++ moves and closes, shared and static"

# --- a driver and a reader in C around a classifier
"$tactnet" data twin --materials 4 --sweeps 15 --steps 300 --out twin.h5 >/dev/null 2>&1
"$tactnet" train --recipe fast --data twin.h5 --epochs 12 --out run >/dev/null 2>&1
"$tactnet" serve --print-table >robot.toml 2>/dev/null
# The sweeps of this data set are complete windows, so no frame is skipped.
sed -i 's/^bus = .*/bus = "c-robot"/; s/^skip = "333ms" /skip = 0 /' robot.toml
"$built/examples/sweeps_as_text" twin.h5 6 >frames.txt 2>truth.txt
"$tactnet" channel hub --table robot.toml >robot_hub.log 2>&1 &
pids+=($!)
until_ready robot_hub.log
"$tactnet" serve --run run --table robot.toml >serve.log 2>&1 &
pids+=($!)
for _ in $(seq 200); do
  ! "$tactnet" channel list --table robot.toml 2>/dev/null | grep -q 'tactile/belief.* 1 ' || break
  sleep 0.1
done
./belief_reader.checked robot.toml tactile/belief tactile/model 6 >beliefs.txt &
reader=$!
until_ready beliefs.txt
sleep 1
timeout 60 ./skin_driver.checked robot.toml skin/right sweep/command 750 <frames.txt
wait $reader || { cat beliefs.txt serve.log; exit 1; }
right=0
while read -r motion material; do
  ! grep -q "^motion $motion: $material " beliefs.txt || right=$((right + 1))
done <truth.txt
cat beliefs.txt
grep -q '^6 sweeps, 0 beliefs lost' beliefs.txt
[ $right -ge 4 ] || { echo "error: $right of 6 materials are right"; cat truth.txt; exit 1; }
say "six sweeps from a driver in C came back as beliefs to a reader in C, $right of 6 right, no leak and no error of AddressSanitizer"

# --- round trips, in turns
measure() {
  "$1" bench.toml pong >pong.log &
  local pong=$!
  until_ready pong.log
  timeout 60 "$1" bench.toml ping "$rounds"
  wait $pong
}
for _ in 1 2 3 4 5; do
  measure ./round_trip >>c_times
  measure "$built/examples/round_trip" >>rust_times
done
python3 - "$rounds" "$json" <<'EOF'
import json, statistics, sys
def times(file):
    rows = [[int(value) for value in line.split()] for line in open(file)]
    return [statistics.median(row[column] for row in rows) for column in (0, 1)]
c, rust = times("c_times"), times("rust_times")
found = {"rounds": 5 * int(sys.argv[1]), "c_median_ns": c[0], "rust_median_ns": rust[0], "ratio": round(c[0] / rust[0], 3), "c_p99_ns": c[1], "rust_p99_ns": rust[1]}
print(json.dumps(found) if sys.argv[2] else f"round trip of a frame of 4120 bytes, median (99 %): C {c[0]} ({c[1]}) ns, Rust {rust[0]} ({rust[1]}) ns, ratio {found['ratio']}")
EOF
