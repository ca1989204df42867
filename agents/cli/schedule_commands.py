"""Commands that train schedulers, judge them and report: `demo` is all of them in one go."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jsonargparse import ArgumentParser, Namespace
from jsonargparse.typing import NonNegativeInt

from agents.cli.command import (
    DONE,
    Command,
    add_executor,
    add_experiment,
    add_out,
    add_out_or_url,
    add_trust,
    execution_of,
    experiment_of,
    play_on_one_thread,
    prepare_bank,
    write_numbers,
)
from agents.config import DemoConfig
from shotenv.config import ConfigError, read_config
from unwrap.storage import Place
from unwrap.support import say, write_json

if TYPE_CHECKING:
    from agents.config import StudyPlan
    from agents.evaluation import Evaluation
    from agents.policies import Scheduler
    from agents.study import Job

COMPARISON = Path("runs/comparison.html")
RESULTS = "results.json"


def demo_arguments(parser: ArgumentParser) -> None:
    """The experiment, and where its results go."""
    add_experiment(parser)
    add_out(parser, "runs/demo", "folder of the results and the report")


def run_demo(arguments: Namespace) -> int:
    """Render, train, evaluate and report: the main job, small."""
    from agents.evaluation import evaluate_scheduler, families_of
    from agents.training import train_scheduler

    config = experiment_of(arguments)
    families_of(config.study)  # refused now, not after the training
    say(f"1/4  Bank '{config.env.bank}' and the network's predictions for it")
    prepare_bank(config.env)
    play_on_one_thread()
    say(f"2/4  Scheduler, by {config.agent.algorithm}")
    scheduler = train_scheduler(config, arguments.out / "agent")
    say("3/4  Rules tuned, fronts played")
    evaluation = evaluate_scheduler(config, scheduler)
    say("4/4  Report")
    return publish(arguments, config, evaluation)


def train_arguments(parser: ArgumentParser) -> None:
    """The experiment, and where the scheduler goes."""
    add_experiment(parser)
    add_out_or_url(parser, "runs/agent", "folder of the scheduler and its checkpoint")
    parser.add_argument(
        "--seeds",
        type=NonNegativeInt,
        nargs="+",
        metavar="N",
        help="train with each, into seed-N in the folder, instead of with agent.seed",
    )
    add_executor(parser, "seeds")


def train(arguments: Namespace) -> int:
    """Train a scheduler, or one with each of several seeds."""
    from agents.study import train_seeds
    from agents.training import train_scheduler

    config, execution = experiment_of(arguments), execution_of(arguments)
    if arguments.seeds is None and execution != {"executor": "local", "workers": None}:
        raise ConfigError("--executor and --workers: expected with --seeds alone")
    if arguments.seeds is None and isinstance(arguments.out, str):
        raise ConfigError(f"out is {arguments.out}, a place: expected with --seeds alone")
    prepare_bank(config.env)
    if arguments.seeds is not None:
        folders = train_seeds(config, arguments.seeds, arguments.out, **execution)
        print(f"The schedulers are in {', '.join(map(str, folders))}")
        return DONE
    play_on_one_thread()
    train_scheduler(config, arguments.out)
    print(f"The scheduler is in {arguments.out}; `shotenv evaluate {arguments.out}` judges it.")
    return DONE


def evaluate_arguments(parser: ArgumentParser) -> None:
    """Which scheduler, the experiment, and where its results go."""
    parser.add_argument("scheduler", type=Path, help="folder of a trained scheduler, or a zip")
    add_trust(parser)
    parser.add_argument(
        "--budget",
        type=float,
        metavar="J",
        help="judge all, too, at this laser energy per drive on average, beside the optimum at it",
    )
    add_experiment(parser)
    add_out(parser, "runs/evaluation", "folder of the results and the report")


def evaluate(arguments: Namespace) -> int:
    """Judge a trained scheduler."""
    from agents.evaluation import check_study, evaluate_scheduler
    from agents.policies import load_policy
    from agents.report.recordings import tells_less

    # Loaded first: a folder without a scheduler is refused before a bank is rendered.
    scheduler = load_policy(arguments.scheduler, trust=arguments.trust)
    config = experiment_of(arguments)
    check_study(config, scheduler)
    prepare_bank(config.env)
    play_on_one_thread()
    if tells_less(config):
        return publish_recordings(arguments, config, scheduler)
    found = evaluate_scheduler(config, scheduler, budget_j=arguments.budget)
    return publish(arguments, config, found)


def publish(arguments: Namespace, config: DemoConfig, evaluation: Evaluation) -> int:
    """Write the results and their page into `--out`, and say what they say."""
    from agents.report import budget_lines, details, verdict, write_evaluation, write_report

    results = evaluation.results
    write_evaluation(evaluation, config, arguments.out)
    page = write_report(arguments.out)
    write_numbers(arguments, results)
    told = "\n".join((verdict(results), *details(results), *budget_lines(results)))
    print(f"\n{told}\n\nReport: {page.resolve()}")
    return DONE


def publish_recordings(arguments: Namespace, config: DemoConfig, scheduler: Scheduler) -> int:
    """Judge a scheduler on recordings that tell less than simulated drives, and publish that."""
    from agents.evaluation import drive_rows
    from agents.report import DRIVES, RESULTS, write_drives
    from agents.report.recordings import evaluate_recordings, recorded_lines, write_recorded_report

    if arguments.budget is not None:
        raise ConfigError(
            f"budget is {arguments.budget:g}; expected none with recordings that have no "
            "reference, no eight samples, or one clip"
        )
    results, played = evaluate_recordings(config, scheduler)
    write_drives(arguments.out / DRIVES, drive_rows(played))
    write_json(arguments.out / RESULTS, results)
    page = write_recorded_report(results, arguments.out)
    write_numbers(arguments, results)
    told = "\n".join(recorded_lines(results))
    print(f"\n{told}\n\nReport: {page.resolve()}")
    return DONE


def report_arguments(parser: ArgumentParser) -> None:
    """Which results, and where a comparison of several goes."""
    parser.add_argument(
        "results", type=Path, nargs="+", help="folder that an evaluation wrote; several: compared"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help=f"page that compares several evaluations; {COMPARISON} by default",
    )


def report(arguments: Namespace) -> int:
    """Write the page of an evaluation anew, or one that compares several."""
    from agents.report import RESULTS, read_json, write_comparison, write_report
    from agents.report.recordings import write_recorded_report

    folders, out = arguments.results, arguments.out
    if len(folders) > 1:
        print(write_comparison(folders, out or COMPARISON))
    elif out is None:
        results = read_json(folders[0] / RESULTS)
        if "recordings" in results:
            print(write_recorded_report(results, folders[0]))
        else:
            print(write_report(folders[0]))
    else:
        raise ConfigError(
            f"out is {out}; expected with several folders alone: the page of one evaluation is "
            "written beside its results"
        )
    return DONE


def study_arguments(parser: ArgumentParser) -> None:
    """Which study, where its jobs run, and where their results go."""
    parser.add_argument("file", type=Path, help="YAML file, such as configs/study/results.yaml")
    add_executor(parser, "jobs")
    add_out_or_url(parser, "runs/study", "folder of the results of each job, and of results.json")


def run_study(arguments: Namespace) -> int:
    """Run the jobs that do not stand yet, and measure what they played."""
    from agents.config import StudyPlan
    from agents.study import jobs_of, publish_study

    plan = read_config(StudyPlan, arguments.file)
    jobs, out = jobs_of(plan), arguments.out
    if isinstance(out, Path):
        found = _played(plan, jobs, arguments, out)
    else:
        with tempfile.TemporaryDirectory() as copy:
            found = _played(plan, jobs, arguments, Path(copy), url=out)
            publish_study(out, jobs, Path(copy))
    for preset, table in found["presets"].items():
        print(f"\n{preset}: {table['best']} errs least at half the energy")
        for name, row in table["rows"].items():
            at_half, rewarded = row["error_at_half_energy"], row["return"]
            print(f"  {name:22}{at_half['iqm']:6.2f} m  return {rewarded['iqm']:8.1f}")
    where = out / RESULTS if isinstance(out, Path) else f"{RESULTS} of {Place(out).url}"
    print(f"\nNumbers: {where}")
    return DONE


def _played(
    plan: StudyPlan, jobs: list[Job], arguments: Namespace, folder: Path, url: str | None = None
) -> dict[str, Any]:
    """The numbers of a study, of which `folder` has the results, and gets `results.json`."""
    from agents.study import make_leaderboard, run_jobs

    run_jobs(jobs, folder, url=url, **execution_of(arguments))
    found = make_leaderboard(plan, jobs, folder)
    write_json(folder / RESULTS, found)
    return found


COMMANDS = (
    Command(
        "demo",
        "render, train a scheduler, compare it with baselines, write a report",
        demo_arguments,
        run_demo,
        resumes=True,
    ),
    Command(
        "train",
        "train a scheduler with PPO, RecurrentPPO, DQN, QR-DQN or a regression",
        train_arguments,
        train,
        resumes=True,
    ),
    Command(
        "evaluate",
        "compare a trained scheduler with baselines, write a report",
        evaluate_arguments,
        evaluate,
    ),
    Command(
        "study",
        "play policies x presets x training seeds, job by job, and rank them",
        study_arguments,
        run_study,
        resumes=True,
    ),
    Command(
        "report",
        "write the report of an evaluation anew, or compare several on one page",
        report_arguments,
        report,
        out_is_file=True,
    ),
)
