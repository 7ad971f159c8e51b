"""The comparison of two versions: its jobs, the process that runs them, and what it prints."""

from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
JOBS = ROOT / "benchmarks" / "jobs.py"


@pytest.fixture(scope="module")
def compare(benchmark):
    return benchmark("compare")


@pytest.fixture
def worker(compare, tmp_path):
    worker = compare.Worker(ROOT, JOBS, tmp_path)
    yield worker
    worker.close()


class Made:
    """A worker whose jobs take known times, one after the other."""

    def __init__(self, **times):
        self.times, self.name = {name: iter(each) for name, each in times.items()}, None

    def ask(self, request):
        if request == "run":
            return {"ms": next(self.times[self.name])}
        self.name = request.split()[1]
        return {} if self.name in self.times else {"error": f"KeyError: {self.name}"}


def test_a_process_lists_prepares_and_runs_jobs(worker):
    assert "fit_hops33" in worker.jobs
    assert worker.ask("prepare paper64_walks") == {}
    assert 0 < worker.ask("run")["ms"] < 1000
    assert worker.ask("prepare nothing") == {"error": "KeyError: 'nothing'"}
    assert "is no request" in worker.ask("stop")["error"]


def test_ratios_are_those_of_minima_and_of_rounds(compare):
    times = np.array([[10.0, 12], [20, 22], [16, 32], [10, 15]])
    np.testing.assert_allclose(compare.ratios(times), [1.2, 1.175, 1.35, 1.625])


def test_slower_jobs_are_listed_if_both_ratios_say_so(compare, capsys):
    old = Made(slow=[10, 10, 10], once=[10, 10, 10], same=[1, 2, 3], gone=[1, 1, 1])
    new = Made(slow=[12, 13, 12], once=[10, 12, 12], same=[1, 2, 3])
    compare.compare((old, new), ["slow", "once", "same", "gone"], rounds=3)
    *lines, last = capsys.readouterr().out.splitlines()
    assert lines[0] == "slow: 10.000 -> 12.000 ms, 1.20; pairs 1.20 (1.20 to 1.25, 3 rounds)"
    assert lines[3] == "gone: new: KeyError: gone"
    assert last == "slower by more than 5%: slow (1.20, 1.20)"
