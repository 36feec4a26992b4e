"""The command line itself: global options, suggestions for misspelt words, commands of packages above the engine."""

import argparse
import os
import subprocess
from types import SimpleNamespace

import pytest

from gsac.benchmarks import command
from gsac.pipeline import commands
from gsac.pipeline.cli import execute
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.versions import package_version


def test_version_prints_the_installed_version(toy):
    done = toy.gsac("--version")
    assert done.code == 0 and done.out == f"gsac {package_version('gsac')}\n"


@pytest.mark.parametrize("closed", ["0<&-", "1>&-", "2>&-", "0<&- 1>&- 2>&-"])
def test_a_closed_standard_stream_takes_nothing_from_a_run(toy, closed):
    done = subprocess.run(["sh", "-c", f'exec "$@" {closed}', "sh", *toy.command("run", toy.clip, "--out", toy.out)],
                          cwd=toy.root, env=toy.env, text=True, capture_output=True, timeout=60)
    assert done.returncode == 0 and toy.result == "ALPHA ALPHA"
    assert done.stdout == f"{toy.out}\n" if "1" not in closed else done.stdout == ""


def test_a_path_that_is_not_text_is_told_by_its_bytes(toy):
    out = os.fsencode(toy.root) + b"/bad\xff"
    done = subprocess.run(toy.command("run", toy.clip, "--out", os.fsdecode(out), "--until", "cut"), cwd=toy.root,
                          env=toy.env | {"PYTHONIOENCODING": "utf-8:strict"}, capture_output=True, timeout=60)
    assert done.returncode == 0 and done.stdout == out + b"\n"


@pytest.mark.parametrize("argv", [[], ["-q"]])
def test_gsac_alone_prints_its_commands_and_exits_as_a_mistake(capsys, argv):
    assert execute(argv) == ExitCode.USAGE
    said = capsys.readouterr()
    assert "run a clip through the stages" in said.err and said.out == ""


def test_bench_list_tells_what_each_benchmark_measures(capsys):
    assert execute(["bench", "list"]) == ExitCode.OK
    rows = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert rows["size"].startswith("held-out quality against the number of gaussians") and "speed-accuracy" in rows


@pytest.mark.parametrize("order", [("-q", "run"), ("run", "--quiet")])
def test_quiet_tells_only_the_result(toy, order):
    done = toy.gsac(*order, toy.clip, "--out", toy.out, "--set", "left.trouble=warning")
    assert done.code == 0 and done.out == f"{toy.out}\n" and done.err == ""


def test_quiet_still_tells_an_error(toy):
    done = toy.gsac("-q", "run", toy.clip, "--out", toy.out, "--set", "left.trouble=stage")
    assert done.code == 1 and len(done.err.splitlines()) == 1 and done.err.startswith("gsac: stage left failed: left: frame 3")


def test_quiet_keeps_the_lines_that_were_asked_for(toy):
    dry = toy.gsac("-q", "run", toy.clip, "--out", toy.out, "--dry-run")
    assert [line.partition(":")[0] for line in dry.err.splitlines()] == ["cut", "left", "right", "join"]
    toy.ran()
    assert len(toy.gsac("-q", "status", toy.out).out.splitlines()) == 4
    assert toy.gsac("-q", "status", toy.out, "--json").err == ""


@pytest.mark.parametrize("order", [("-v", "run"), ("run", "--verbose")])
def test_verbose_also_tells_what_stages_print(toy, order):
    silent = toy.gsac("run", toy.clip, "--out", toy.out)
    assert "at work" not in silent.err
    done = toy.gsac(*order, toy.clip, "--out", toy.out, "--force", "left", "--set", "right.trouble=bug")
    assert done.code == 1
    lines = done.err.splitlines()
    assert "left: | left at work" in lines and "right: | right at work" in lines
    assert "right: | KeyError: 'surprise'" in lines, "also of a stage that failed"


def test_quiet_and_verbose_exclude_each_other(toy):
    done = toy.gsac("-q", "-v", "status", toy.out)
    assert done.code == 2 and "not allowed with" in done.err


@pytest.mark.parametrize(("arguments", "words"), [
    (["rnu", "clip.mp4"], "unknown command rnu (did you mean run?); known: run, check, demo"),
    (["statsu"], "(did you mean status?)"),
    (["run", "CLIP", "--set", "left.wrod=last"], "--set left.wrod=last: unknown parameter left.wrod (did you mean left.word?)"),
    (["run", "CLIP", "--set", "rihgt.word=last"], "unknown section 'rihgt' (did you mean right?)"),
    (["run", "CLIP", "--until", "jion"], "unknown stage jion (did you mean join?)"),
    (["explain", "ctu", "OUT"], "unknown stage ctu (did you mean cut?)"),
    (["batch", "ROOT", "--executor", "locla"], "--executor locla: unknown (did you mean local?)"),
])
def test_a_misspelt_word_is_answered_with_the_nearest_known_one(toy, arguments, words):
    toy.ran()
    places = {"CLIP": toy.clip, "OUT": toy.out, "ROOT": toy.root}
    done = toy.gsac(*(places.get(word, word) for word in arguments))
    assert done.code == ExitCode.USAGE and words in done.err and "Traceback" not in done.err


@pytest.mark.parametrize(("arguments", "words"), [
    (["run", "--unt", "train", "clip.mp4"], "unknown option --unt (did you mean --until?); `gsac run --help` lists them"),
    (["run", "--qualty", "draft", "clip.mp4"], "unknown option --qualty (did you mean --quality?); `gsac run --help` lists them"),
    (["run", "clip.mp4", "--hieght=1.7"], "unknown option --hieght (did you mean --height?)"),
    (["cache", "gc", "--dry-rnu"], "unknown option --dry-rnu (did you mean --dry-run?); `gsac cache gc --help`"),
    (["--quite", "run"], "unknown option --quite (did you mean --quiet?); `gsac --help`"),
    (["run", "clip.mp4", "-x"], "unknown option -x; "),
    (["pack", "one", "two"], "two is one word too many; `gsac pack --help`"),
])
def test_a_misspelt_option_is_named_alone_with_the_nearest_one_of_its_command(capsys, arguments, words):
    assert execute(arguments) == ExitCode.USAGE
    said = capsys.readouterr().err
    assert words in said and "usage:" not in said and "draft" not in said


@pytest.mark.parametrize("name", command.names())
def test_a_benchmark_takes_an_option_by_its_whole_name_alone(capsys, name):
    assert execute(["bench", name, "--hel"]) == ExitCode.USAGE
    assert f"`gsac bench {name} --help`" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(("arguments", "words"), [
    (["run", "clip.mp4", "--height", "1,78"], "argument --height: invalid float value: '1,78'; `gsac run --help` tells"),
    (["bundle", "exprt"], "invalid choice: 'exprt' (choose from 'export', 'import'); `gsac bundle --help` tells"),
    (["pack"], "the following arguments are required: DIR; `gsac pack --help` tells"),
])
def test_a_wrong_word_on_the_command_line_is_one_sentence_with_the_help_to_ask(capsys, arguments, words):
    assert execute(arguments) == ExitCode.USAGE
    said = capsys.readouterr().err
    assert words in " ".join(said.split()) and "usage:" not in said


@pytest.mark.parametrize(("command", "goes_on"), [("run", True), ("batch", True), ("compare", False), ("render", False)])
def test_only_commands_that_run_stages_say_after_ctrl_c_that_they_go_on(monkeypatch, capsys, command, goes_on):
    def interrupted(arguments):
        raise KeyboardInterrupt

    parsed = argparse.Namespace(command=command, do=interrupted)
    monkeypatch.setattr("gsac.pipeline.cli.make_parser", lambda argv: SimpleNamespace(parse_args=lambda argv: parsed))
    assert execute([command]) == ExitCode.INTERRUPTED
    assert ("the same command goes on from there" in capsys.readouterr().err) == goes_on


def test_a_misspelt_parameter_of_ours_is_answered_with_its_name(capsys):
    assert execute(["run", "nowhere.mp4", "--set", "smplx.heigth_m="]) == ExitCode.USAGE
    assert "unknown parameter smplx.heigth_m (did you mean smplx.height_m?)" in capsys.readouterr().err


def test_a_word_far_from_all_known_ones_gets_no_suggestion(toy):
    done = toy.gsac("xyzzy")
    assert done.code == ExitCode.USAGE and "unknown command xyzzy; known: " in done.err


SHOUT = """
HELP = "say it loudly"


def declare(command):
    command.add_argument("word")
    command.set_defaults(do=do)


def do(arguments):
    print(arguments.word.upper())
    return 0
"""


@pytest.fixture
def shout(toy):
    """A distribution beside gsac that brings the command `shout`."""
    (toy.root / "lib" / "shouting.py").write_text(SHOUT)
    info = toy.root / "lib" / "shouting-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: shouting\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[gsac.commands]\nshout = shouting\n")
    return toy


def test_a_command_by_entry_point_runs_and_stands_in_the_help(shout):
    done = shout.gsac("shout", "hello")
    assert done.code == 0 and done.out == "HELLO\n"
    assert "say it loudly" in shout.gsac("--help").out


def test_entry_points_are_not_read_for_a_command_of_the_engine(shout):
    (shout.root / "lib" / "shouting.py").write_text("raise SystemExit('loaded')")
    assert shout.gsac("cache", "ls").code == 0
    command = shout.command("cache", "ls")
    script = f"import sys\nfrom gsac.pipeline import cli\ncli.execute({command[4:]!r})\nprint('importlib.metadata' in sys.modules)"
    done = subprocess.run([*command[:2], "-c", script], env=shout.env, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "False"


def test_an_entry_point_that_cannot_be_loaded_is_a_sentence(shout):
    os.unlink(shout.root / "lib" / "shouting.py")
    done = shout.gsac("shout", "hello")
    assert done.code == ExitCode.USAGE and "the command shout cannot be loaded" in done.err and "`make setup`" in done.err


def test_bench_in_an_environment_that_was_installed_before_it_names_make_setup(monkeypatch, capsys):
    monkeypatch.setattr(commands, "load_added", dict)
    assert execute(["bench", "size"]) == ExitCode.USAGE
    assert "the command bench" in (said := capsys.readouterr().err) and "run `make setup`" in said
    with pytest.raises(SystemExit):
        execute(["--help"])
    assert "`make setup`" in " ".join(capsys.readouterr().out.split())
