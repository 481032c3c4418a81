#!/usr/bin/env bash
# Creates the release archive: program, manual pages, shell completions, INSTALL, README, documentation with all linked files, licences.
#
#   packaging/release.sh                          statically linked, for any Linux of this architecture
#   packaging/release.sh --features parquet       with optional features
#   packaging/release.sh --program FILE           packs an existing program
#   packaging/release.sh --out FOLDER             default: dist
set -euo pipefail
cd "$(dirname "$0")/.."
program='' features='' out=dist
while [ $# -gt 0 ]; do
  case $1 in
    --program) program=$2 ;;
    --features) features=$2 ;;
    --out) out=$2 ;;
    *) sed -n '2,7s/^# \{0,1\}//p' "$0"; [ "$1" = --help ] && exit 0; exit 2 ;;
  esac
  shift 2
done

if [ -z "$program" ]; then
  host=$(rustc -vV | sed -n 's/^host: //p')
  # Libraries loaded at run time (ONNX Runtime, Vulkan, CUDA) need a dynamic C library.
  case ",$features," in
    *,onnxruntime,* | *,vulkan,* | *,cuda,*) linked='' ;;
    *) linked='-C target-feature=+crt-static' ;;
  esac
  RUSTFLAGS="${RUSTFLAGS:-} $linked" cargo build --release --locked --target "$host" --bin tactnet --features "$features"
  program=${CARGO_TARGET_DIR:-target}/$host/release/tactnet
fi

version=$("$program" version --json | sed -n 's/.*"version": *"\([^"]*\)".*/\1/p' | head -1)
name=tactnet-$version-$(uname -m)-linux
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
folder=$work/$name
mkdir -p "$folder"/{bin,share/man/man1,share/bash-completion/completions,share/zsh/site-functions,share/fish/vendor_completions.d}
cp "$program" "$folder/bin/tactnet"
strip "$folder/bin/tactnet"
"$program" man --out "$folder/share/man/man1" 2>/dev/null
"$program" completions bash >"$folder/share/bash-completion/completions/tactnet"
"$program" completions zsh >"$folder/share/zsh/site-functions/_tactnet"
"$program" completions fish >"$folder/share/fish/vendor_completions.d/tactnet.fish"
cp -r README.md CHANGELOG.md SECURITY.md LICENSE* docs packaging/INSTALL.md "$folder/"
# Files linked from the documents, and files linked from those.
declare -A packed
more=1
while [ $more = 1 ]; do
  more=0
  while read -r document; do
    while read -r link; do
      target=$(realpath -m --relative-to=. "$(dirname "$document")/$link")
      [ -z "${packed[$target]:-}" ] && [ -e "$target" ] || continue
      packed[$target]=1 more=1
      mkdir -p "$(dirname "$folder/$target")"
      cp -rT "$target" "$folder/$target"
    done < <(grep -oE '\]\([^)#[:space:]]+' "$document" | sed 's/^](//' | grep -v '^[a-z]*:')
  done < <(cd "$folder" && find . -name '*.md' ! -path ./INSTALL.md | sort)
done
mkdir -p "$out"
archive=$out/$name.tar.gz
tar --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$(git log -1 --format=%ct 2>/dev/null || echo 0)" -C "$work" -c "$name" | gzip -n >"$archive"
(cd "$out" && sha256sum "$name.tar.gz" >"$name.tar.gz.sha256")
echo "$archive"
