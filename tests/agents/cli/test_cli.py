import json
import re
from dataclasses import replace

import pytest
import torch
from report_sample import made_up_choices, made_up_results, made_up_strip, made_up_timeline
from safetensors.torch import load_file

from agents.cli.doctor import Finding
from agents.cli.entry import COMMANDS, main
from agents.policies.learned import load_policy
from agents.report.results import CHOICES, FRAMES, RESULTS, TIMELINE, write_strip
from agents.training.branching import Branches
from agents.training.checkpoint import CHECKPOINT
from shotenv.config.families import FAMILIES
from shotenv.config.reader import configs_dir
from unwrap.support.files import write_json


def run(capsys, *words):
    status = main([str(word) for word in words])
    out, err = capsys.readouterr()
    return status, out, err


@pytest.fixture
def tiny(tiny_bank, tiny_unwrapper):
    return ("--env.bank", tiny_bank, "--env.unwrapper", tiny_unwrapper)


def test_overview_lists_every_command(capsys):
    status, out, _ = run(capsys, "--help")
    assert status == 0
    told = re.findall(r"^  (\S.*?)  +(\S.*)$", out, flags=re.MULTILINE)
    assert told == [(command.words, command.help) for command in COMMANDS]
    assert run(capsys)[0] == 2


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.words)
def test_every_command_explains_itself(capsys, command):
    status, out, _ = run(capsys, *command.words.split(), "--help")
    assert status == 0 and f"shotenv {command.words}" in out


RESUMING = {"demo", "train", "study", "render", "bank publish", "fetch"} | {
    "unwrap train",
    "unwrap table",
}


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.words)
def test_ctrl_c_says_what_the_same_command_will_do(capsys, monkeypatch, command):
    def interrupted(arguments):
        raise KeyboardInterrupt

    alone = replace(command, arguments=lambda parser: None, action=interrupted)
    monkeypatch.setattr("agents.cli.entry.COMMANDS", (alone,))
    status, out, err = run(capsys, *command.words.split())
    resumes = command.words in RESUMING
    says = "continues where it stopped" if resumes else "starts over"
    assert (status, out, err) == (130, "", f"shotenv: interrupted; the same command {says}\n")


def test_what_was_interrupted_may_say_itself_what_is_kept(capsys, monkeypatch):
    def interrupted(arguments):
        raise KeyboardInterrupt("its memory is not kept")

    train = next(command for command in COMMANDS if command.words == "train")
    changed = tuple(replace(c, action=interrupted) if c is train else c for c in COMMANDS)
    monkeypatch.setattr("agents.cli.entry.COMMANDS", changed)
    assert run(capsys, "train") == (130, "", "shotenv: interrupted; its memory is not kept\n")


def test_ctrl_c_before_a_command_has_begun_promises_nothing(capsys, monkeypatch):
    def interrupted(words):
        raise KeyboardInterrupt

    monkeypatch.setattr("agents.cli.entry._run", interrupted)
    assert run(capsys, "demo") == (130, "", "shotenv: interrupted\n")


def test_an_interrupted_training_of_the_command_line_goes_on(capsys, monkeypatch, tmp_path, tiny):
    small = "--agent.ppo.total_steps 96 --agent.ppo.num_envs 2 --agent.ppo.rollout_steps 16"
    small += " --agent.ppo.batch_size 16 --agent.ppo.drives 2 --env.frames_per_drive 16"
    small += " --study.tuning_drives 2 --agent.regression.drives 4 --agent.regression.members 1"
    small += " --agent.regression.validation_drives 4 --agent.regression.rounds 2"
    words = ("train", *small.split(), *tiny)
    judge, judged = Branches.mean_return, []

    def interrupting(drives, policy, prices):
        judged.append(policy)
        if len(judged) == 3:
            raise KeyboardInterrupt
        return judge(drives, policy, prices)

    with monkeypatch.context() as patched:
        patched.setattr(Branches, "mean_return", interrupting)
        status, _, err = run(capsys, *words, "--out", tmp_path / "parts")
    assert status == 130 and err.endswith("continues where it stopped\n")
    for name in ("parts", "whole"):
        assert run(capsys, *words, "--out", tmp_path / name)[0] == 0
    one, two = (load_file(tmp_path / name / CHECKPOINT) for name in ("parts", "whole"))
    assert one.keys() == two.keys() and all(torch.equal(one[key], two[key]) for key in one)


SHORT = {
    "recurrent_ppo": "--agent.ppo.total_steps 64 --agent.ppo.num_envs 2"
    " --agent.ppo.rollout_steps 16 --agent.ppo.batch_size 16 --agent.ppo.drives 2"
    " --agent.recurrent.units 4",
    "dqn": "--agent.dqn.total_steps 64 --agent.dqn.num_envs 2 --agent.dqn.learning_starts 16",
    "qrdqn": "--agent.dqn.total_steps 64 --agent.dqn.num_envs 2 --agent.dqn.learning_starts 16",
    "regression": "--agent.regression.rounds 1 --agent.regression.drives 2"
    " --agent.regression.validation_drives 2 --agent.regression.passes 1",
}


@pytest.mark.parametrize("algorithm", SHORT)
def test_every_learner_trains_by_the_same_command(capsys, tmp_path, tiny, algorithm):
    small = f"{SHORT[algorithm]} --env.frames_per_drive 16 --study.tuning_drives 2"
    file = configs_dir() / "agent" / f"{algorithm}.yaml"
    words = ("train", "--agent", file, *small.split(), *tiny, "--out", tmp_path)
    status, out, err = run(capsys, *words)
    assert status == 0 and f"shotenv evaluate {tmp_path}" in out, err
    told = load_policy(tmp_path).provenance
    assert told.algorithm == algorithm and told.power_price == (0.01, 0.35)
    rescored = json.loads((tmp_path / "validation.json").read_text())
    chose, others = rescored["gain_on_drives_that_chose"], rescored["gain_on_others"]
    assert f"{chose:.1f} on the validation drives that chose the policy, {others:.1f} on" in err
    assert chose != others and len(rescored["prices"]) == 4


def test_a_training_that_is_at_its_end_is_not_begun_again(capsys, tmp_path, tiny, monkeypatch):
    small = f"{SHORT['regression']} --env.frames_per_drive 16".split()
    file = configs_dir() / "agent" / "regression.yaml"
    words = ("train", "--agent", file, *small, *tiny, "--out", tmp_path)
    assert run(capsys, *words)[0] == 0
    monkeypatch.setattr(
        "agents.training.scheduler.branches_of", lambda *_: pytest.fail("measured anew")
    )
    assert run(capsys, *words)[0] == 0
    monkeypatch.undo()
    # Another configuration is another run, which must not take this one's place.
    status, _, err = run(capsys, *words, "--agent.seed", "5")
    assert status == 1 and "another configuration" in err
    # What was cut off before its end goes on.
    (tmp_path / "validation.json").unlink()
    assert run(capsys, *words)[0] == 0 and (tmp_path / "validation.json").is_file()


def test_a_group_lists_its_commands(capsys):
    status, out, _ = run(capsys, "bank", "--help")
    assert status == 0 and "bank info" in out and "doctor" not in out
    assert run(capsys, "bank")[0] == 2


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("fly",), "'fly'; expected one of doctor"),
        (("demo", "--agent.ppo.gamm", "1"), "agent.ppo.gamm"),
        (("demo", "--agent.ppo.gamma", "3"), "agent.ppo.gamma"),
        (("demo", "--env.sensor.f1_hz", "24 MHz"), "f1_hz"),
        (("demo", "--env.sensor.f2_hz", "30e6"), "f2_hz"),
        (("demo", "--config", "/no/such.yaml"), "such.yaml"),
        (("render", "--train_clips", "-1"), "train_clips"),
    ],
)
def test_wrong_usage_is_one_sentence_and_status_2(capsys, words, says):
    status, out, err = run(capsys, *words)
    assert status == 2 and out == ""
    assert says in err and err.count("\n") == 1 and "Traceback" not in err


def test_an_unknown_key_in_a_file_is_named(capsys, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("agent: {ppo: {gamma: 0.9, lambda: 1}}\n")
    status, _, err = run(capsys, "demo", "--config", path)
    assert status == 2 and "lambda" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("bank", "info", "/no/bank"), "/no/bank"),
        (("report", "/no/results"), "results.json is missing"),
        (("train", "--env.bank", "/no/bank"), "/no/bank"),
        (("unwrap", "evaluate", "/no/net"), "/no/net"),
    ],
)
def test_failures_are_one_sentence_and_status_1(capsys, words, says):
    status, _, err = run(capsys, *words)
    assert status == 1 and says in err.splitlines()[-1] and "Traceback" not in err


def test_a_missing_scheduler_names_its_cure(capsys, tmp_path, tiny):
    status, _, err = run(capsys, "evaluate", tmp_path, *tiny)
    assert status == 1 and "agent.json" in err and "shotenv train" in err


def test_bank_info_and_verify(capsys, tiny_bank, tmp_path):
    status, out, _ = run(capsys, "bank", "info", tiny_bank, "--json", tmp_path / "n.json")
    assert status == 0 and "64 frames of 32 x 24 pixels" in out
    assert json.loads((tmp_path / "n.json").read_text())["frames"] == 64
    assert run(capsys, "bank", "verify", tiny_bank)[0] == 0


def test_a_damaged_bank_is_told_from_a_good_one(capsys, tmp_path, tiny_bank):
    import shutil

    shutil.copytree(tiny_bank, tmp_path / "bank")
    path = next((tmp_path / "bank").glob("clips/*/gray.npy"))
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(bytes(content))
    status, _, err = run(capsys, "bank", "verify", tmp_path / "bank")
    assert status == 1 and str(path) in err


def test_a_bank_is_published_opened_and_verified_by_url(capsys, tmp_path, tiny_bank):
    url = f"file://{tmp_path}/place"
    assert run(capsys, "bank", "publish", tiny_bank, "--to", url)[0] == 0
    status, out, _ = run(capsys, "bank", "info", url)
    assert status == 0 and "64 frames of 32 x 24 pixels" in out
    assert run(capsys, "bank", "verify", url)[0] == 0
    path = next((tmp_path / "place" / "objects").iterdir())
    path.write_bytes(path.read_bytes()[:-1])
    status, _, err = run(capsys, "bank", "verify", url)
    assert status == 1 and f"objects/{path.name}" in err and "publish the bank again" in err
    status, _, err = run(capsys, "bank", "info", f"file://{tmp_path}/nothing")
    assert status == 1 and "holds no contents.json" in err and "Traceback" not in err


def test_report_is_written_anew(capsys, tmp_path):
    write_json(tmp_path / RESULTS, made_up_results())
    write_json(tmp_path / TIMELINE, made_up_timeline())
    write_json(tmp_path / CHOICES, made_up_choices())
    write_strip(tmp_path / FRAMES, made_up_strip())
    status, out, _ = run(capsys, "report", tmp_path)
    assert status == 0 and out.strip() == str(tmp_path / "report.html")
    assert (tmp_path / "report.html").stat().st_size > 10**6


def test_reports_of_several_evaluations_are_compared(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, f1_hz in (("wide", 10e6), ("fine", 24e6)):
        write_json(tmp_path / name / RESULTS, made_up_results(f1_hz=f1_hz))
    status, out, _ = run(capsys, "report", "wide", "fine")
    assert status == 0 and out == "runs/comparison.html\n"
    status, out, _ = run(capsys, "report", "wide", "fine", "--out", "both.html")
    assert status == 0 and out == "both.html\n"
    assert "2 evaluations: wide, fine" in (tmp_path / "both.html").read_text()
    status, _, err = run(capsys, "report", "wide", "--out", "both.html")
    assert status == 2 and "out is both.html; expected with several folders alone" in err
    status, _, err = run(capsys, "report", "wide", "wide/")
    assert status == 1 and "results has wide twice" in err


def test_demo_does_the_main_job(capsys, tmp_path, tiny):
    out = tmp_path / "demo"
    small = "--agent.ppo.total_steps 64 --agent.ppo.num_envs 2 --agent.ppo.rollout_steps 16"
    small += " --agent.ppo.batch_size 16 --agent.ppo.drives 2 --agent.regression.drives 4"
    small += " --agent.regression.validation_drives 4 --agent.regression.members 1"
    small += " --env.frames_per_drive 16 --study.drives 2 --study.tuning_drives 2"
    small += " --study.bootstrap_draws 100 --study.prices [0.01,0.1]"
    small += " --study.families [snr_threshold,cycle]"
    words = ("demo", "--out", out, "--json", tmp_path / "n.json", *small.split(), *tiny)
    status, printed, _ = run(capsys, *words)
    assert status == 0 and printed.rstrip().endswith(str(out / "report.html"))
    assert "At half the laser energy of 8 DCS in every frame it errs" in printed
    results = json.loads((out / "results.json").read_text())
    assert results == json.loads((tmp_path / "n.json").read_text())
    assert set(results["policies"]) == {
        *("scheduler", "snr_threshold", "cycle", "random"),
        *("always_2", "always_4", "always_8"),
    }
    for policy in results["policies"].values():
        assert set(policy["return"]) == {"mean", "low", "high"}
        assert sum(policy["shots_share"]) == pytest.approx(1.0)
    assert results["drives"] == 2 and results["seeds"] == [1000, 1001]


def test_problem_writes_its_numbers(capsys, tmp_path, tiny):
    words = ("--env.frames_per_drive", 8, "--study.drives", 2, "--study.tuning_drives", 2)
    path = tmp_path / "problem.json"
    status, out, _ = run(capsys, "problem", *words, "--json", path, *tiny)
    assert status == 0 and "Clairvoyant optimum over 2 test drives" in out
    bank, unwrapper = tiny[1], tiny[3]
    measured = f"bank {bank}, unwrapper {unwrapper}, laser vcsel"
    held = "holds" if json.loads(path.read_text())["holds"] else "DOES NOT hold"
    assert out.startswith(f"{measured}; reward: error 1.0, ")
    assert out.endswith(f"This problem ({measured}) {held} every goal.\n")
    shares = json.loads(path.read_text())["optimum"]["shots_share"]
    assert sum(share["mean"] for share in shares.values()) == pytest.approx(1.0)


def test_unwrap_evaluate_scores_every_method(capsys, tmp_path, tiny_bank, tiny_unwrapper):
    path = tmp_path / "scores.json"
    words = ("unwrap", "evaluate", tiny_unwrapper, "--bank", tiny_bank, "--json", path)
    status, out, err = run(capsys, *words)
    assert status == 0, err
    found = json.loads(path.read_text())
    assert "8 DCS" in out and found["frames"] == 20
    eight, wrapped = found["methods"]["8 DCS"], found["methods"]["4 DCS wrap 0"]
    assert eight["wrap_accuracy"] > 0.9 and eight["mae_m"] < 0.5 * wrapped["mae_m"]
    assert set(found["families"]) == set(FAMILIES)


def test_doctor_exits_by_what_it_finds(capsys, monkeypatch, tmp_path):
    good = Finding("python", True, "3.11")
    bad = Finding("LLVM", False, "no library found", "apt-get install libllvm19")
    monkeypatch.setattr("agents.cli.doctor.examine", lambda: (good,))
    assert run(capsys, "doctor")[0] == 0
    monkeypatch.setattr("agents.cli.doctor.examine", lambda: (good, bad))
    status, out, _ = run(capsys, "doctor", "--json", tmp_path / "found.json")
    assert status == 1 and "mend it with: apt-get install libllvm19" in out
    assert json.loads((tmp_path / "found.json").read_text())[1]["well"] is False
