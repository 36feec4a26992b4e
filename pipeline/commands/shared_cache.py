"""gsac cache push | pull: results of this cache and of the place that GSAC_REMOTE names."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from gsac.cache.errors import CacheSetupError, IntegrityError
from gsac.cache.record import Record, is_digest
from gsac.cache.root import REMOTE
from gsac.cache.store import Store
from gsac.pipeline.commands.options import add_json, answer_reporter, find_store, open_store
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.reporter import Speaker
from gsac.pipeline.rows import read_rows, result_row
from gsac.pipeline.run_folder import RunFolder
from gsac.pipeline.sharing import shared_results
from gsac.stages.contract import BadInput

if TYPE_CHECKING:
    from gsac.cache.remote.results import Results

WHAT = "folders of runs, or keys or their beginnings (default: all results)"
SHORTEST = 8
"""Characters of a key's beginning at least."""


def declare_push(one: argparse.ArgumentParser) -> None:
    one.add_argument("what", nargs="*", metavar="RUN|KEY", help=WHAT)
    one.add_argument("--force", action="store_true", help="write over results of the same keys")
    add_json(one)
    one.set_defaults(do=do_push)


def declare_pull(one: argparse.ArgumentParser) -> None:
    one.add_argument("what", nargs="*", metavar="RUN|KEY", help=WHAT)
    add_json(one)
    one.set_defaults(do=do_pull)


def do_push(arguments: argparse.Namespace) -> ExitCode:
    from gsac.cache.remote.bucket import RemoteError

    reporter, results = answer_reporter(arguments), require_results()
    store = find_store(reporter)
    here = {(file.parent.name, file.stem): file for file in store.record_files() if is_digest(file.stem)}
    told: dict[str, list[str]] = {"pushed": [], "there": [], "failed": []}
    for stage, key in chosen(arguments.what, here, f"the cache {store.root}"):
        record = store.lookup(key)
        title = f"{stage}/{key}"
        if record is None:
            reporter.note(f"{stage} {key[:12]}: not sound here; it is computed again when a run needs it")
            told["failed"].append(title)
            continue
        try:
            pushed = results.push(store, record, arguments.force)
        except (RemoteError, IntegrityError) as error:
            reporter.note(f"{stage} {key[:12]}: {error}")
            told["failed"].append(title)
            if isinstance(error, RemoteError):
                break
            continue
        reporter.note(f"{stage} {key[:12]}: {pushed.sentence}")
        told[pushed.value].append(title)
    return close(arguments, results, told)


def do_pull(arguments: argparse.Namespace) -> ExitCode:
    from gsac.cache.remote.bucket import RemoteError

    reporter, results = answer_reporter(arguments), require_results()
    store = open_store(reporter)
    told: dict[str, list[str]] = {"pulled": [], "there": [], "failed": []}
    try:
        for stage, key in chosen(arguments.what, results.keys(), results.bucket.url):
            there = store.lookup(key) is not None
            word = "there" if there else "pulled" if pull_one(results, store, stage, key, reporter) else "failed"
            told[word].append(f"{stage}/{key}")
            reporter.note(f"{stage} {key[:12]}: {word}")
    except RemoteError as error:
        reporter.note(f"gsac: {error}")
        told["failed"].append(results.bucket.url)
    return close(arguments, results, told)


def pull_one(results: Results, store: Store, stage: str, key: str, say: Speaker) -> Record | None:
    """The result, put into the store; None where what is there is not as recorded."""
    from gsac.cache.lease import single_flight

    with single_flight(store, key, lambda: say.note(f"{stage}: a run here computes it; waiting for it")) as there:
        return there or results.fetch(store, stage, key)


def require_results() -> Results:
    """The shared results. CacheSetupError where none are named."""
    results = shared_results()
    if results is None:
        raise CacheSetupError(f"{REMOTE} is not set; set it to s3://bucket/prefix, or to file:///folder for a folder that all see")
    return results


def chosen(what: list[str], known: Iterable[tuple[str, str]], where: str) -> Iterator[tuple[str, str]]:
    """Stage and key of what a command line names, of those that are known; all without a name. BadInput on what is none of them.

    where: what they are known in, for the error.
    """
    if not what:
        yield from known
        return
    there = list(known)
    for word in what:
        if Path(word).is_dir():
            keys = keys_of_run(Path(word))
        else:
            keys = {key for _, key in there if len(word) >= SHORTEST and key.startswith(word)}
            if not keys:
                raise BadInput(f"{word}: neither the folder of a run nor a key of {where}, or its first {SHORTEST} digits at "
                               "least; `gsac cache ls` lists the keys that are here")
        yield from ((stage, key) for stage, key in there if key in keys)


def keys_of_run(folder: Path) -> set[str]:
    """Keys of the results that the folder of a run shows."""
    rows = map(result_row, read_rows(RunFolder.around(folder)).values())
    return {str(row.get("key")) for row in rows if row is not None}


def close(arguments: argparse.Namespace, results: Results, told: dict[str, list[str]]) -> ExitCode:
    """Prints the object of --json; FAILED where something failed."""
    answer_reporter(arguments).note(", ".join(f"{len(titles)} {word}" for word, titles in told.items()) + f"; {results.bucket.url}")
    if arguments.json:
        emit({"remote": results.bucket.url, **told})
    return ExitCode.FAILED if told["failed"] else ExitCode.OK
