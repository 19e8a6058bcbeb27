#!/usr/bin/env bash
# Everything that makes `street`, the larger embedded network, from nothing: six stages of training on simulated views, the calibration
# of its intervals on simulated drives, and the two files that the crate deepfusion-weights embeds; then the same of `tiny`.
#
#   recipes/street.sh [FOLDER]        default: runs/street; DEEPFUSION names another binary
#
# About four hours on two cores. Stopped, the same command goes on where it was. From the third stage on it learns in bf16; on a
# processor that has none (`train` then says so), PRECISION=f32 takes about twice as long.
#
# Stages, steps and learning rates are those of the embedded network; two things were changed while it learned, so that the bits differ:
# docs/reference/shipped-weights.md ("How far the recipe repeats it"). The whole chain has been run from end to end at two steps a stage
# only.
set -euo pipefail
recipes=$(cd "$(dirname "$0")" && pwd)
out=${1:-runs/street}
deepfusion=${DEEPFUSION:-deepfusion}
precision=${PRECISION:-bf16}
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

train street --init none
train street-more --init "$out/street/last.safetensors"
train street-again --init "$out/street-more/last.safetensors" --set "precision=$precision"
train street-large --init "$out/street-again/last.safetensors" --set "precision=$precision"
train street-large-more --init "$out/street-large/last.safetensors" --set "precision=$precision"
train street-uncertainty --init "$out/street-large-more/last.safetensors" --set "precision=$precision"

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
    --note "depth on simulated views: 11,716 steps at 320x96 and two sizes like it, 4,450 at 640x192 and three others; then 60 of the head for uncertainty alone"

train tiny --init none --set "precision=$precision"
"$deepfusion" weights pack --model "$out/tiny" --checkpoint last --name tiny --simulated-only --recipe recipes/tiny.toml --out "$out/packed"
