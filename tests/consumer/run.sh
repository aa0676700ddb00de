#!/bin/sh
# run.sh BUILD SCENES: installs what BUILD holds into a new folder, builds this project against that
# alone, runs its programs and checks what they say.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$1" --prefix "$work/abbe" >"$work/install"
cp -r "$here" "$work/consumer"
if grep -rlE '"-(Wall|Wextra|Wshadow|Wpedantic)|;-W' "$work/abbe/lib"*/cmake "$work/abbe/lib"/*/cmake 2>/dev/null; then
  echo "the installed targets push warning flags on their users"
  exit 1
fi
cmake -S "$work/consumer" -B "$work/build" -DCMAKE_PREFIX_PATH="$work/abbe" -DCMAKE_BUILD_TYPE=Release >"$work/configure" || { cat "$work/configure"; exit 1; }
cmake --build "$work/build" --parallel 2 >"$work/make" || { cat "$work/make"; exit 1; }
"$work/build/pose" >"$work/pose"
cat "$work/pose"
grep -q 'tip off by -20.000 um along X' "$work/pose"
"$work/build/residual" "$2/gantry_dome.toml" >"$work/residual"
cat "$work/residual"
# the installed program says the same
"$work/abbe/bin/abbe" run "$2/gantry_dome.toml" --set part.vertices=2000 --out "$work/out" >"$work/said"
for number in $(grep -oE '[0-9]+\.[0-9]{4}' "$work/residual"); do
  grep -q "^uncompensated.* $number " "$work/said" || { echo "abbe does not say $number:"; cat "$work/said"; exit 1; }
done
# it finds its scenes where it is installed, from anywhere, and writes a first one that runs
(cd "$work" && abbe/bin/abbe --version && abbe/bin/abbe new lathe first && abbe/bin/abbe compare first/scene.toml) >"$work/new"
grep -q "^scenes *$(realpath "$work")/abbe/share/abbe/scenes\$" "$work/new" || { cat "$work/new"; exit 1; }
[ -s "$work/out/scene/comparison.json" ]
(cd "$work" && abbe/bin/abbe check library:gantry_dome >"$work/checked")
"$work/build/compensator" "$2/gantry_dome.toml" >"$work/compensator"
cat "$work/compensator"
# mean A -> B, RMS C -> D
awk '{ if (!($5 < 0.2 * $2 && $11 < 0.5 * $8)) exit 1 }' "$work/compensator"
for file in "$here"/*.cpp; do
  [ "$(wc -l <"$file")" -lt 40 ] || { echo "$file has 40 lines or more"; exit 1; }
done
