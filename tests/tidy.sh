#!/bin/sh
# tidy.sh MINUTES: clang-tidy by the rules of .clang-tidy over product sources that the last 20 commits changed, the latest
# first, until the time is over; says how many were left. Exit 1 where a source has a warning.
set -eu
cd "$(dirname "$0")/.."
end=$(($(date +%s) + $1 * 60))
# compiled each alone, so that a warning is that of one source; no precompiled header is made
cmake --preset dev -B build/tidy -DABBE_TESTS=OFF -DABBE_PYTHON_MODULE=OFF >/dev/null
changed=$(git log -20 --name-only --format= -- 'kinematics/*.cpp' 'errors/*.cpp' 'cutting/*.cpp' 'render/*.cpp' \
  'sim/*.cpp' ':!sim/python' | awk '!seen[$0]++')
checked=0 left=0 failed=0
for source in $changed; do
  [ -f "$source" ] || continue
  if [ "$(date +%s)" -ge "$end" ]; then
    left=$((left + 1))
    continue
  fi
  clang-tidy -p build/tidy --quiet --extra-arg=-Wno-unused-command-line-argument --warnings-as-errors='*' "$source" 2>/dev/null || failed=$((failed + 1))
  checked=$((checked + 1))
done
echo "clang-tidy: $checked sources checked, $failed with warnings, $left left out after $1 minutes"
[ "$failed" -eq 0 ]
