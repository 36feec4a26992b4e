"""Puts a made-up result of every shipped stage into the store, so that `gsac run CLIP` finds nothing to do.

Outputs are folders of 120 files and single files, as many as a real run has.
"""

import sys
from pathlib import Path

from gsac.cache.digest import tree_digest
from gsac.cache.publish import publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
from gsac.pipeline.graph import CLIP
from gsac.pipeline.keys import Keys
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project

FRAMES = 120

store = Store.open()
project = Project.at_hand()
keys = Keys(project, resolve(project), store)
digests = {CLIP: tree_digest(Path(sys.argv[1]))[0]}
for name, step in project.graph.steps.items():
    parts = keys.parts(name, {port: digests[port] for port in step.deps})
    with store.private(name) as folder:
        for output in project.stage(name).outputs:
            path = folder / output.path
            path.parent.mkdir(parents=True, exist_ok=True)
            if Path(output.path).suffix:
                path.write_text(f"{name} {output.path}")
            else:
                path.mkdir()
                for i in range(FRAMES):
                    (path / f"{i:06d}.png").write_text(f"{name} {i}")
        record = publish(store, parts, folder, tuple(o.path for o in project.stage(name).outputs), RunInfo(seconds=1.0))
    digests |= {f"{name}/{output}": digest for output, digest in record.outputs.items()}
