#!/usr/bin/env bash
# What a GPU gives: whether it computes what the processor does, milliseconds of an inference, images a second of training, and memory, for the presets
# light, resnet50 and paper at 640x192, beside PyTorch eager and compiled where Python has torch. One table, as Markdown on stdout.
#
#   cargo build --release --features cuda            # or vulkan, wgpu, metal
#   benches/gpu.sh target/release/deepfusion cuda OUT
#
# DEVICE is as for --device (cuda:1 is the second one). OUT is a new folder for runs and raw figures. STEPS=60, REPEATS=50, BATCH=4 and SIZE=640x192 can be set.
# PYTHON names the interpreter with torch and torchvision [default: python3].
set -euo pipefail

usage() {
    sed -n '2,/^set/p' "$0" | sed '$d; s/^# \{0,1\}//' >&2
    exit 2
}
[ $# -eq 3 ] || usage
program=$(realpath "$1")
device=$2
out=$3
steps=${STEPS:-60}
repeats=${REPEATS:-50}
batch=${BATCH:-4}
size=${SIZE:-640x192}
python=${PYTHON:-python3}
here=$(cd "$(dirname "$0")" && pwd)
mkdir "$out"
out=$(cd "$out" && pwd)

# Before any figure: is it right? What differs is written down and does not end the script.
"$program" doctor --device "$device" --json >"$out/doctor.json" || true
# Enough frames for all steps: between epochs a run validates and saves.
"$program" simulate --out "$out/drive" --frames $((steps * batch * 6 / 5 + 40)) --seed 5 --size "$size" --scan-every 0 >"$out/simulate.log" 2>&1

presets="light resnet50 paper"
for preset in $presets; do
    "$program" bench --preset "$preset" --size "$size" --engine burn --device "$device" --repeats "$repeats" --json \
        >"$out/bench-$preset.json" 2>"$out/bench-$preset.log" || true
    "$program" train --data "$out/drive" --preset "$preset" --size "$size" --batch "$batch" --set accumulate=1 --set view_motion=distance --init none --steps "$steps" \
        --device "$device" --out "$out/$preset" >"$out/train-$preset.log" 2>&1 || true
done

# PyTorch knows CUDA and Metal, and no Vulkan.
torch_device=${device/metal/mps}
if "$python" -c "import torch, torchvision; torch.zeros(1, device='${torch_device%%:*}')" 2>/dev/null; then
    for compiled in "" --compile; do
        word=${compiled:+compiled}
        word=${word:-eager}
        for depth in 18 50; do
            preset=light
            [ "$depth" = 18 ] || preset=resnet50
            "$python" "$here/peers/torch_light_step.py" --depth "$depth" --device "$torch_device" --size "$size" --batch "$batch" $compiled --json \
                >"$out/torch-$preset-$word.json" 2>"$out/torch-$preset-$word.log" || true
        done
        "$python" "$here/peers/torch_paper_step.py" --device "$torch_device" --size "$size" --batch "$batch" --accumulate 1 --steps 10 $compiled --json \
            >"$out/torch-paper-$word.json" 2>"$out/torch-paper-$word.log" || true
    done
fi

"$python" - "$out" "$device" "$size" "$batch" "$presets" <<'PYTHON'
import csv
import json
import statistics
import sys
from pathlib import Path

out, device, size, batch, presets = Path(sys.argv[1]), *sys.argv[2:5], sys.argv[5].split()


def read(name):
    try:
        return json.loads((out / name).read_text())
    except (OSError, ValueError):
        return {}


def number(value, digits=1):
    return "–" if value is None else f"{value:.{digits}f}"


def images_per_second(preset):
    """The median of the second half of a run: what is compiled and tuned at its start is over by then."""
    try:
        rows = list(csv.DictReader((out / preset / "log.csv").open()))
    except OSError:
        return None
    rates = [float(row["images_per_second"]) for row in rows if row["split"] == "train"]
    rates = rates[len(rates) // 2:]
    return statistics.median(rates) if rates else None


def memory(preset):
    for line in (out / f"train-{preset}.log").read_text().splitlines():
        if line.startswith("memory of the device: "):
            return float(line.split()[4])
    return None


doctor = read("doctor.json")
wrong = [row["operation"] for row in doctor.get("operations", []) if not row["right"]]
print(f"`{device}`, {size}, {batch} samples a step.", end=" ")
if not doctor:
    print("`doctor --device` did not finish.\n")
elif wrong:
    print(f"Not what the processor computes: {', '.join(wrong)}.\n")
else:
    print("Every operation is what the processor computes.\n")
print("| preset | inference, ms | MB | training, images/s | MB | PyTorch eager, images/s | compiled, images/s |")
print("|---|---|---|---|---|---|---|")
for preset in presets:
    bench = read(f"bench-{preset}.json")
    torch = [read(f"torch-{preset}-{word}.json").get("images_per_second") for word in ("eager", "compiled")]
    cells = [
        number(bench.get("stages_ms", {}).get("network"), 2), number(bench.get("peak_device_mb"), 0),
        number(images_per_second(preset)), number(memory(preset), 0), *map(number, torch),
    ]
    print(f"| {preset} | {' | '.join(cells)} |")
PYTHON
