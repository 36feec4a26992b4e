"""gsac cache ls | verify | gc | push | pull: what lies in the store, whether it is sound, what may go, and what is shared."""

from __future__ import annotations

import argparse
import dataclasses
import re
from collections.abc import Callable, Iterator

from gsac.cache import gc, listing, verify
from gsac.cache.code import code_parts
from gsac.cache.errors import CacheFolderError
from gsac.cache.key import KeyParts
from gsac.cache.roots import find_roots
from gsac.cache.store import Store
from gsac.pipeline.byte_size import format_size
from gsac.pipeline.commands.options import add_json, answer_reporter, find_store, open_store, progress_reporter
from gsac.pipeline.commands.shared_cache import declare_pull, declare_push, require_results
from gsac.pipeline.json_output import emit
from gsac.pipeline.model_store import ModelStore
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.project import Project
from gsac.pipeline.run_folder import RunFolder
from gsac.stages.contract import BadInput
from gsac.stages.counting import counted

UNITS = {"": 1, "K": 10**3, "M": 10**6, "G": 10**9, "T": 10**12}


def declare(command: argparse.ArgumentParser) -> None:
    does = command.add_subparsers(dest="does", required=True, metavar="ls|verify|gc|push|pull")
    one = does.add_parser("ls", help="every result with the clip and the folder that shows it, the last used first")
    add_json(one)
    one.set_defaults(do=do_ls)
    one = does.add_parser("verify", help="read every byte; what is damaged is moved to quarantine, what was made of it is dropped")
    one.add_argument("--repair", action="store_true", help="also pull model files again that were found damaged")
    add_json(one)
    one.set_defaults(do=do_verify)
    one = does.add_parser("gc", help="remove rubbish, and with a bound the results that were not used for longest")
    one.add_argument("--keep-days", type=float, metavar="N", help="remove results not used for N days")
    one.add_argument("--max-size", metavar="SIZE", help="remove the longest unused until this much is left, e.g. 20G")
    one.add_argument("--force", action="store_true", help="take also what folders of runs show")
    one.add_argument("--dry-run", action="store_true", help="say what would go")
    one.add_argument("--remote", action="store_true", help="in the place that GSAC_REMOTE names, and not here")
    add_json(one)
    one.set_defaults(do=do_gc)
    declare_push(does.add_parser("push", help="put results into the place that GSAC_REMOTE names, for other machines"))
    declare_pull(does.add_parser("pull", help="get results that other machines have put there"))


def do_ls(arguments: argparse.Namespace) -> ExitCode:
    reporter = answer_reporter(arguments)
    store = find_store(progress_reporter(arguments))
    rows, folders = listing.ls(store), [RunFolder(root.folder) for root in find_roots(store)]
    shown = {folder: folder.objects() for folder in folders}
    places = {row.key: [folder for folder in folders if not shown[folder].isdisjoint(row.objects)] for row in rows}
    for row in rows:
        age = f"{row.age_s / 86400:6.1f} d"
        reporter.note(f"{row.stage:<10} {row.key[:16]}  {format_size(row.bytes):>9}  {age}  {row.seconds:8.1f} s  "
                      f"{describe_places(places[row.key])}")
    reporter.note(f"{counted(len(rows), 'result')}, {format_size(sum(row.bytes for row in rows))} in {store.root}")
    if arguments.json:
        emit({"root": str(store.root), "results": [
            dataclasses.asdict(row) | {"clips": sorted({folder.clip_name for folder in places[row.key]}),
                                       "folders": [str(folder.root) for folder in places[row.key]]} for row in rows]})
    return ExitCode.OK


def do_verify(arguments: argparse.Namespace) -> ExitCode:
    reporter = answer_reporter(arguments)
    store = find_store(reporter)
    if not (store.root / "objects").is_dir():
        raise CacheFolderError(f"there is no cache in {store.root}; GSAC_CACHE names another folder, or none was made yet")
    report, models = verify.verify(store, declared_by(Project.at_hand(), store)), ModelStore(store)
    for name in report.lost:
        reporter.note(f"{name}: dropped; it will be computed again")
    for name in report.derived:
        reporter.note(f"{name}: dropped, since it may have been made of damaged files; it will be computed again")
    gone = models.gone
    for name in gone:
        reporter.note(f"{name}: the file that you brought is gone; bring it again with `gsac models add {name} FILE`")
    reporter.note(f"{report.objects} objects, {format_size(report.bytes)} sound, {len(report.damaged)} damaged; "
                  f"{report.models} model files, {len(report.damaged_models)} damaged; in {store.root}")
    repaired = models.pull_again(reporter.note) if arguments.repair else []
    if arguments.json:
        emit({"sound": report.sound and not gone, **dataclasses.asdict(report), "gone_models": gone, "repaired": repaired})
    return ExitCode.OK if report.sound and not gone else ExitCode.INTEGRITY


def declared_by(project: Project, store: Store) -> Callable[[KeyParts], tuple[str, ...] | None]:
    """Outputs that the stages at hand declare for a key; None for a key of other code."""
    codes: dict[str, dict[str, str]] = {}

    def outputs(parts: KeyParts) -> tuple[str, ...] | None:
        name = parts.stage
        if name not in project.graph.steps:
            return None
        if name not in codes:
            codes[name] = code_parts(project.entry(name), project.stage(name).code, store.memo)
        return project.outputs(name) if parts.code == codes[name] else None

    return outputs


def do_gc(arguments: argparse.Namespace) -> ExitCode:
    reporter = answer_reporter(arguments)
    limit = parse_size(arguments.max_size) if arguments.max_size is not None else None
    if arguments.keep_days is not None and not arguments.keep_days >= 0:
        raise BadInput(f"--keep-days {arguments.keep_days}: expected 0 or more")
    if arguments.remote:
        if limit is not None or arguments.force:
            raise BadInput("--remote goes with --keep-days and --dry-run alone; nobody knows there which results are in use")
        return do_gc_remote(arguments)
    report = gc.collect(open_store(reporter), arguments.keep_days, limit, arguments.dry_run, force=arguments.force)
    verb = "would remove" if arguments.dry_run else "removed"
    left = counted(len(report.temps) + len(report.partial), "left-over")
    reporter.note(f"{verb} {counted(len(report.records), 'result')}, {counted(len(report.objects), 'object')}, {left} of "
                  f"dead runs: {format_size(report.freed_bytes)}; {format_size(report.kept_bytes)} stay")
    for line in reasons(report):
        reporter.note(line)
    if arguments.json:
        emit(dataclasses.asdict(report))
    return ExitCode.OK


def do_gc_remote(arguments: argparse.Namespace) -> ExitCode:
    from gsac.cache.remote.sweep import sweep_remote

    reporter, results = answer_reporter(arguments), require_results()
    report = sweep_remote(results.bucket, arguments.keep_days, arguments.dry_run)
    verb = "would remove" if arguments.dry_run else "removed"
    reporter.note(f"{verb} {counted(len(report.records), 'result')}, {counted(len(report.objects), 'object')}, "
                  f"{counted(len(report.claims) + len(report.unfinished), 'left-over')} from {results.bucket.url}: "
                  f"{format_size(report.freed_bytes)}; {format_size(report.kept_bytes)} stay")
    if arguments.json:
        emit({"remote": results.bucket.url} | dataclasses.asdict(report))
    return ExitCode.OK


def reasons(report: gc.GcReport) -> Iterator[str]:
    """Lines on what stays although a bound would take it, and on what folders lose."""
    if report.recent:
        yield f"{len(report.recent)} results stay since they were used within the last hour"
    if report.in_use:
        yield f"{len(report.in_use)} results stay since a run in progress uses them"
    if report.kept:
        yield f"{len(report.kept)} folders keep what they show; --force takes it:"
    for folder, links in report.kept.items():
        yield f"  {folder} keeps {', '.join(links)}"
    for folder, links in report.lost.items():
        yield f"  {folder} {'would lose' if report.dry_run else 'loses'} {', '.join(links)}"


def describe_places(folders: list[RunFolder]) -> str:
    """Clip and folder of a result, and how many more there are; `-` where no folder shows it."""
    if not folders:
        return "-"
    more = f" and {len(folders) - 1} more" if len(folders) > 1 else ""
    return f"{folders[0].clip_name}  {folders[0].root}{more}"


def parse_size(text: str) -> int:
    """Bytes of `500M`, `20G`, `1.5 TB`."""
    match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*([KMGT]?)B?\s*", text, re.IGNORECASE)
    if match is None:
        raise BadInput(f"--max-size {text or repr(text)}: expected a size such as 500M or 20G")
    return int(float(match.group(1)) * UNITS[match.group(2).upper()])
