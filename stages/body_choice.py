"""Loads the body model that a stage works with: the embedded open one, or an official file that the user brought.

Imports nothing heavy, so that configurations can use it too. `smplx`, `train` and `export` have a parameter `body_model` each,
because each can be replayed alone; a body that was fitted with another model is refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gsac.stages.contract import BadInput, Job

if TYPE_CHECKING:
    from gsac.avatar.body import Body

OPEN = "open"


def brought_files(body_model: str) -> tuple[str, ...]:
    """Names of the model files that a parameter `body_model` needs."""
    return () if body_model == OPEN else (body_model,)


def load_body(job: Job, stage: str, fitted: str | None = None) -> Body:
    """The body of `job.config.body_model`.

    stage: its name, for messages; fitted: digest of the model that body.npz was fitted with, where there is one. Raises BadInput
    where the digests differ, or where the file is not a body model.
    """
    from gsac.avatar.artifacts import ArtifactError
    from gsac.avatar.body import Body

    name = job.config.body_model
    try:
        body = Body.load(job.models.get(name))
    except ArtifactError as e:
        raise BadInput(f"{stage}.body_model is {name}: {e}") from e
    if fitted and fitted != body.digest:
        raise BadInput(f"body.npz was fitted with the body model {fitted[:12]}, but {stage}.body_model {name} is "
                       f"{body.digest[:12]}; give smplx, train and export the same body_model")
    return body
