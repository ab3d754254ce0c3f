"""Running a sweep: in this process, in several, or on a cluster; the rows are the same and come in order."""

from __future__ import annotations

import itertools
import logging
import os
import signal
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from cognitive_arch.errors import SweepError, one_line
from cognitive_arch.evaluation.episodes import run_job
from cognitive_arch.evaluation.rows import Row, open_rows
from cognitive_arch.evaluation.sweep import Job, SweepConfig
from cognitive_arch.execution.heuristics import Heuristics
from cognitive_arch.runlog.records import versions
from cognitive_arch.runs import prepare

PATIENCE_S = 5
"""How long a scheduler may take to answer."""

AHEAD = 4
"""Jobs per worker that a cluster is given beforehand."""

T = TypeVar("T")
R = TypeVar("R")
Work = Callable[[Job], list[Row]]


class SweepInterrupted(KeyboardInterrupt):
    """Ctrl-C while a sweep goes on; `done` rows of `total` are kept."""

    def __init__(self, done: int, total: int) -> None:
        super().__init__(f"{done} of {total} episodes are kept")
        self.done, self.total = done, total


def run_sweep(
    config: SweepConfig,
    folder: Path,
    command: str = "",
    *,
    jobs: int = 1,
    dask: str | None = None,
    remember: bool = True,
    on_rows: Callable[[int, int], None] = lambda done, total: None,
    on_notice: Callable[[str], None] = lambda text: None,
) -> int:
    """Do all episodes of `config` that `folder` does not hold yet; returns how many those were.

    `jobs` processes share the work, or the workers of the Dask scheduler at `dask`. `remember` has plans
    kept, which changes no row. `on_rows` hears how many rows of how many there are. Raises `SweepError`, and
    `SweepInterrupted` on Ctrl-C.
    """
    if not 1 <= jobs <= 1024:
        raise SweepError(f"{jobs} jobs; valid: 1 to 1024")
    if dask is not None and jobs != 1:
        raise SweepError("--jobs is for this machine, --dask for a cluster, which has its workers; give one")
    with (
        _cluster(dask) as client,
        TemporaryDirectory(prefix="cogarch-plans-") as plans,
        open_rows(folder, config, command) as rows,
    ):
        shared = Path(plans) if jobs > 1 and remember else None  # a cluster has no folder in common
        work = partial(run_job, config, remember=remember, shared=shared)
        before, total = rows.done, config.total
        on_rows(before, total)
        if before < total:
            for planner, heuristics in itertools.product(config.planners, config.heuristics):
                prepare(planner, Heuristics.parse(heuristics), on_notice)
        try:
            for done in _in_order(config.jobs(before), work, jobs, client):
                rows.append(done)
                on_rows(rows.done, total)
        except (KeyboardInterrupt, SystemError) as error:
            if not is_ctrl_c(error):
                raise
            raise SweepInterrupted(rows.done, total) from None
        return rows.done - before


def is_ctrl_c(error: BaseException | None) -> bool:
    """Whether it is one: Ctrl-C in the midst of a compiled call comes out as the cause of a `SystemError`."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _in_order(jobs: Iterable[Job], work: Work, n: int, client: Any) -> Iterator[list[Row]]:
    if client is not None:
        return _on_cluster(jobs, work, client)
    return map(work, jobs) if n == 1 else in_processes(jobs, work, n)


def in_processes(jobs: Iterable[T], work: Callable[[T], R], n: int) -> Iterator[R]:
    """What `work` makes of each job, in their order, the work shared among `n` processes."""
    from joblib import Parallel, delayed

    task = delayed(_single_threaded)
    with _deaf_to_ctrl_c():  # the processes inherit that: Ctrl-C in a terminal goes to all of them
        results = Parallel(n_jobs=n, return_as="generator", batch_size=1)(task(work, job) for job in jobs)
    try:
        yield from results
    finally:
        with warnings.catch_warnings():  # what was done and not asked for any more is done again next time
            warnings.simplefilter("ignore", UserWarning)
            results.close()  # ends the processes, whatever they are at


def _single_threaded(work: Callable[[T], R], job: T) -> R:
    """One process per core is enough: planners that share samples out among threads gain nothing here."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    return work(job)


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _on_cluster(jobs: Iterable[Job], work: Work, client: Any) -> Iterator[list[Row]]:
    """Keep the workers busy a few jobs ahead; what a lost worker had is done again by another."""
    remaining = iter(jobs)
    n = max(len(client.scheduler_info(n_workers=-1)["workers"]), 1) * AHEAD
    waiting = deque(client.submit(work, job, pure=False) for job in itertools.islice(remaining, n))
    try:
        while waiting:
            done = waiting.popleft()
            rows = _result(done)
            waiting.extend(client.submit(work, job, pure=False) for job in itertools.islice(remaining, 1))
            yield rows
    finally:
        client.cancel(list(waiting))


def _result(future: Any) -> list[Row]:
    from distributed import KilledWorker
    from distributed.client import FutureCancelledError

    try:
        rows: list[Row] = future.result()
        return rows
    except (KilledWorker, FutureCancelledError, OSError, TimeoutError) as error:
        raise SweepError(
            f"the cluster lost its work ({one_line(error, 120)}); finished rows are kept, the same command "
            "goes on from there"
        ) from None


@contextmanager
def _cluster(address: str | None) -> Iterator[Any]:
    """A client of the scheduler at `address`, or None; raises `SweepError` if it cannot be used."""
    if address is None:
        yield None
        return
    try:
        from distributed import Client
        from distributed.comm import get_address_host_port
    except ImportError:
        raise SweepError(
            "--dask takes the package distributed: pip install 'cognitive-arch[cluster]'"
        ) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        get_address_host_port(address)  # a client that was half made complains once more when it goes
    except ValueError as error:
        raise SweepError(
            f"'{one_line(address)}' is no address of a Dask scheduler ({one_line(error)}); valid: an address "
            "such as tcp://127.0.0.1:8786"
        ) from None
    try:
        client = Client(address, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise SweepError(
            f"no Dask scheduler answers at {one_line(address)} within {PATIENCE_S} s "
            f"({one_line(error) or type(error).__name__}); valid: an address such as tcp://127.0.0.1:8786"
        ) from None
    try:
        _check_workers(client, address)
        yield client
    finally:
        client.close(timeout=1)


def _check_workers(client: Any, address: str) -> None:
    """There must be workers, with the same versions: else the rows would not be the same."""
    theirs = client.run(versions)
    if not theirs:
        raise SweepError(f"the Dask scheduler at {one_line(address)} has no workers; start some: dask worker")
    mine = versions()
    for worker, found in sorted(theirs.items()):
        differing = [
            f"{key} {found.get(key)}, here {mine[key]}" for key in mine if found.get(key) != mine[key]
        ]
        if differing:
            raise SweepError(
                f"the Dask worker {worker} has other versions: {one_line('; '.join(differing), 200)}"
            )
