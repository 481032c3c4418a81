#!/usr/bin/env bash
# Installs the library for C and C++: headers, libtactnet_channel.so and .a, CMake and pkg-config files.
#
#   bindings/c/install.sh --prefix DIR [--built FOLDER]
#
# `--built` is the folder with libtactnet_c.so and .a; without it the script builds a release version.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
prefix='' built=''
while [ $# -gt 0 ]; do
  case $1 in
    --prefix) prefix=$2; shift ;;
    --built) built=$2; shift ;;
    *) sed -n '2,6s/^# \{0,1\}//p' "$0"; [ "$1" = --help ] && exit 0; exit 2 ;;
  esac
  shift
done
[ -n "$prefix" ] || { echo "error: expected --prefix DIR" >&2; exit 2; }
if [ -z "$built" ]; then
  (cd "$here/../.." && cargo build --release --locked --quiet -p tactnet-c)
  built=$(cd "$here/../.." && cargo metadata --no-deps --format-version 1 | python3 -c 'import json, sys; print(json.load(sys.stdin)["target_directory"])')/release
fi
version=0.2.0
mkdir -p "$prefix/include/tactnet" "$prefix/lib/cmake/tactnet_channel" "$prefix/lib/pkgconfig"
prefix=$(cd "$prefix" && pwd)
cp "$here"/include/tactnet/* "$prefix/include/tactnet/"
install -m 755 "$built/libtactnet_c.so" "$prefix/lib/libtactnet_channel.so.$version"
ln -sf "libtactnet_channel.so.$version" "$prefix/lib/libtactnet_channel.so.${version%%.*}"
ln -sf "libtactnet_channel.so.${version%%.*}" "$prefix/lib/libtactnet_channel.so"
install -m 644 "$built/libtactnet_c.a" "$prefix/lib/libtactnet_channel.a"
cp "$here"/cmake/*.cmake "$prefix/lib/cmake/tactnet_channel/"
cat >"$prefix/lib/pkgconfig/tactnet_channel.pc" <<EOF
prefix=\${pcfiledir}/../..
Name: tactnet_channel
Description: Channels between robot components
Version: $version
Cflags: -I\${prefix}/include
Libs: -L\${prefix}/lib -ltactnet_channel
Libs.private: -lgcc_s -lpthread -ldl -lm
EOF
echo "installed in $prefix; programs find it with -DCMAKE_PREFIX_PATH=$prefix or PKG_CONFIG_PATH=$prefix/lib/pkgconfig"
