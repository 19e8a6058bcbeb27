"""The command line that comes with the package."""

import json
import os
import signal
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

import deepfusion
import pytest

SCRIPT = str(Path(sysconfig.get_path("scripts")) / "deepfusion")


def ran(*words, command=(SCRIPT,), **options):
    return subprocess.run([*command, *map(str, words)], capture_output=True, text=True, **options)


@pytest.mark.parametrize("command", [(SCRIPT,), (sys.executable, "-m", "deepfusion")])
def test_both_entry_points_run_the_command(command):
    version = ran("--version", command=command)
    assert version.returncode == 0 and version.stdout == f"deepfusion {deepfusion.__version__}\n"
    wrong = ran("pedict", command=command)
    assert wrong.returncode == 2 and "predict" in wrong.stderr and wrong.stdout == ""
    assert "Usage: deepfusion predict" in ran("predict", "--help", command=command).stdout


def test_the_command_works_and_fails_as_the_program_does(tmp_path):
    out = tmp_path / "street"
    written = ran("simulate", "--out", out, "--frames", 3, "--size", "320x96", "--quiet")
    assert written.returncode == 0, written.stderr
    again = ran("simulate", "--out", out, "--frames", 3)
    assert again.returncode == 1 and "street" in again.stderr
    inspected = ran("data", "inspect", out, "--json", "--quiet")
    assert inspected.returncode == 0 and json.loads(inspected.stdout)
    # A reader that has closed the pipe.
    listed = subprocess.Popen([SCRIPT, "config", "show"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    listed.stdout.close()
    assert listed.wait() == 0 and listed.stderr.read() == b""


@pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")
def test_the_command_handles_ctrl_c(tmp_path):
    simulating = subprocess.Popen(
        [SCRIPT, "simulate", "--out", str(tmp_path / "long"), "--frames", "3000", "--size", "320x96"],
        stderr=subprocess.DEVNULL,
        # Processes that a shell starts in the background ignore Ctrl-C, and the program would inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not (tmp_path / "long").exists():
        time.sleep(0.05)
    simulating.send_signal(signal.SIGINT)
    assert simulating.wait(timeout=20) == 130
    assert not list(tmp_path.iterdir())


program = os.environ.get("DEEPFUSION")


@pytest.mark.skipif(not program, reason="no program given (DEEPFUSION)")
def test_every_help_text_is_the_programs():
    for words in [[], ["predict"], ["train"], ["data"], ["weights", "list"], ["perceive"]]:
        theirs = ran(*words, "--help", command=(program,))
        ours = ran(*words, "--help")
        assert (ours.stdout, ours.stderr, ours.returncode) == (theirs.stdout, theirs.stderr, theirs.returncode)
