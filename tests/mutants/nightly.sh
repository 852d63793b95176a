#!/usr/bin/env bash
# Whether the tests would notice a slip: cosmic-ray tries slips of every folder in random order, MINUTES (10) of each.
#
#     tests/mutants/nightly.sh                    every folder of pipeline and stages, some five hours
#     tests/mutants/nightly.sh stages/fusion      a folder or a file
#
# It works on a copy of the last commit. build/mutants keeps a session of each folder: `cr-report --show-diff
# build/mutants/stages.fusion.sqlite` shows every slip and what became of it. Exit status 1 where a folder has less than
# 90 % killed.
set -euo pipefail
cd "$(dirname "$0")/../.."
export PATH="$PWD/.venv/bin:$PATH" OPENBLAS_NUM_THREADS=1 MPLBACKEND=agg
kept=$PWD/build/mutants copy=$PWD/build/mutants/copy
git worktree remove --force "$copy" 2>/dev/null || true
rm -rf "$kept"
mkdir -p "$kept"
git worktree add --quiet --detach "$copy" HEAD
trap 'git worktree remove --force "$copy"' EXIT
cd "$copy"
[ $# -gt 0 ] || set -- pipeline/*/ stages/*/
export PYTHONPATH=$copy
for folder in "$@"; do
    folder=${folder%/} name=${folder//\//.}
    tests=tests/${folder%.py}
    [ -e "$tests" ] || tests=$(dirname "$tests")/test_$(basename "$folder")  # of a file
    [ -e "$tests" ] || tests=tests/${folder#*/}                              # of pipeline/cli: tests/cli
    settings=$kept/$name.toml session=$kept/$name.sqlite
    sed "s|FOLDER|$folder|; s|TESTS|$tests|" tests/mutants/mutants.toml > "$settings"
    cosmic-ray init "$settings" "$session"
    cr-filter-operators "$session" "$settings" > /dev/null
    cosmic-ray baseline "$settings" || { echo "$folder: $tests fails without any slip"; exit 1; }
    timeout -s KILL "${MINUTES:-10}m" cosmic-ray exec "$settings" "$session" || [ $? = 137 ]  # with what it tests
    pkill -KILL -f -- "--import-mode=importlib $tests" || true  # a slip may never end, in a session of its own
    git checkout --quiet .  # the slip at which the time was over
done
python tests/mutants/rates.py "$kept"
