"""What the doctor demands: the packages of the main job, and no others."""

from importlib.metadata import PackageNotFoundError

import pytest

from agents.cli import doctor

REQUIREMENTS = [
    "numpy>=1.26",
    'jsonargparse[signatures]<5,>=4.49; extra == "agents"',
    'mitsuba<4,>=3.7; extra == "render"',
    "lightning<3,>=2.6.6; extra == 'unwrap'",
    'onnx>=1.18; extra == "export"',
    'shotenv[render,unwrap]; extra == "all"',
    'astropy>=7; extra == "an_extra_to_come"',
]


def test_packages_are_those_of_the_main_job(monkeypatch):
    def version(name):
        if name == "mitsuba":
            raise PackageNotFoundError(name)
        return "1.0"

    monkeypatch.setattr(doctor, "requires", lambda name: REQUIREMENTS)
    monkeypatch.setattr(doctor, "version", version)
    found = {one.name: one for one in doctor.packages()}
    assert list(found) == ["jsonargparse", "lightning", "mitsuba", "numpy"]
    assert [name for name, one in found.items() if not one.well] == ["mitsuba"]
    assert found["mitsuba"].cure == "pip install 'shotenv[all]'"


def test_a_missing_package_ends_the_examination(monkeypatch):
    """What comes after would import it, and end in a traceback."""
    missing = doctor.Finding("mitsuba", False, "not installed", "pip install 'shotenv[all]'")
    monkeypatch.setattr(doctor, "packages", lambda: (missing,))
    monkeypatch.setattr(doctor, "torch_build", lambda: pytest.fail("looked on"))
    assert doctor.examine()[-1] == missing
