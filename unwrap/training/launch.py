"""Processes for a training on several devices: started, watched and ended together.

Lightning finds its place among them by the environment variables that launchers like torchrun set.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import torch
from torch import multiprocessing
from torch.multiprocessing import ProcessContext

from unwrap.support import StoppedWatch, end_with_parent

OUTSIDE = ("MASTER_ADDR", "MASTER_PORT", "NODE_RANK")
"""Environment variables by which machines find each other."""

CHECK_S = 1.0
"""How often processes are looked at."""


@dataclass(frozen=True)
class Team:
    """So many processes on each of so many machines."""

    devices: int = 1
    nodes: int = 1

    @property
    def processes(self) -> int:
        """Number of processes on all machines."""
        return self.devices * self.nodes

    @property
    def alone(self) -> bool:
        """Whether it is one process."""
        return self.processes == 1

    def check(self, batch_size: int, frames: int, device: torch.device) -> None:
        """Refuse what cannot be shared by all.

        Raises
        ------
        ValueError
            A number is below 1, there are fewer GPUs or frames than processes, a launcher started
            another number of processes, or it is not told where the other machines are.
        """
        for name in ("devices", "nodes"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; expected at least 1")
        for variable, field, own in (
            ("LOCAL_WORLD_SIZE", "devices", self.devices),
            ("WORLD_SIZE", "devices times nodes", self.processes),
        ):
            started = os.environ.get(variable, own) if is_started() else own
            if str(started) != str(own):
                raise ValueError(
                    f"{field} is {own}, but the launcher started {started} processes ({variable}); "
                    "expected the same number"
                )
        if self.alone:
            return
        if device.type == "cuda" and torch.cuda.device_count() < self.devices:
            raise ValueError(
                f"devices is {self.devices}; expected at most the {torch.cuda.device_count()} "
                "GPUs of this machine"
            )
        # Batch normalisation has nothing to say of a process without a frame.
        fewest = min(batch_size, frames % batch_size or batch_size, frames)
        if fewest < self.processes:
            raise ValueError(
                f"batch_size is {batch_size}, with which {frames} frames leave a batch of {fewest} "
                f"for {self.processes} processes; expected one frame for each of them, so another "
                "batch_size or fewer devices"
            )
        missing = [name for name in OUTSIDE if name not in os.environ]
        if self.nodes > 1 and missing and not is_started():
            raise ValueError(
                f"nodes is {self.nodes}, but {' and '.join(missing)} "
                f"{'is' if len(missing) == 1 else 'are'} not set; expected the address and a free "
                "port of the first machine, and the number of this one, from 0 on"
            )


def is_started() -> bool:
    """Whether a launcher has started this process as one of several."""
    return "LOCAL_RANK" in os.environ


def is_first_process() -> bool:
    """Whether this is the process that talks, of all that train together on any machine."""
    ranks = (os.environ.get(name, "0") for name in ("NODE_RANK", "GROUP_RANK", "LOCAL_RANK"))
    return all(rank == "0" for rank in ranks)


def run_team(team: Team, function: Callable[..., None], *arguments: Any) -> None:
    """Call `function(*arguments)` in each of this machine's processes of a team, and wait.

    The processes are spawned: where `function` or an argument is of a script's own module, the
    script needs the usual `__main__` guard. Leaving in any way ends them all; they ignore Ctrl-C,
    which ends the caller, and end with it.

    Raises
    ------
    RuntimeError
        One of them raised, died or was stopped; the message tells which.
    """
    place = {
        "MASTER_ADDR": "127.0.0.1",
        "MASTER_PORT": str(_free_port()),
        "NODE_RANK": "0",
        **{name: os.environ[name] for name in OUTSIDE if team.nodes > 1},
    }
    threads = max(1, torch.get_num_threads() // team.devices)
    processes = multiprocessing.start_processes(
        _serve,
        (place, threads, function, arguments),
        nprocs=team.devices,
        join=False,
        daemon=True,
        start_method="spawn",
    )
    watches = [StoppedWatch(pid) for pid in processes.pids()]
    try:
        while True:
            alive = [process.sentinel for process in processes.processes if process.is_alive()]
            _require_sound(processes, watches, team)
            if not alive:
                return
            wait(alive, CHECK_S)
    finally:
        for process in processes.processes:
            process.kill()
            process.join()


def _require_sound(processes: ProcessContext, watches: Sequence[StoppedWatch], team: Team) -> None:
    """Raise RuntimeError for the process that failed first, or was stopped, if there is one."""
    for rank, watch in enumerate(watches):
        # The others wait for it, and would for minutes.
        if watch.hangs():
            pid = processes.pids()[rank]
            raise RuntimeError(f"process {rank} of {team.devices} hangs: {pid} was stopped")
    codes = {rank: one.exitcode for rank, one in enumerate(processes.processes) if one.exitcode}
    # One that raises has written why before the others lose it, and may end later than they do.
    raised = {rank: Path(file) for rank, file in enumerate(processes.error_files)}
    raised = {rank: file for rank, file in raised.items() if _report(file)}
    report = ""
    if silent := sorted(codes.keys() - raised.keys()):
        rank, code = silent[0], codes[silent[0]]
        said = f"it died ({signal.Signals(-code).name if code < 0 else f'exit code {code}'})"
    elif raised:
        rank = min(raised, key=lambda rank: raised[rank].stat().st_mtime_ns)
        report = _report(raised[rank])
        said = report.strip().splitlines()[-1]
    else:
        return
    hint = "; if it lost another machine, that one tells why" if team.nodes > 1 else ""
    failure = RuntimeError(f"process {rank} of {team.devices} failed: {said}{hint}")
    failure.add_note(report)
    raise failure


def _report(file: Path) -> str:
    """The traceback that a process has written; empty where it has not, or not all of it yet."""
    with suppress(OSError, EOFError, pickle.UnpicklingError):
        return str(pickle.loads(file.read_bytes()))
    return ""


def _serve(
    rank: int,
    place: dict[str, str],
    threads: int,
    function: Callable[..., None],
    arguments: tuple[Any, ...],
) -> None:
    """Life of one process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    torch.set_num_threads(threads)
    os.environ.update(place, LOCAL_RANK=str(rank))
    function(*arguments)


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]
