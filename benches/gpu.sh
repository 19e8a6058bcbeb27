#!/usr/bin/env bash
# What a GPU gives: whether it computes what the processor does, milliseconds of an inference, images a second of training in single and in mixed
# precision, and memory, for the presets light, resnet50 and paper at 640x192, beside PyTorch eager, with autocast (bf16) and compiled where Python
# has torch. One table, as Markdown on stdout.
#
#   cargo build --release --features cuda            # or vulkan, wgpu, metal
#   benches/gpu.sh target/release/deepfusion cuda OUT
#
# DEVICE is as for --device (cuda:1 is the second one). OUT is a new folder for runs and raw figures. STEPS=60, REPEATS=50, BATCH=4, SIZE=640x192,
# PRESETS="light resnet50 paper" and PEERS="eager autocast compile" can be set.
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

presets=${PRESETS:-light resnet50 paper}
peers=${PEERS-eager autocast compile}
for preset in $presets; do
    "$program" bench --preset "$preset" --size "$size" --engine burn --device "$device" --repeats "$repeats" --json \
        >"$out/bench-$preset.json" 2>"$out/bench-$preset.log" || true
    # bf16 is refused by a device without it.
    for precision in f32 bf16; do
        "$program" train --data "$out/drive" --preset "$preset" --size "$size" --batch "$batch" --set accumulate=1 --set view_motion=distance \
            --set precision="$precision" --init none --steps "$steps" --device "$device" --out "$out/$preset-$precision" \
            >"$out/train-$preset-$precision.log" 2>&1 || true
    done
done

# PyTorch knows CUDA and Metal. A card that is used by Vulkan may be one that it knows as CUDA's.
case $device in
cuda* | cpu) torch_device=$device ;;
metal*) torch_device=${device/metal/mps} ;;
*) torch_device=cuda ;;
esac
if "$python" -c "import torch, torchvision; torch.zeros(1, device='${torch_device%%:*}')" 2>/dev/null; then
    for peer in $peers; do
        for preset in $presets; do
            case $preset in
            light) run=(torch_light_step.py --depth 18) ;;
            resnet50) run=(torch_light_step.py --depth 50) ;;
            paper) run=(torch_paper_step.py --accumulate 1 --steps 10) ;;
            *) continue ;;
            esac
            [ "$peer" = eager ] || run+=("--$peer")
            "$python" "$here/peers/${run[0]}" "${run[@]:1}" --device "$torch_device" --size "$size" --batch "$batch" --json \
                >"$out/torch-$preset-$peer.json" 2>"$out/torch-$preset-$peer.log" || true
        done
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


def images_per_second(run):
    """The median of what follows step 40, or what the last step says: each row is a mean of twenty steps, the first of which compile kernels."""
    try:
        rows = list(csv.DictReader((out / run / "log.csv").open()))
    except OSError:
        return None
    rows = [(int(row["step"]), float(row["images_per_second"])) for row in rows if row["split"] == "train"]
    rates = [rate for step, rate in rows if step > 40] or [rate for _, rate in rows[-1:]]
    return statistics.median(rates) if rates else None


def memory(run):
    for line in (out / f"train-{run}.log").read_text().splitlines():
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
print("| preset | inference, ms | MB | training, images/s: f32 | bf16 | MB, f32 | PyTorch eager | autocast | compiled |")
print("|---|---|---|---|---|---|---|---|---|")
for preset in presets:
    bench = read(f"bench-{preset}.json")
    peers = [read(f"torch-{preset}-{peer}.json").get("images_per_second") for peer in ("eager", "autocast", "compile")]
    cells = [
        number(bench.get("stages_ms", {}).get("network"), 2), number(bench.get("peak_device_mb"), 0),
        *(number(images_per_second(f"{preset}-{precision}")) for precision in ("f32", "bf16")),
        number(memory(f"{preset}-f32"), 0), *map(number, peers),
    ]
    print(f"| {preset} | {' | '.join(cells)} |")
PYTHON
