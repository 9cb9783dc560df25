#!/usr/bin/env bash
# Instruction counts of the benches in callgrind.rs against the baseline in instructions.txt, in percent.
#
#   benches/instructions.sh                 count and compare
#   benches/instructions.sh --save          count, compare, and make the counts the new baseline
#   benches/instructions.sh --at-most P     exit status 1 when a count rose by more than P percent
#   benches/instructions.sh --counts FILE   compare the counts of a file (lines NAME COUNT) instead of counting
set -euo pipefail
cd "$(dirname "$0")/.."
baseline=benches/instructions.txt
save=no at_most=inf counts=
while [ $# -gt 0 ]; do
    case $1 in
        --save) save=yes ;;
        --at-most) at_most=$2; shift ;;
        --counts) counts=$2; shift ;;
        *) sed -n '2,7s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
    esac
    shift
done
now=$(mktemp)
trap 'rm -f "$now"' EXIT
if [ -n "$counts" ]; then
    cp "$counts" "$now"
else
    folder=${CARGO_TARGET_DIR:-target}/iai
    rm -rf "$folder"
    cargo bench --features callgrind --bench callgrind >&2
    # Valgrind writes a file for each thread of each bench, whose line `totals:` has the sum; the folder has the name of the bench.
    find "$folder" -name 'callgrind.*.out' -exec awk '
        $1 == "totals:" { parts = split(FILENAME, path, "/"); count[path[parts - 1]] += $2 }
        END { for (name in count) { print name, count[name] } }
    ' {} + | LC_ALL=C sort > "$now"
fi
status=0
awk -v at_most="$at_most" '
    FILENAME == ARGV[1] { if ($1 != "#" && NF) { before[$1] = $2 } next }
    !($1 in before) { printf "%-32s %14d   new\n", $1, $2; next }
    {
        change = ($2 - before[$1]) * 100 / before[$1]
        printf "%-32s %14d %+9.2f %%\n", $1, $2, change
        if (at_most != "inf" && change > at_most + 0) { risen = 1 }
        delete before[$1]
    }
    END {
        for (name in before) { printf "%-32s %14s   gone\n", name, "" | "sort" }
        close("sort")
        exit risen
    }
' "$baseline" "$now" || status=$?
if [ "$save" = yes ]; then
    {
        echo "# Instructions under valgrind, release profile; hundred_scans: of 100 scans. Renewed by benches/instructions.sh --save."
        echo "# Of commit $(git rev-parse --short HEAD), $(rustc --version), $(valgrind --version)."
        cat "$now"
    } > "$baseline"
fi
exit "$status"
