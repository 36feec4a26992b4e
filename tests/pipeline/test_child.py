"""A stage's process, as the run holds it."""

import os

import pytest

from gsac.pipeline.child import Child


def test_an_interruption_as_its_events_are_opened_ends_in_that_interruption(tmp_path, monkeypatch):
    whole = os.fdopen

    def opened_and_interrupted(number):
        whole(number).close()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Child("gsac.stages.split", "gsac.stages.split.stage", "cpu", tmp_path / "log") as child:
        monkeypatch.setattr(os, "fdopen", opened_and_interrupted)
        child.follow(lambda event: None)
