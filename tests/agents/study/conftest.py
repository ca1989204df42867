"""Files that short studies are made of."""

import pytest
import yaml
from short_studies import FAST

from shotenv.config.env import EnvConfig
from shotenv.config.reader import configs_dir, read_config


@pytest.fixture
def files(tmp_path, tiny_kwargs):
    """A preset and two learners, as YAML files."""
    shipped = read_config(EnvConfig, configs_dir() / "env" / "default.yaml")
    env = shipped.model_dump(mode="json") | tiny_kwargs | {"frames_per_drive": 8}
    for name, content in {"short": env, "fast": FAST, "linear": {**FAST, "hidden": []}}.items():
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(content))
    return tmp_path
