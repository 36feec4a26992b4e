"""gsac bundle export | import: a clip's results as one verified file, with licences and the consent of the person shown."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from gsac.cache.bundle import LINEAGE, BundleError, papers_of, read_bundle, write_bundle
from gsac.cache.lease import in_use
from gsac.cache.record import Record
from gsac.cache.store import Store
from gsac.pipeline.byte_size import format_size
from gsac.pipeline.commands.options import add_force, add_json, answer_reporter, open_store, open_store_of, require_free
from gsac.pipeline.errors import NotUpToDateError
from gsac.pipeline.graph import CLIP
from gsac.pipeline.json_output import emit
from gsac.pipeline.lineage import trace
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.rows import read_rows, result_row, stale_reasons
from gsac.pipeline.run_folder import RunFolder
from gsac.stages.contract import BadInput
from gsac.stages.counting import counted


def declare(command: argparse.ArgumentParser) -> None:
    does = command.add_subparsers(dest="does", required=True, metavar="export|import")
    one = does.add_parser("export", help="write what the folder of a run shows, as the cache holds it, into one file")
    one.add_argument("folder", type=Path, metavar="RUN", help="the folder of a run")
    one.add_argument("--out", type=Path, metavar="FILE", required=True, help="the file to write")
    one.add_argument("--consent", type=Path, action="append", default=[], metavar="FILE",
                     help="what the person shown has agreed to, to go along; may be repeated")
    one.add_argument("--licence", type=Path, action="append", default=[], metavar="FILE",
                     help="terms of the clip, or of model files that were brought, to go along; may be repeated")
    add_force(one)
    add_json(one)
    one.set_defaults(do=do_export)
    one = does.add_parser("import", help="check every byte of such a file, then put its results into the cache")
    one.add_argument("file", type=Path, metavar="FILE", help="what `gsac bundle export` wrote")
    add_json(one)
    one.set_defaults(do=do_import)


def do_export(arguments: argparse.Namespace) -> ExitCode:
    reporter, out = answer_reporter(arguments), arguments.out.absolute()
    if not out.parent.is_dir():
        raise BadInput(f"--out {out}: expected a file in a folder that exists")
    require_free(out, arguments.force)
    run = RunFolder.around(arguments.folder)
    store = open_store_of(run, reporter)
    with run.hold(), in_use(store) as lease:
        records = records_shown(run, store)
        lease.add(*(record.key for record in records))
        clips = {record.parts.inputs[CLIP] for record in records if CLIP in record.parts.inputs}
        if len(clips) != 1:
            raise NotUpToDateError(f"{run.root} shows results of {len(clips)} clips; `gsac run` makes them those of one")
        clip = clips.pop()
        papers = {name: file.read_bytes() for name, file in papers_of(store, clip).items()}
        for kind, files in (("consent", arguments.consent), ("licences", arguments.licence)):
            papers |= {f"papers/{kind}/{file.name}": read_paper(file) for file in files}
        lineage = trace(store, run, run.root)
        lineage.clips, lineage.papers = {clip: [run.clip_name]}, sorted(papers)  # no paths of this machine
        size = write_bundle(out, store, records, clip, papers | {LINEAGE: json.dumps(lineage.to_json(), indent=1).encode()})
    along = ", ".join(name.removeprefix("papers/") for name in sorted(papers))
    reporter.note(f"{counted(len(records), 'result')} of {run.clip_name}, {format_size(size)}; "
                  f"papers: {along or 'none (--consent FILE)'}")
    if arguments.json:
        emit({"stages": [], "outputs": {"bundle": str(out)},
              "metrics": {"results": len(records), "bytes": size, "papers": sorted(papers)}})
    else:
        print(out)
    return ExitCode.OK


def do_import(arguments: argparse.Namespace) -> ExitCode:
    reporter = answer_reporter(arguments)
    store = open_store(reporter)
    try:
        bundle = read_bundle(arguments.file, store)
    except BundleError as error:
        raise BadInput(str(error)) from error
    reporter.note(f"{counted(len(bundle.records), 'result')} of the clip {bundle.clip[:12]}, {format_size(bundle.bytes)}; "
                  "`gsac run` on that clip finds them in the cache")
    for paper in bundle.papers:
        reporter.note(f"paper: {paper}")
    if arguments.json:
        emit({"clip": bundle.clip, "results": [f"{record.parts.stage}/{record.key}" for record in bundle.records],
              "papers": [str(paper) for paper in bundle.papers], "bytes": bundle.bytes})
    return ExitCode.OK


def records_shown(run: RunFolder, store: Store) -> list[Record]:
    """Records of the results that the folder of a run shows. NotUpToDateError where one is stale, or not in the cache any more."""
    records, stale = [], stale_reasons(run)
    for name, row in read_rows(run).items():
        result = result_row(row)
        if result is None:
            continue
        record = store.lookup(str(result.get("key")))
        if name in stale or record is None:
            why = stale.get(name) or "its result is not in the cache any more; run again"
            raise NotUpToDateError(f"{run.root}: {name} is not up to date ({why})")
        records.append(record)
    if not records:
        raise NotUpToDateError(f"{run.root} shows no result; `gsac run` makes them")
    return records


def read_paper(file: Path) -> bytes:
    """A file of the user's. BadInput where it is none."""
    if not file.is_file():
        raise BadInput(f"{file}: no such file")
    return file.read_bytes()
