#!/usr/bin/env bash
# Everything that makes `street`, the embedded network, from nothing: three stages of training on simulated views, the calibration
# of its intervals on simulated drives, and the two files that the crate deepfusion-weights embeds.
#
#   recipes/street.sh [FOLDER]        default: runs/street; DEEPFUSION names another binary
#
# About three hours on two cores. Stopped, the same command goes on where it was.
set -euo pipefail
recipes=$(cd "$(dirname "$0")" && pwd)
out=${1:-runs/street}
deepfusion=${DEEPFUSION:-deepfusion}
mkdir -p "$out"

# train NAME [--init FILE]: one stage, begun, gone on with, or left as it is.
train() {
    local name=$1 run="$out/$1"
    shift
    if [ -e "$run.done" ]; then return; fi
    if [ -e "$run/last.safetensors" ]; then
        "$deepfusion" train --out "$run" --resume
    else
        rm -rf "$run"
        "$deepfusion" train --config "$recipes/$name.toml" --out "$run" "$@"
    fi
    touch "$run.done"
}

train street
train street-more --init "$out/street/last.safetensors"
train street-uncertainty --init "$out/street-more/last.safetensors"

# Drives that no stage has seen; a drive that is half-written is made again.
scenes=(urban commercial park garage night urban)
drives=()
for i in "${!scenes[@]}"; do
    drive="$out/drives/$((301 + i))"
    if [ ! -e "$drive.done" ]; then
        rm -rf "$drive"
        "$deepfusion" simulate --out "$drive" --frames 24 --seed $((301 + i)) --scene "${scenes[$i]}" --moving-cars 4 --scan-every 4
        touch "$drive.done"
    fi
    drives+=("$drive")
done
"$deepfusion" eval --model "$out/street-uncertainty/last.safetensors" --data "${drives[@]}" --crop none --calibrate-uncertainty

"$deepfusion" weights pack --model "$out/street-uncertainty" --checkpoint last --name street --simulated-only --out "$out/packed" \
    --recipe "recipes/street.sh" \
    --note "depth on simulated views: 5,200 steps at 320x96, 4,800 at three sizes; then 60 of the head for uncertainty alone"
