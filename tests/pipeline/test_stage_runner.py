"""The next stage's process loads its code while the stage before it is at work."""

import signal
from pathlib import Path

from gsac.pipeline.child import LogReader

NOTES = """
import os

with open(os.environ["TOY_RUNS"] + ".loaded", "a") as log:
    log.write("loaded\\n")
"""


def loaded(toy) -> int:
    """How many processes have loaded the code that notes it."""
    file = Path(f"{toy.runs_file}.loaded")
    return len(file.read_text().split()) if file.exists() else 0


def test_the_next_stages_code_is_loaded_while_the_stage_before_is_at_work(toy):
    toy.edit("left/stage.py", "from gsac.toy", NOTES + "from gsac.toy")
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=3")
    toy.wait_for(lambda: loaded(toy) and toy.runs)
    assert toy.runs == ["cut"] and not (toy.out / "cut" / "words").exists()
    assert process.wait(60) == 0
    assert loaded(toy) == 1
    assert (toy.out / "logs" / "left.log").read_text() == "left at work\n"
    assert not list((toy.out / "logs").glob("*.next"))


def test_code_that_was_edited_after_it_was_loaded_is_loaded_anew(toy):
    toy.edit("left/stage.py", "from gsac.toy", NOTES + "from gsac.toy")
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=3")
    toy.wait_for(lambda: loaded(toy))
    toy.edit("left/stage.py", "spell(word)", "spell(word)[::-1]")
    assert process.wait(60) == 0
    assert loaded(toy) == 2
    assert (toy.out / "left" / "out.txt").read_text() == "AHPLA"
    assert toy.ran() == ["cut"], "cut.pause_s is another parameter, and left has its result"


def test_a_stage_whose_result_is_there_leaves_no_process_and_keeps_its_log(toy):
    assert toy.run().code == 0
    (toy.out / "logs" / "left.log").write_text("of the run that made it")
    assert toy.ran("--set", "cut.pause_s=0.1") == ["cut"]
    assert (toy.out / "logs" / "left.log").read_text() == "of the run that made it"
    assert not list((toy.out / "logs").glob("*.next"))


def test_a_stage_may_warm_up_for_its_device_before_its_order_and_one_that_cannot_runs_all_the_same(toy):
    warm = """
def warm(device):
    with open(os.environ["TOY_RUNS"] + ".loaded", "a") as log:
        log.write(device + "\\n")
    raise RuntimeError("too cold")
"""
    toy.edit("left/stage.py", "from gsac.toy", "import os\n" + warm + "\n\nfrom gsac.toy")
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=3", GSAC_DEVICE="cpu")
    toy.wait_for(lambda: loaded(toy) and toy.runs)
    assert toy.runs == ["cut"] and Path(f"{toy.runs_file}.loaded").read_text() == "cpu\n"
    assert process.wait(60) == 0 and toy.runs == ["cut", "left", "right", "join"]


def test_what_a_process_left_among_temporary_files_goes_with_it(toy):
    warm = """
def warm(device):
    import os, tempfile, time
    with open(os.environ["TOY_RUNS"] + ".loaded", "a") as log:
        log.write(tempfile.mkdtemp() + "\\n")
    time.sleep(60)
"""
    toy.edit("left/stage.py", "from gsac.toy", warm + "\n\nfrom gsac.toy")
    assert toy.run("--until", "cut", "--set", "cut.pause_s=3").code == 0
    assert loaded(toy) == 0, "nothing is prepared that does not run"
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=4")
    toy.wait_for(lambda: loaded(toy))
    folder = Path(Path(f"{toy.runs_file}.loaded").read_text().split()[0])
    assert folder.is_dir()
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 130 and not folder.exists()


def test_the_stage_after_the_next_is_loaded_as_well_and_each_runs_in_its_own_process(toy):
    for name in ("left", "right"):
        toy.edit(f"{name}/stage.py", "from gsac.toy", NOTES + "from gsac.toy")
    process = toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=3")
    toy.wait_for(lambda: loaded(toy) == 2 and toy.runs)
    assert toy.runs == ["cut"]
    assert process.wait(60) == 0 and toy.runs == ["cut", "left", "right", "join"]
    assert loaded(toy) == 2
    assert [(toy.out / "logs" / f"{name}.log").read_text() for name in ("left", "right")] == ["left at work\n", "right at work\n"]


def test_libraries_in_a_stages_process_have_one_thread_unless_the_user_says_otherwise(toy):
    toy.edit("left/stage.py", "from gsac.toy", "import os\n\nprint(os.environ['OPENCV_FOR_THREADS_NUM'])\nfrom gsac.toy")
    assert toy.run().code == 0
    assert (toy.out / "logs" / "left.log").read_text().startswith("1\n")
    assert toy.run("--force", "left", OPENCV_FOR_THREADS_NUM="2").code == 0
    assert (toy.out / "logs" / "left.log").read_text().startswith("2\n")


def test_a_growing_log_is_read_line_by_line_and_each_line_once(tmp_path):
    log = tmp_path / "cut.log"
    reader = LogReader(log)
    assert reader.new_lines() == [], "the file is not there yet"
    log.write_text("first\nsec")
    assert reader.new_lines() == ["first"]
    log.write_text("first\nsecond\nno end")
    assert reader.new_lines() == ["second"]
    assert reader.new_lines(ended=True) == ["no end"] and reader.new_lines(ended=True) == []
