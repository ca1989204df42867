"""Studies and trainings on a place: the numbers of a folder; what is half there never counts."""

from __future__ import annotations

import json
import tempfile
import uuid
import zipfile
from contextlib import nullcontext
from pathlib import Path

import pytest
import yaml
from cut_off_places import CutOffFileSystem
from short_studies import plan_of
from watched_processes import wait_until

from agents.cli.entry import main
from agents.study import job_runs, published_work, seeds
from agents.study.jobs import Job, jobs_of
from agents.study.published_jobs import publish_result, publish_study
from agents.study.published_work import Shelf
from agents.study.seeds import train_seeds
from unwrap.storage.fetching import fetch
from unwrap.storage.place import Place, StorageError
from unwrap.storage.publishing import publish_contents, read_contents, standing_parts
from unwrap.support import write_text


def run_here(function, tasks, *_, **__):
    """In place of workers: each task in this process; an error as its result."""
    for task in tasks:
        try:
            yield task, function(task)
        except Exception as error:
            yield task, error


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch, request):
    if "slow" not in request.keywords:
        monkeypatch.setattr(job_runs, "run_tasks", run_here)
        monkeypatch.setattr(seeds, "run_tasks", run_here)


@pytest.fixture
def url() -> str:
    return f"memory://{uuid.uuid4().hex}"


def studied(files) -> list[Job]:
    """A scheduler and a rule, also played elsewhere, and chance."""
    hot = {"preset": str(files / "short.yaml"), "env": {"laser": {"ambient_k": [320.0, 325.0]}}}
    return jobs_of(transfer_plan(files, hot))


def transfer_plan(files, hot):
    return plan_of(
        files,
        policies=[str(files / "fast.yaml"), "fixed", "random"],
        ablations={},
        seeds=[0],
        transfer={"source": "short", "policies": ["fast", "fixed"], "tables": {"hot": hot}},
    )


def arrays_of(folder: Path) -> dict[str, bytes]:
    """What does not tell how long something took, or when."""
    kinds = (".npz", ".safetensors")
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*")}
    return {name: path.read_bytes() for name, path in found.items() if path.suffix in kinds}


def test_jobs_on_a_place_give_the_numbers_of_a_folder(files, url, monkeypatch):
    jobs, here, copy = played(files), files / "here", files / "copy"
    job_runs.run_jobs(jobs, here)
    job_runs.run_jobs(jobs[:1], files / "begun", url=url)
    assert set(standing_parts(Place(url), "study")) == {"short/random-0"}
    run, ran = job_runs.run_job, []
    monkeypatch.setattr(job_runs, "run_job", lambda task: ran.append(task.job.name) or run(task))
    job_runs.run_jobs(jobs, copy, url=url)
    assert ran[0::2] == [job.name for job in jobs[1:]], (
        "each in a folder of its own, and what stands not again"
    )
    results = {name: content for name, content in arrays_of(here).items() if "npz" in name}
    assert arrays_of(copy) == results and len(results) == len(jobs)
    assert not list(copy.rglob("*.safetensors")), "schedulers stay where they are"

    (copy / "results.json").write_text("{}")
    publish_study(url, jobs, copy)
    contents = read_contents(Place(url))
    assert contents.files[-1].path == "results.json"
    fetch(Place(url), contents, files / "whole")
    wanted = {n: c for n, c in arrays_of(here).items() if "checkpoint" not in n}
    assert arrays_of(files / "whole") == wanted and "short/fast-0/policy.safetensors" in wanted
    assert (files / "whole" / "short" / "fast-0.log").is_file()


@pytest.fixture
def result(tmp_path) -> Path:
    """Files as a job writes them."""
    folder = tmp_path / "result"
    (folder / "short" / "fast-0").mkdir(parents=True)
    for name in ("fast-0.json", "fast-0.npz", "fast-0.log", "fast-0/policy.safetensors"):
        (folder / "short" / name).write_text(f"{name} " * 50)
    (folder / "short" / "fast-0" / "checkpoint.safetensors").write_text("large")
    (folder / "short" / "fast-00.json").write_text("of another")
    return folder


def test_a_result_of_which_publishing_breaks_anywhere_does_not_stand(files, result):
    (job,) = (job for job in studied(files) if job.name == "short/fast-0")
    url, cuts = "cutoff://study", 0
    while True:
        CutOffFileSystem.reset(fails_at=cuts + 1, empty=True)
        try:
            publish_result(url, job, result)
            break
        except StorageError as error:
            assert "connection lost" in str(error)
        cuts += 1
        CutOffFileSystem.reset()
        assert standing_parts(Place(url), "study") == {}
        assert Shelf(url, "study").fetch(job.name, files / "none", lambda path: True) is None
        publish_result(url, job, result)
        assert set(standing_parts(Place(url), "study")) == {job.name}
    assert cuts == 9  # Each of four files is asked for and written, then the listing.
    CutOffFileSystem.reset()
    listing = Shelf(url, "study").fetch(job.name, files / "fetched", lambda path: True)
    # What says that it is done comes last.
    assert [Path(file.path).name for file in listing.files] == [
        *("fast-0.log", "fast-0.npz", "policy.safetensors", "fast-0.json"),
    ]
    # An object that is gone, or cut: the job is to run again, here and in a study.
    place = Place(url)
    place.write(listing.files[1].object_name, b"cut")
    assert Shelf(url, "study").fetch(job.name, files / "again", lambda path: True) is None
    assert standing_parts(place, "study") == {}


def test_what_cannot_be_published_is_refused_before_anything_runs(files, url, monkeypatch):
    monkeypatch.setattr(job_runs, "run_job", lambda _: pytest.fail("run"))
    (job, *_) = studied(files)
    odd = Job("short", "my rule", "random", job.config)
    with pytest.raises(ValueError, match="'short/my rule-0' cannot be published; expected letters"):
        job_runs.run_jobs([odd], files / "copy", url=url)
    (files / "table.json").write_text("{}")
    publish_contents(Place(url), "bank-1", [], files, ["table.json"])
    with pytest.raises(StorageError, match="holds bank-1, not study; choose another place"):
        job_runs.run_jobs([job], files / "copy", url=url)
    with pytest.raises(StorageError, match="holds bank-1, not trainings"):
        train_seeds(job.config, [0], url)

    CutOffFileSystem.reset(empty=True)
    monkeypatch.setattr(seeds, "run_tasks", lambda *_, **__: pytest.fail("run"))
    monkeypatch.setattr(CutOffFileSystem, "pipe_file", lambda *_, **__: 1 // 0)
    with pytest.raises(StorageError, match="cannot write cutoff://denied"):
        job_runs.run_jobs([job], files / "copy", url="cutoff://denied")
    with pytest.raises(StorageError, match="cannot write cutoff://denied"):
        train_seeds(job.config, [0], "cutoff://denied")


def test_results_of_another_configuration_are_refused_and_kept(files, url):
    references = [job for job in studied(files) if job.name == "short/references-0"]
    job_runs.run_jobs(references, files / "one", url=url)
    before = standing_parts(Place(url), "study")
    plan = plan_of(files, study={"drives": 3, "tuning_drives": 2}, policies=["random"])
    with pytest.raises(ValueError, match=r"another configuration \(study differ\)"):
        job_runs.run_jobs(jobs_of(plan)[:1], files / "two", url=url)
    assert standing_parts(Place(url), "study") == before


def wait_for(place: Place, folder: str, name: str = "") -> str:
    def found() -> list[str]:
        return [one for one in place.sizes(folder) if one.rpartition("-")[0].endswith(name)]

    wait_until(found)
    return found()[0]


def test_a_training_is_kept_and_resumed(tmp_path, url, monkeypatch):
    monkeypatch.setattr(published_work, "KEPT_EVERY_S", 0.02)
    shelf, told, place = Shelf(url, "study"), {"seed": 1}, Place(url)
    first, second, other = (tmp_path / name for name in ("first", "second", "other"))
    with pytest.raises(RuntimeError, match="died"), shelf.resumed("a/b-0", told, first):
        first.mkdir()
        for name in ("policy.safetensors", "validation.json", "checkpoint.safetensors"):
            write_text(first / name, name)  # Whole at once: it is packed as soon as it is there.
        there = wait_for(place, "unfinished")
        raise RuntimeError("died")
    with shelf.resumed("a/b-0", told, second):
        # What a training has at its end alone is left out.
        found = {path.name: path.read_text() for path in second.iterdir()}
    assert found == {n: n for n in ("policy.safetensors", "checkpoint.safetensors")}
    with shelf.resumed("a/b-0", {"seed": 2}, other):
        assert not other.exists(), "of another configuration"

    whole = place.read(there, most_bytes=10**6)
    place.write(there, whole.replace(b"checkpoint.safetensorsP", b"checkpoint.safetensor$P"))
    damaged = r"unfinished/study/a/b-0.*zip is damaged.*delete it"
    with pytest.raises(StorageError, match=damaged), shelf.resumed("a/b-0", told, other):
        pass
    locked = whole.replace(b"PK\3\4\x14\0\0", b"PK\3\4\x14\0\1").replace(
        b"PK\1\2\x14\3\x14\0\0", b"PK\1\2\x14\3\x14\0\1"
    )
    place.write(there, locked)
    said = r"encrypted.*delete it"
    with pytest.raises(StorageError, match=said), shelf.resumed("a/b-0", told, other):
        pass
    place.write(there, whole[:-30])
    with pytest.raises(StorageError, match="is damaged"), shelf.resumed("a/b-0", told, other):
        pass
    with zipfile.ZipFile(tmp_path / "bad.zip", "w") as packed:
        packed.writestr("../outside", "x")
    place.write(there, (tmp_path / "bad.zip").read_bytes())
    odd = "cannot be published"
    with pytest.raises(StorageError, match=odd), shelf.resumed("a/b-0", told, other):
        pass
    assert not (tmp_path / "outside").exists() and not other.exists()


def test_a_full_disk_of_this_machine_is_no_damage_of_the_place(tmp_path, url, monkeypatch):
    monkeypatch.setattr(published_work, "KEPT_EVERY_S", 0.02)
    shelf, full, folder = Shelf(url, "study"), tmp_path / "full", tmp_path / "run"
    with shelf.resumed("a/b-0", {}, folder):
        folder.mkdir()
        write_text(folder / "checkpoint.safetensors", "checkpoint")
        wait_for(Place(url), "unfinished")
    full.mkdir()
    (full / "unfinished.zip").symlink_to("/dev/full")
    monkeypatch.setattr(tempfile, "TemporaryDirectory", lambda: nullcontext(str(full)))
    with pytest.raises(OSError, match="No space left") as told, shelf.resumed("a/b-0", {}, folder):
        pass
    assert "damaged" not in str(told.value)


def test_what_is_done_leaves_nothing_unfinished_but_others_work(tmp_path, url, monkeypatch):
    monkeypatch.setattr(published_work, "KEPT_EVERY_S", 0.02)
    shelf, place = Shelf(url, "study"), Place(url)
    for name in ("a/b-0", "a/b-0-1", "a/b-00"):
        folder = tmp_path / name
        with shelf.resumed(name, {}, folder):
            folder.mkdir(parents=True)
            write_text(folder / "checkpoint.safetensors", name)
            wait_for(place, "unfinished", name)
    (tmp_path / "a" / "b-0.json").write_text("{}")
    shelf.publish("a/b-0", tmp_path, lambda path: path.startswith(("a/b-0/", "a/b-0.")))
    left = sorted(name.rpartition("-")[0] for name in place.sizes("unfinished"))
    assert left == ["unfinished/study/a/b-0-1", "unfinished/study/a/b-00"]


def test_a_place_that_fails_meanwhile_ends_no_training(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(published_work, "KEPT_EVERY_S", 0.02)
    CutOffFileSystem.reset(empty=True)
    with Shelf("cutoff://study", "study").resumed("a-0", {}, tmp_path / "run"):
        CutOffFileSystem.reset(fails_at=1)
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "checkpoint.safetensors").write_text("one")
        wait_until(lambda: CutOffFileSystem.operations >= 2)
    assert "connection lost; training goes on" in capsys.readouterr().err


def test_seeds_on_a_place_give_what_they_give_in_a_folder(files, url):
    (job,) = (job for job in studied(files) if job.name == "short/fast-0")
    (here,) = train_seeds(job.config, [3], files / "here")
    assert train_seeds(job.config, [3], url) == [f"{url}/seed-3"]
    before = standing_parts(Place(url), "trainings")
    train_seeds(job.config, [3], url)
    assert standing_parts(Place(url), "trainings") == before
    fetch(Place(url), read_contents(Place(url)), files / "fetched")
    weights = "policy.safetensors"
    assert (files / "fetched" / "seed-3" / weights).read_bytes() == (here / weights).read_bytes()
    agent = job.config.agent.model_copy(update={"hidden": (5,)})
    with pytest.raises(ValueError, match="belongs to another configuration"):
        train_seeds(job.config.model_copy(update={"agent": agent}), [3], url)
    assert standing_parts(Place(url), "trainings") == before


def test_one_training_wants_a_folder(tmp_path, capsys):
    assert main(["train", "--out", f"file://{tmp_path}/x"]) == 2
    assert f"out is file://{tmp_path}/x, a place: expected with --seeds" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        *(["train", "--out"], ["train", "--seeds", "0", "--out"], ["study", "none.yaml", "--out"]),
        *(["demo", "--env.bank"], ["bank", "info"], ["bank", "verify"], ["fetch", "--out", "x"]),
        ["render", "--to"],
    ],
)
def test_a_password_in_a_url_is_told_by_no_command(words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([*words, "s3://key:secret@shelf/x"]) in (1, 2)
    told = capsys.readouterr()
    assert "secret" not in told.out + told.err and "has a password" in told.err
    assert list(tmp_path.iterdir()) == []


def played(files) -> list[Job]:
    """Chance, a scheduler, and the scheduler played elsewhere."""
    by_name = {job.name: job for job in studied(files)}
    return [by_name[name] for name in ("short/random-0", "short/fast-0", "hot/fast-0")]


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["local", "ray"])
def test_workers_that_share_a_place_alone(files, executor, monkeypatch):
    jobs, url = played(files), f"file://{files}/place"
    job_runs.run_jobs(jobs, files / "copy", url=url, executor=executor, workers=2)
    monkeypatch.setattr(job_runs, "run_tasks", run_here)
    job_runs.run_jobs(jobs, files / "here")
    results = {n: c for n, c in arrays_of(files / "here").items() if "npz" in n}
    assert arrays_of(files / "copy") == results and len(results) == len(jobs)


@pytest.mark.slow
def test_the_command_gives_the_numbers_of_one_into_a_folder(files, monkeypatch, capsys):
    monkeypatch.setattr(job_runs, "run_tasks", run_here)
    plan = transfer_plan(files, {"preset": str(files / "short.yaml")})
    file, url = files / "study.yaml", f"file://{files}/place"
    file.write_text(yaml.safe_dump(plan.model_dump(mode="json")))
    for out in (url, str(files / "here")):
        assert main(["study", str(file), "--out", out]) == 0
    assert f"Numbers: results.json of {url}" in capsys.readouterr().out
    fetch(Place(url), read_contents(Place(url)), files / "fetched")
    told = [json.loads((files / n / "results.json").read_text()) for n in ("fetched", "here")]
    assert {**told[0], "seconds": 0} == {**told[1], "seconds": 0}
