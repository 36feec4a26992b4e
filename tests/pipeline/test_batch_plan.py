"""gsac batch plans in one process: what is unchanged costs none, what was stopped goes on, what failed is known."""

import json
import shutil
import signal

import pytest

pytestmark = pytest.mark.slow


@pytest.fixture
def clips(toy):
    folder = toy.root / "clips"
    folder.mkdir()
    for name, text in (("one", "alpha beta"), ("two", "gamma delta"), ("three", "epsilon zeta")):
        (folder / f"{name}.mp4").write_text(text)
    return folder


@pytest.fixture
def out(toy):
    return toy.root / "avatars"


def statuses(done):
    return {row["clip"].rsplit("/", 1)[1].removesuffix(".mp4"): row["status"] for row in done.json["clips"]}


def ended(out):
    """What batch.json says of clips that have ended."""
    clips = json.loads((out / "batch.json").read_text())["clips"] if (out / "batch.json").exists() else []
    return [clip["status"] for clip in clips if clip["status"] != "planned"]


def test_unchanged_clips_get_no_process_and_their_folders_are_mended(toy, clips, out):
    toy.gsac("batch", clips, "--out", out)
    (out / "one-avatar" / "join" / "out.txt").unlink()
    (clips / "two.mp4").write_text("other words")
    again = toy.gsac("batch", clips, "--out", out, "--replace", "--json")
    assert statuses(again) == {"one": "unchanged", "two": "done", "three": "unchanged"}
    assert "3 clips, 2 unchanged, 1 to do" in again.err
    assert (out / "one-avatar" / "join" / "out.txt").read_text() == "ALPHA ALPHA"
    counters = (out / "batch.prom").read_text()
    assert 'gsac_batch_clips{status="unchanged"} 2\n' in counters and 'gsac_batch_clips{status="done"} 1\n' in counters
    rows = {row["clip"]: row for row in again.json["clips"]}
    assert [stage["status"] for stage in rows[str(clips / "one.mp4")]["stages"]] == ["cached"] * 4


def test_a_dry_run_says_what_each_clip_needs_and_runs_nothing(toy, clips, out):
    toy.gsac("run", clips / "one.mp4", "--out", out / "one-avatar")
    ran = len(toy.runs)
    plan = toy.gsac("batch", clips, "--out", out, "--dry-run", "--set", "join.keep=5", "--json")
    due = {row["clip"].rsplit("/", 1)[1]: row["due"] for row in plan.json["clips"]}
    assert due == {"one.mp4": ["join"], "two.mp4": ["cut", "left", "right", "join"], "three.mp4": ["cut", "left", "right", "join"]}
    assert len(toy.runs) == ran and not (out / "batch.json").exists()


def test_a_dry_run_tells_which_clips_the_run_would_refuse(toy, clips, out):
    toy.gsac("run", toy.clip, "--out", out / "one-avatar")
    (out / "two-avatar").mkdir()
    (out / "two-avatar" / "report.html").write_text("mine")
    plan, replaced, done = (toy.gsac("batch", clips, "--out", out, *words) for words in (
        ["--dry-run"], ["--dry-run", "--replace"], ["--json"]))
    assert f"one.mp4: {out / 'one-avatar'} holds the avatar of {toy.clip}; give another --out" in plan.err
    assert f"two.mp4: {out / 'two-avatar'} is not the folder of a run and holds report.html" in plan.err
    assert "three.mp4: cut to join" in plan.err and "3 clips, 2 cannot run, 1 to do" in plan.err
    assert "one.mp4: cut to join" in replaced.err and "holds report.html" in replaced.err
    assert plan.code == replaced.code == done.code == 1
    assert statuses(done) == {"one": "failed", "two": "failed", "three": "done"}
    assert all(row["error"] in plan.err for row in done.json["clips"] if row["status"] == "failed")


def test_a_dry_run_ends_well_only_where_the_batch_could(toy, clips, out):
    assert toy.gsac("batch", clips, "--out", out, "--dry-run").code == 0 and not out.exists()
    (clips / "bad.mp4").write_text("")
    assert toy.gsac("batch", clips, "--out", out).code == 1
    left, resumed = (toy.gsac("batch", "--resume", "--out", out, *words) for words in (["--dry-run"], []))
    assert left.code == resumed.code == 1 and "bad.mp4: stage left failed" in left.err
    (out / "batch.html").write_text("mine")
    codes = [toy.gsac("batch", clips, "--out", out, *words).code for words in (["--dry-run"], [])]
    assert codes == [2, 2]


def test_a_killed_batch_goes_on_with_its_own_words_and_leaves_what_has_ended(toy, clips, out):
    process = toy.start("batch", clips, "--out", out, "-j", "1", "--set", "join.pause_s=3", "--until", "join")
    toy.wait_for(lambda: ended(out) == ["done"] and toy.runs.count("cut") == 2)
    process.kill()
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL
    (clips / "one.mp4").write_text("not to be looked at again")
    done = toy.gsac("batch", "--resume", "--out", out, "--json")
    assert statuses(done) == {"one": "done", "three": "done", "two": "done"} and "1 left as they are" in done.err
    assert toy.runs.count("join") == 3 or toy.runs.count("join") == 4, "the clip that was stopped runs its last stage again at most"


def test_resume_without_a_batch_and_resume_with_clips_are_refused(toy, clips, out):
    nothing = toy.gsac("batch", "--resume", "--out", out)
    assert nothing.code == 2 and "--resume goes on with a batch that was begun in this folder" in nothing.err
    both = toy.gsac("batch", clips, "--resume", "--out", out)
    assert both.code == 2 and "leave" in both.err
    neither = toy.gsac("batch", "--out", out)
    assert neither.code == 2 and "no FOLDER or LIST" in neither.err


@pytest.mark.parametrize(("words", "option"), [
    (("--set", "join.keep=5"), "--set"), (("--quality", "draft"), "--quality"), (("--until", "cut"), "--until"),
    (("--from", "join"), "--from"), (("--force", "cut"), "--force"), (("--anyway",), "--anyway"), (("--replace",), "--replace"),
    (("--height", "1.7"), "--height"), (("--body", "mine"), "--body"), (("--params", "params.yaml"), "--params")])
def test_resume_refuses_what_it_would_take_from_the_batch_and_names_it(inside, toy, out, words, option):
    refused = inside(toy, "batch", "--resume", "--out", out, *words)
    assert refused.code == 2 and f"--resume takes {option} from" in refused.err and f"leave {option} out" in refused.err


def test_changed_only_leaves_clips_whose_file_is_the_same_though_parameters_are_others(toy, clips, out):
    toy.gsac("batch", clips, "--out", out)
    (clips / "two.mp4").write_text("other words")
    ran = toy.runs.count("join")
    done = toy.gsac("batch", clips, "--out", out, "--changed-only", "--replace", "--set", "join.keep=5", "--json")
    assert statuses(done) == {"one": "kept", "two": "done", "three": "kept"} and toy.runs.count("join") == ran + 1
    whole = toy.gsac("batch", clips, "--out", out, "--set", "join.keep=5", "--json")
    assert statuses(whole) == {"one": "done", "two": "unchanged", "three": "done"}


def test_changed_only_does_not_leave_a_clip_that_ended_earlier_than_asked_for_or_whose_results_are_gone(toy, clips, out):
    toy.gsac("batch", clips, "--out", out, "--until", "left")
    assert set(statuses(toy.gsac("batch", clips, "--out", out, "--changed-only", "--json")).values()) == {"done"}
    shutil.rmtree(out / "one-avatar")
    again = statuses(toy.gsac("batch", clips, "--out", out, "--changed-only", "--json"))
    assert again == {"one": "unchanged", "two": "kept", "three": "kept"} and (out / "one-avatar" / "join" / "out.txt").exists()


def test_force_and_from_reach_every_clip(toy, clips, out):
    toy.gsac("batch", clips, "--out", out)
    ran = toy.runs.count("left")
    assert statuses(toy.gsac("batch", clips, "--out", out, "--force", "left", "--json")) == dict.fromkeys(
        ("one", "two", "three"), "done")
    assert toy.runs.count("left") == ran + 3
    dry, late = (toy.gsac("batch", clips, "--out", out, "--from", "join", "--set", "left.word=last", "--json", *more)
                 for more in (["--dry-run"], []))
    assert dry.code == late.code == 1 and "stage left is not up to date" in late.err and "3 cannot run" in dry.err
    assert [row["error"] for row in dry.json["clips"]] == [row["error"] for row in late.json["clips"]]


def test_a_clip_that_kills_its_stage_is_tried_once_more_alone_and_then_set_aside(toy, clips, out):
    done = toy.gsac("batch", clips, "--out", out, "-j", "2", "--set", "left.trouble=killed", "--json")
    assert done.code == 1 and set(statuses(done).values()) == {"failed"}
    record = json.loads((out / "batch.json").read_text())
    assert [clip["killed"] for clip in record["clips"]] == [2, 2, 2] and toy.runs.count("left") == 6
    assert all("not tried again" in row["error"] for row in done.json["clips"])


def test_clips_together_take_no_more_memory_than_may_be_filled(toy, clips, out, everything):
    assert toy.gsac("batch", clips, "--out", out, "-j", "3", "--memory", "0.001", "--set", "cut.pause_s=0.5").code == 0
    assert toy.runs == everything * 3, "clips that together would take more run one after another"


def test_files_of_others_by_the_names_of_its_own_are_never_written_over(toy, clips, out):
    out.mkdir()
    (out / "batch.json").write_text('{"mine": 1}')
    done = toy.gsac("batch", clips, "--out", out)
    assert done.code == 2 and "was not written by this version" in done.err and (out / "batch.json").read_text() == '{"mine": 1}'
    (out / "batch.json").unlink()
    (out / "batch.prom").write_text("mine")
    done = toy.gsac("batch", clips, "--out", out)
    assert done.code == 2 and "batch.prom was not written by" in done.err and (out / "batch.prom").read_text() == "mine"
    assert toy.runs == []
