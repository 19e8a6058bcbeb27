#!/usr/bin/env bash
# Everything that makes `street`, the larger embedded network, from nothing: six stages of training on simulated views, the calibration
# of its intervals on simulated drives, and the two files that the crate deepfusion-weights embeds, with the ranges for int8; then the
# same of `tiny`.
#
#   recipes/street.sh [FOLDER]        default: runs/street
#
#   DEEPFUSION=PROGRAM   another binary
#   PRECISION=f32        for a processor without bf16 (`train` says so): the stages from the third on take about twice as long
#   INT8=none            for a processor without int8 (`weights calibrate` says so): the cards then have no ranges
#   KITTI=FOLDER         KITTI raw with the drives 0005 and 0009 of 2011_09_26: the cards then have figures of four scans of each
#   ROOMS=FOLDER         an RGB-D folder, as 7-Scenes has them: the cards then have its figures, too
#
# About four hours on two cores. Stopped, the same command goes on where it was. Done, it packs the same bytes again.
#
# Stages, steps and learning rates are those of the embedded network; two things were changed while it learned, so that the bits differ:
# docs/reference/shipped-weights.md ("How far the recipe repeats it"). The whole chain has been run from end to end at one and two steps a
# stage only, the former in a test.
set -euo pipefail
recipes=$(cd "$(dirname "$0")" && pwd)
out=${1:-runs/street}
deepfusion=${DEEPFUSION:-deepfusion}
precision=${PRECISION:-bf16}
mkdir -p "$out"

# train NAME [OPTION…]: one stage, begun, gone on with, or left as it is.
train() {
    local name=$1 run="$out/$1"
    shift
    if [ -e "$run.done" ]; then return; fi
    # What was measured of an earlier run of the name.
    rm -f "$run".on-*.done
    if [ -e "$run/last.safetensors" ]; then
        "$deepfusion" train --out "$run" --resume
    else
        rm -rf "$run"
        "$deepfusion" train --config "$recipes/$name.toml" --out "$run" "$@"
    fi
    touch "$run.done"
}

# simulate SEED OPTION…: a drive that no stage has seen. One that is half-written is made again.
simulate() {
    local drive="$out/drives/$1" seed=$1
    shift
    if [ -e "$drive.done" ]; then return; fi
    rm -rf "$drive"
    "$deepfusion" simulate --out "$drive" --seed "$seed" "$@"
    touch "$drive.done"
}

# measure RUN ON OPTION…: its run keeps the result, for the card.
measure() {
    local run="$out/$1" on=$2
    shift 2
    if [ -e "$run.on-$on.done" ]; then return; fi
    "$deepfusion" eval --model "$run/last.safetensors" --no-verdict "$@"
    touch "$run.on-$on.done"
}

# on_kitti RUN DRIVE FRAME…: on the scans of four frames.
on_kitti() {
    local run=$1 drive=2011_09_26/2011_09_26_drive_${2}_sync split="$out/kitti-$2.txt"
    local on="kitti-$2"
    shift 2
    printf '%s l\n' "${@/#/$drive }" >"$split"
    measure "$run" "$on" --data "$KITTI/$drive" --split "$split" --gt-depth z --crop garg --cap 80
}

# figures RUN: all but those of the drives that intervals are calibrated on.
figures() {
    measure "$1" streets --data "${streets[@]}" --crop none
    if [ -n "${KITTI:-}" ]; then
        on_kitti "$1" 0005 20 60 100 140
        on_kitti "$1" 0009 0 16 32 48
    fi
    if [ -n "${ROOMS:-}" ]; then
        measure "$1" rooms --data "$ROOMS"
    fi
}

# pack RUN NAME OPTION…: the two files. The ranges are found on the packed weights, and kept in their card.
pack() {
    local run="$out/$1" name=$2
    shift 2
    "$deepfusion" weights pack --model "$run" --checkpoint last --name "$name" --simulated-only --out "$out/packed" --overwrite "$@"
    if [ "${INT8:-}" != none ]; then
        "$deepfusion" weights calibrate --model "$out/packed/$name.safetensors" "${for_int8[@]}" --images 48
    fi
}

train street --init none
train street-more --init "$out/street/last.safetensors"
train street-again --init "$out/street-more/last.safetensors" --set "precision=$precision"
train street-large --init "$out/street-again/last.safetensors" --set "precision=$precision"
train street-large-more --init "$out/street-large/last.safetensors" --set "precision=$precision"
train street-uncertainty --init "$out/street-large-more/last.safetensors" --set "precision=$precision"
train tiny --init none --set "precision=$precision"

# To calibrate intervals on, to measure on, and for the ranges of int8.
scenes=(urban commercial park garage night urban)
drives=()
for i in "${!scenes[@]}"; do
    simulate $((301 + i)) --frames 24 --scene "${scenes[$i]}" --moving-cars 4 --scan-every 4
    drives+=("$out/drives/$((301 + i))")
done
streets=()
for seed in 41 42 43; do
    simulate "$seed" --frames 60 --moving-cars 6 --scan-every 5
    streets+=("$out/drives/$seed")
done
scenes=(urban urban park garage commercial night)
for_int8=()
for i in "${!scenes[@]}"; do
    simulate $((701 + i)) --frames 16 --scene "${scenes[$i]}" --moving-cars 3
    for_int8+=("$out/drives/$((701 + i))")
done

measure street-uncertainty intervals --data "${drives[@]}" --crop none --calibrate-uncertainty
figures street-uncertainty
figures tiny

pack street-uncertainty street --recipe recipes/street.sh \
    --note "depth on simulated views: 11,716 steps at 320x96 and two sizes like it, 4,450 at 640x192 and three others; then 60 of the head for uncertainty alone"
pack tiny tiny --recipe recipes/tiny.toml --note "depth on simulated views: 2,000 steps of eight at 320x96 and two sizes like it"
