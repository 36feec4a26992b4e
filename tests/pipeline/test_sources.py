"""A clip that is written, or replaced and put back, while it is read: never another clip's frames under its key."""

import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

READ = '''
def wait(name):
    import time
    file = Path(os.environ["TOY_RUNS"] + name)
    while not file.exists():
        time.sleep(0.01)


def run(job):
    begin(job, "cut")
    wait(".opened")
    words = job.inputs["clip"].read_text().split()
    Path(os.environ["TOY_RUNS"] + ".read").touch()
    wait(".closed")
    if not words:
        raise BadInput("no word decodes")
    if len(words) == 1:
        job.warn(Finding.of(Code.OTHER, what="the clip is truncated"))
    (job.out / "words").mkdir()
    for i, word in enumerate(words):
        (job.out / "words" / f"{i:06d}.txt").write_text(word)
'''


@pytest.fixture
def slow(toy):
    """The toy project whose first stage tells when it reads."""
    toy.write("cut/stage.py", "import os\nfrom pathlib import Path\n\nfrom gsac.stages.contract import BadInput\n"
                              "from gsac.stages.findings import Code, Finding\n"
                              "from gsac.toy.common import begin\n" + READ)
    return toy


def read_while(toy, change: Callable[[], object], undo: Callable[[], object], *arguments: str) -> subprocess.CompletedProcess:
    """A run whose first stage reads the clip between a change and its undoing."""
    process = toy.start("run", toy.clip, "--out", toy.out, *arguments)
    toy.wait_for(lambda: "cut" in toy.runs)
    change()
    Path(f"{toy.runs_file}.opened").touch()
    toy.wait_for(Path(f"{toy.runs_file}.read").exists)
    undo()
    Path(f"{toy.runs_file}.closed").touch()
    out, err = process.communicate(timeout=60)
    return subprocess.CompletedProcess([], process.returncode, out, err)


def swap(toy) -> None:
    """Puts the other clip in the clip's place, and the clip in its."""
    other, away = toy.root / "other.mp4", toy.root / "away.mp4"
    if not other.exists():
        other.write_text("delta beta gamma")
    toy.clip.rename(away)
    other.rename(toy.clip)
    away.rename(other)


def test_a_clip_that_gave_way_to_another_and_came_back_is_read_again(slow):
    done = read_while(slow, lambda: swap(slow), lambda: swap(slow))
    assert done.returncode == 0 and slow.runs.count("cut") == 2 and slow.result == "ALPHA ALPHA"
    assert f"cut: {slow.clip} was written or replaced while it was read; it is read again" in done.stderr


@pytest.mark.parametrize("half", ["alpha", ""], ids=["a half of it", "nothing of it"])
def test_a_clip_that_is_copied_over_itself_leaves_neither_a_false_warning_nor_an_error(slow, half):
    text = slow.clip.read_text()
    done = read_while(slow, lambda: slow.clip.write_text(half), lambda: slow.clip.write_text(text), "--until", "cut")
    assert done.returncode == 0 and slow.runs == ["cut", "cut"]
    again = slow.run("--until", "cut")
    assert again.statuses == {"cut": "cached"} and again.json["stages"][0]["warnings"] == []


def test_a_clip_that_changed_for_good_is_refused_whatever_the_stage_made_of_it(slow):
    done = read_while(slow, lambda: slow.clip.write_text(""), lambda: None)
    assert done.returncode == 2 and "changed while it was being read; run again when it is complete" in done.stderr
    assert not list((slow.cache / "actions").glob("cut/*"))


def test_a_clip_that_is_touched_each_time_is_refused_with_a_sentence(toy):
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=0.3")
    while process.poll() is None:
        toy.clip.touch()
        time.sleep(0.01)
    assert process.returncode == 2 and "each of 3 times that it was read" in process.communicate()[1]
    assert toy.runs == ["cut"] * 3 and not list((toy.cache / "actions").glob("cut/*"))


def test_a_brought_model_that_was_swapped_and_put_back_is_read_again(toy):
    toy.edit("right/stage.py", "    model = job",
             "    Path(os.environ['TOY_RUNS'] + '.read').touch()\n    time.sleep(0.5)\n    model = job")
    toy.edit("right/stage.py", "from gsac.toy", "import os\nimport time\nfrom pathlib import Path\n\nfrom gsac.toy")
    (toy.root / "net.bin").write_text(" one")
    assert toy.gsac("models", "add", "net", toy.root / "net.bin").code == 0
    (model,) = (toy.cache / "models").glob("*/net")
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "right.model=net")
    toy.wait_for(Path(f"{toy.runs_file}.read").exists)
    other = toy.root / "other"
    other.write_text(" two")
    for content in (other, toy.root / "net.bin"):
        content.replace(model)
    assert f"right: {model} was written or replaced while it was read" in process.communicate(timeout=60)[1]
    assert process.returncode == 0 and toy.result == "ALPHA ALPHA one" and toy.runs.count("right") == 2


def test_the_stage_command_reads_again_as_well(slow):
    for name in (".opened", ".closed"):
        Path(f"{slow.runs_file}{name}").touch()
    assert slow.run("--until", "cut").code == 0
    for name in (".opened", ".closed", ".read"):
        Path(f"{slow.runs_file}{name}").unlink()
    slow.runs_file.write_text("")
    process = slow.start("stage", "cut", slow.out, "--force")
    slow.wait_for(lambda: "cut" in slow.runs)
    swap(slow)
    Path(f"{slow.runs_file}.opened").touch()
    slow.wait_for(Path(f"{slow.runs_file}.read").exists)
    swap(slow)
    Path(f"{slow.runs_file}.closed").touch()
    assert "it is read again" in process.communicate(timeout=60)[1] and process.returncode == 0
    assert (slow.out / "cut" / "words" / "000000.txt").read_text() == "alpha"
