"""What a user brings may be damaged in any way: every reader reads it or says in a sentence what is wrong, at once and in little
memory. `GSAC_MUTANTS=5000` gives each reader so many damaged files; `python -m support.readers 100000` bounds memory too."""

import os
import resource

import pytest

from support import readers

COUNT = int(os.environ.get("GSAC_MUTANTS", "200"))


@pytest.mark.parametrize("name", readers.READERS)
def test_a_damaged_file_is_read_or_named_and_never_ends_in_a_traceback(name):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    tally = readers.attack(name, max(3, round(COUNT * readers.READERS[name].share)))
    assert (tally.uncaught, tally.large, tally.slow) == ([], [], [])
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < readers.MEMORY
