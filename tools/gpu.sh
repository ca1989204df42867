#!/usr/bin/env bash
# Everything at full width on one GPU in one call: the bank, the trainings and scores of the results
# table, and the rates of inference and training.
#
#   tools/gpu.sh FOLDER [TABLE.yaml]
#
# FOLDER gets the trained networks and their logs, and in FOLDER/page the page, the numbers and the
# figure. What stands there already is taken as it is, so that the same call goes on after a stop.
set -euo pipefail
folder=${1:?folder of the results}
table=${2:-configs/unwrap/table-gpu.yaml}
groups=(tofregnet tofsegnet "su_net phasenet agresti_net chen_net toffusionnet")

run() { python3 -m agents.cli "$@"; }
export SHOTENV_MITSUBA_VARIANT=${SHOTENV_MITSUBA_VARIANT:-cuda_ad_mono}
mkdir -p "$folder"
run render --config configs/bank/nearfield.yaml

# Three trainings at a time: a single one leaves the GPU waiting for the processor.
pids=()
for group in "${groups[@]}"; do
    # shellcheck disable=SC2086  # a group is several words
    run unwrap table --config "$table" --out "$folder" --only $group >"$folder/${group%% *}.log" 2>&1 &
    pids+=($!)
done
trap 'kill "${pids[@]}" 2>/dev/null' EXIT
for pid in "${pids[@]}"; do wait "$pid"; done
trap - EXIT

run unwrap table --config "$table" --out "$folder" --page "$folder/page"
python3 -m benchmarks networks --json "$folder/page/rates.json"
