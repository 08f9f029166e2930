#!/usr/bin/env bash
# Judges the rules, twice where a summary is wanted: what people read, and the same as Markdown for the job's page.
set -uo pipefail

# Patterns become files here, as in a shell; what has spaces in its name cannot be given.
read -r -d '' -a captures <<<"${CAPTURES:-}" || true
read -r -d '' -a rules <<<"${RULES:-}" || true
read -r -d '' -a definitions <<<"${DEFINITIONS:-}" || true
options=(--fail-on "${FAIL_ON:-error}" --quiet)
for one in "${rules[@]}"; do options+=(--rules "$one"); done
for one in "${definitions[@]}"; do options+=(--gvl "$one"); done
results=${RESULTS:-nvscope-results}
mkdir -p "$results"

nvscope check "${captures[@]}" "${options[@]}" --github --force \
  --junit "$results/junit.xml" --sarif "$results/nvscope.sarif" --evidence "$results/evidence"
code=$?
# Mistakes in rules are told already, and there is nothing to sum up.
if [ "$code" -ne 2 ]; then
  nvscope check "${captures[@]}" "${options[@]}" --md >"$results/summary.md" 2>/dev/null
  if [ -n "${GITHUB_STEP_SUMMARY:-}" ]; then cat "$results/summary.md" >>"$GITHUB_STEP_SUMMARY"; fi
fi
exit "$code"
