"""What each command does. Every function takes parsed arguments and returns the exit status."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jsonargparse import Namespace

from agents.config import DemoConfig
from shotenv.config import BankConfig
from unwrap.support import progress, say, write_bytes, write_json

if TYPE_CHECKING:
    from shotenv.bank import Bank

DONE, FAILED = 0, 1


def doctor(arguments: Namespace) -> int:
    """Say what is installed and what is missing."""
    from agents.cli.doctor import examine

    findings = examine()
    for finding in findings:
        print(finding)
    _write_json(arguments, [vars(finding) for finding in findings])
    return DONE if all(finding.well for finding in findings) else FAILED


def demo(arguments: Namespace) -> int:
    """The main job, small."""
    from agents.evaluation import run_demo

    return _report(arguments, run_demo(_experiment(arguments), arguments.out))


def train(arguments: Namespace) -> int:
    """Train a scheduler."""
    from agents.evaluation import make_ready, train_scheduler

    config = _experiment(arguments)
    make_ready(config.env)
    train_scheduler(config, arguments.out)
    print(f"The scheduler is in {arguments.out}; `shotenv evaluate {arguments.out}` judges it.")
    return DONE


def evaluate(arguments: Namespace) -> int:
    """Judge a trained scheduler."""
    from agents.evaluation import evaluate_scheduler, make_ready
    from agents.policies import PpoPolicy

    scheduler, config = PpoPolicy.load(arguments.scheduler), _experiment(arguments)
    make_ready(config.env)
    results = evaluate_scheduler(config, scheduler, arguments.out)
    return _report(arguments, results)


def report(arguments: Namespace) -> int:
    """Write the page of an evaluation anew."""
    from agents.report import write_report

    print(write_report(arguments.results))
    return DONE


def _report(arguments: Namespace, results: dict[str, Any]) -> int:
    from agents.report import rival_note, verdict, write_report

    page = write_report(arguments.out)
    _write_json(arguments, results)
    print(f"\n{verdict(results)} {rival_note(results)}\n\nReport: {page.resolve()}")
    return DONE


def problem(arguments: Namespace) -> int:
    """Measure the decision problem."""
    from agents.evaluation import (
        check_solvable,
        drive_seeds,
        make_ready,
        measure_problem,
        print_problem,
    )
    from agents.optimum import tabulate
    from shotenv.decision import open_problem

    config = _experiment(arguments)
    check_solvable(config.env.laser)  # before minutes are spent
    make_ready(config.env)
    counts = {"validation": config.study.tuning_drives, config.study.split: config.study.drives}
    frames = sum(counts.values()) * config.env.frames_per_drive
    problems = {
        split: open_problem(config.env.model_copy(update={"split": split})) for split in counts
    }
    with progress(frames, "playing every action in every frame", "frame") as bar:
        validation, test = (
            tabulate(problems[split], drive_seeds(config.study, count), tick=bar.update)
            for split, count in counts.items()
        )
    found = measure_problem(validation, test, config.env.reward, config.study)
    print_problem(found, config.study.confidence)
    _write_json(arguments, found)
    return DONE


def render(arguments: Namespace) -> int:
    """Render a bank."""
    from shotenv.bank import build_bank

    config = BankConfig(**{name: arguments[name] for name in BankConfig.model_fields})
    folder = build_bank(config, arguments.out, workers=arguments.workers)
    print(f"The bank is in {folder}")
    return DONE


def bank_info(arguments: Namespace) -> int:
    """Tell what is in a bank, or which banks there are."""
    from shotenv.bank import contents_of, known_banks, open_bank, print_banks, print_contents

    if arguments.bank is None:
        banks = known_banks()
        print_banks(banks)
        _write_json(arguments, banks)
        return DONE
    bank = open_bank(arguments.bank, render=False)
    about = contents_of(bank)
    print_contents(about)
    if arguments.sheet is not None:
        _write_sheet(bank, arguments.sheet, arguments.clips)
    _write_json(arguments, about)
    return DONE


def _write_sheet(bank: Bank, path: Path, clips: int) -> None:
    from shotenv.bank import contact_sheet

    content = io.BytesIO()
    contact_sheet(bank, clips=clips).save(content, format="PNG")
    write_bytes(path, content.getvalue())
    print(f"Contact sheet: {path.resolve()}")


def bank_verify(arguments: Namespace) -> int:
    """Check every file of a bank against its checksum."""
    from shotenv.bank import open_bank, verify

    bank = open_bank(arguments.bank, render=False)
    with progress(len(bank.clips), "verifying", "clip") as bar:
        damaged = verify(bank.folder, tick=bar.update)
    for path in (bank.folder / name for name in damaged):
        say(f"shotenv: {path} is damaged; delete {path.parent} and render the bank again")
    if not damaged:
        print(f"{bank.folder}: every file is as it was written")
    _write_json(arguments, {"folder": str(bank.folder), "damaged": list(damaged)})
    return FAILED if damaged else DONE


def unwrap_train(arguments: Namespace) -> int:
    """Train an unwrapping network."""
    from shotenv.dataset import sources
    from unwrap.training import TrainConfig, train

    config = TrainConfig(**{name: arguments[name] for name in TrainConfig.model_fields})
    print(f"The network is in {train(config, sources(config), arguments.out)}")
    return DONE


def unwrap_evaluate(arguments: Namespace) -> int:
    """Measure an unwrapping network."""
    from shotenv.bank import open_bank
    from shotenv.config import env_config
    from shotenv.dataset import measure_unwrapping, print_unwrapping
    from shotenv.decision import open_problem
    from unwrap import load_unwrapper

    load_unwrapper(arguments.unwrapper)  # refused before a bank is rendered for it
    chosen = {name: arguments[name] for name in ("bank", "unwrapper", "split")}
    # Every frame stands alone here: a bank of any frame rate will do.
    if (rendered := open_bank(arguments.bank).config) is not None:
        chosen["frame_rate_hz"] = rendered.world.frame_rate_hz
    problem = open_problem(env_config(**chosen))
    frames = sum(clip.frames for clip in problem.clips)
    with progress(frames, "unwrapping", "frame") as bar:
        found = measure_unwrapping(problem, tick=bar.update)
    print_unwrapping(found)
    _write_json(arguments, found)
    return DONE


def unwrap_table(arguments: Namespace) -> int:
    """Train, score and show every method of the results table."""
    from unwrap.comparison import TableConfig, make_table

    config = TableConfig(**{name: arguments[name] for name in TableConfig.model_fields})
    rows = make_table(config, arguments.out, arguments.page, arguments.only)
    _write_json(arguments, rows)
    return DONE


def unwrap_correct(arguments: Namespace) -> int:
    """Correct a recording."""
    from unwrap.recordings import correct_files

    _write_json(arguments, correct_files(arguments))
    return DONE


def unwrap_export(arguments: Namespace) -> int:
    """Write a network as ONNX."""
    from unwrap.export import export_files

    _write_json(arguments, export_files(arguments))
    return DONE


def _experiment(arguments: Namespace) -> DemoConfig:
    return DemoConfig(env=arguments.env, agent=arguments.agent, study=arguments.study)


def _write_json(arguments: Namespace, numbers: Any) -> None:
    path: Path | None = arguments.json
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_json(path, numbers)
