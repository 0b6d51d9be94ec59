"""The list of safeguards that `mutations.py` takes away is one of the program as it is."""

import pytest
from mutations import ROOT, read_mutants


@pytest.mark.parametrize("mutant", read_mutants(), ids=lambda mutant: mutant.name)
def test_mutant_changes_one_place(mutant):
    assert (ROOT / mutant.file).read_text().count(mutant.before) == 1
    assert mutant.before != mutant.after
    assert all((ROOT / "tests" / test).is_file() for test in mutant.tests)
